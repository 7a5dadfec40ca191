//! The program on simulated rigs: qualifying, exploring, and the evidence that it leaves, in virtual time.

mod edited;
#[path = "../common/edits.rs"]
mod edits;
mod embedded;
mod explored;
mod lines;
mod merge;
mod merge_qualified;
mod named;
#[path = "../common/program.rs"]
mod program;
mod simulated;
