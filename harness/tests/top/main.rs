//! `drivebench top`: its pages, its keys, and the program in a terminal of its own.

mod pages;
#[path = "../served/ring.rs"]
mod ring;
mod terminal;
mod tty;
