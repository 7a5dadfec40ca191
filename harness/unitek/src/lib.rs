//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod capture;
pub mod cli;
pub mod dbc;
pub mod dissector;
pub mod driver;
pub mod explore;
pub mod gate;
pub mod judge;
pub mod language;
mod live;
pub mod manual;
pub mod report;
pub mod rig;
pub mod safe_state;
pub mod serve;
#[cfg(test)]
mod serve_tests;
pub mod simulate;
pub mod value;
mod whereabouts;

/// The buses of a rig's file in tests.
#[cfg(test)]
static BUSES: harness_bench::rig::buses::RigBuses =
    harness_bench::rig::buses::RigBuses::alone(&rig::PORT);
