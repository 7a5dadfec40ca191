//! NORDAC *vector* inverters on PROFIBUS DP: their words in a scenario, simulated slaves, tables and pictures.

pub mod campaign;
pub(crate) mod capture;
#[cfg(test)]
mod captured_levels_tests;
#[cfg(test)]
mod captured_tests;
pub(crate) mod cli;
pub(crate) mod deviations;
pub(crate) mod dissector;
pub mod driver;
pub mod explore;
pub mod gate;
pub mod judge;
pub mod language;
mod live;
pub(crate) mod manual;
pub mod report;
pub mod rig;
pub mod safe_state;
pub(crate) mod serve;
#[cfg(test)]
mod serve_tests;
pub mod simulate;
pub(crate) mod stream;
pub mod value;

/// The GSD file: the unit master file of the manual.
pub(crate) const GSD: &str = include_str!("nordac.gsd");
