//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.

pub mod campaign;
pub(crate) mod capture;
pub(crate) mod cli;
pub mod dbc;
pub mod dissector;
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
pub mod value;
mod whereabouts;
