//! The program on simulated rigs: qualifying, exploring, and the evidence that it leaves, in virtual time.

#[path = "../common/debian.rs"]
mod debian;
#[path = "../common/edits.rs"]
mod edits;
mod embedded;
mod evidence;
mod explore;
mod inverters_on_rig;
mod merge;
mod merge_qualified;
mod named;
mod on_can;
mod on_can_qualify;
mod port_interlocks;
#[path = "../common/program.rs"]
mod program;
mod simulated;
mod spread;
