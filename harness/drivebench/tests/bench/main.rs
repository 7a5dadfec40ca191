//! The program on simulated rigs: qualifying, exploring, and the evidence that it leaves, in virtual time.

mod edited;
#[path = "../common/edits.rs"]
mod edits;
mod embedded;
mod explored;
mod inverters_on_rig;
mod merge;
mod merge_qualified;
mod named;
mod on_can;
mod on_can_qualify;
#[path = "../common/program.rs"]
mod program;
mod simulated;
