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
/// A host or a drive.
pub type Member<D> = crate::participant::Participant<crate::octet_segment::LineHost, D>;

#[cfg(test)]
mod property;
pub mod ramp;
pub mod reference;
mod setup;
pub mod slave;

pub use drive::Drive;
pub use inverter::Inverter;
pub use setup::{History, InverterSetup, Stimulus};
pub use slave::Slave;

use crate::octet_segment::OctetSegment;

crate::compiled::compiled_here!(
    OctetSegment<Member<Box<deviation::Deviant>>>,
    OctetSegment<Member<Drive>>
);
