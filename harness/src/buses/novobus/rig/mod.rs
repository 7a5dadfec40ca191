//! A ring with ports: in use, its scenarios, whether it is sound, what its line is like, and its figures.

mod beside;
#[cfg(test)]
mod busy;
mod cause;
mod condition;
mod driven;
pub mod figures;
pub(crate) mod health;
pub(crate) mod interlock;
pub(crate) mod judge;
pub(crate) mod left_open;
pub(crate) mod line_test;
pub mod open;
mod permitted;
mod put_back;
pub(crate) mod run;
pub(crate) mod session;
pub mod shared;
pub(crate) mod sim;
pub(crate) mod wrong_parity;

pub use beside::{BesideTwin, OnRings, PlayedOnRings};
pub use cause::LikelyCause;
pub use condition::{InterlockCondition, condition};
pub use driven::Driven;
pub use health::{RingHealth, Unhealthy, examine};
pub(crate) use permitted::limits;
pub use run::{Run, Way, play_one};
pub use session::Session;
pub(crate) use sim::RINGS;
pub use sim::RigOfRings;

/// Reads the file of a rig with rings.
#[cfg(test)]
pub(crate) fn parse(
    source: &crate::scenario::source::Source,
) -> Result<crate::rig::Rig, crate::scenario::problem::Problems> {
    static BUSES: crate::rig::buses::RigBuses = crate::rig::buses::RigBuses::of_rings(RINGS);
    crate::rig::check::parse(source, &BUSES)
}
