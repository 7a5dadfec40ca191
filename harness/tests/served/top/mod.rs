//! `drivebench top`: its pages, its keys, and the program in a terminal of its own.

mod terminal;
mod tty;
