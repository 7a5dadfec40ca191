//! NORDAC *vector* inverters on PROFIBUS DP: their words in a scenario, simulated slaves, tables and pictures.

pub(crate) mod deviations;
pub mod language;
pub(crate) mod manual;
pub mod report;
pub mod simulate;
