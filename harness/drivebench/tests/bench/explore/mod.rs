//! The commands that explore, as processes.

mod command;
mod frames;
mod lines;
mod rings;
mod telegrams;
mod witness;
