//! The simulated NORDAC *vector*: the inverter and its PROFIBUS module.
//!
//! Sections are cited as in [`harness_proto::nordac`] and [`harness_proto::profibus`].

pub mod deviation;
mod drive;
pub mod faults;
pub mod frequency;
pub mod fuzz;
pub mod inverter;
pub mod machine;
pub mod parameters;
#[cfg(test)]
mod property;
pub mod ramp;
pub mod reference;
mod setup;
pub mod slave;

pub use drive::{Drive, Member};
pub use inverter::Inverter;
pub use setup::Setup;
pub use slave::Slave;
