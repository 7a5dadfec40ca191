//! The commands that explore, as processes.

mod command;
mod lines;
mod rings;
mod shared;
