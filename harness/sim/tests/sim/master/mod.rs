//! Tests of the master's end of the bus on simulated rings: exhaustive where that is possible, random
//! elsewhere.

mod common;
mod faults;
mod figures;
mod hostile;
mod named;
mod recovery;
mod thin;
mod truth;
