//! Tests of the master's end of the bus on simulated rings: exhaustive where that is possible, random
//! elsewhere.

mod common;
mod figures;
mod recovery;
mod thin;
