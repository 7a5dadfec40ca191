//! A ring with ports: in use, its scenarios, whether it is sound, what its line is like, and its figures.

mod able;
mod beside;
#[cfg(test)]
mod busy;
mod cause;
mod condition;
mod driven;
pub mod figures;
pub(crate) mod health;
mod held_session;
pub(crate) mod interlock;
pub mod judge;
pub(crate) mod left_open;
pub(crate) mod line_test;
pub mod open;
mod permitted;
mod put_back;
mod reach;
mod ring_judge;
mod ring_run;
pub mod run;
pub(crate) mod session;
pub mod shared;
pub mod sim;
pub mod wrong_parity;

pub(crate) use beside::PlayedOnRings;
pub use beside::{BesideTwin, OnRings};
pub use condition::{InterlockCondition, condition};
pub use driven::Driven;
pub(crate) use health::examine;
pub use health::{RingHealth, Unhealthy};
pub use permitted::limits;
pub(crate) use ring_judge::RingJudge;
pub(crate) use ring_run::RingRun;
pub use run::{Run, Way, play_one};
pub use session::Session;
pub use sim::RINGS;
pub use sim::RigOfRings;

/// Reads the file of a rig with rings.
#[cfg(test)]
pub(crate) fn parse(
    source: &harness_bench::scenario::source::Source,
) -> Result<harness_bench::rig::Rig, harness_bench::scenario::problem::Problems> {
    static BUSES: harness_bench::rig::buses::RigBuses =
        harness_bench::rig::buses::RigBuses::of_rings(RINGS);
    harness_bench::rig::check::parse(source, &BUSES)
}
