//! `drivebench top`: its pages, its keys, and the program in a terminal of its own.

mod lines;
pub(crate) mod terminal;
pub(crate) mod tty;
