//! Tests of the simulated ring: exhaustive where that is possible, random elsewhere.

mod against_reference;
mod common;
mod grouped;
mod recovery;
mod shared;
mod single_faults;
