//! NORDAC *vector* inverters on PROFIBUS DP: their words in a scenario, simulated slaves, tables and pictures.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod capture;
#[cfg(test)]
mod captured_levels_tests;
#[cfg(test)]
mod captured_tests;
pub mod cli;
pub mod deviations;
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
pub mod stream;
pub mod value;

/// The GSD file: the unit master file of the manual.
pub const GSD: &str = include_str!("nordac.gsd");

/// The buses of a rig's file in tests.
#[cfg(test)]
static BUSES: harness_bench::rig::buses::RigBuses =
    harness_bench::rig::buses::RigBuses::alone(&rig::PORT);
