//! A ring with ports: in use, its scenarios, whether it is sound, what its line is like, and its figures.

mod able;
mod beside;
#[cfg(test)]
mod busy;
mod cause;
mod condition;
mod driven;
pub(crate) mod explanation;
pub(crate) mod figures;
pub(crate) mod health;
pub(crate) mod interlock;
pub(crate) mod judge;
pub(crate) mod line_test;
pub(crate) mod open;
mod permitted;
pub(crate) mod put_back;
mod reach;
mod ring_judge;
mod ring_run;
pub(crate) mod run;
pub(crate) mod session;
pub(crate) mod shared;
pub(crate) mod sim;
pub(crate) mod walk;
pub(crate) mod wrong_parity;

pub(crate) use beside::OnRings;
pub(crate) use beside::PlayedOnRings;
pub(crate) use condition::condition;
pub(crate) use driven::DriverAttempt;
pub(crate) use health::examine;
pub(crate) use permitted::limits;
pub(crate) use ring_judge::RingJudge;
pub(crate) use ring_run::RingRun;
pub(crate) use run::Run;
#[cfg(test)]
pub(crate) use run::{Way, play_one};
pub(crate) use session::{OfRings, Session};
pub(crate) use sim::RINGS;

/// Reads the file of a rig with rings.
#[cfg(test)]
pub(crate) fn parse(
    source: &harness_bench::scenario::source::Source,
) -> Result<harness_bench::rig::Rig, harness_bench::scenario::problem::Problems> {
    static BUSES: harness_bench::rig::buses::RigBuses =
        harness_bench::rig::buses::RigBuses::of_rings(RINGS);
    harness_bench::rig::check::parse(source, &BUSES)
}
