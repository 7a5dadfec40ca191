//! Exploring the ring: cases as values, and what generates, plays, judges and shrinks them.

mod case;
mod confirm;
mod expect;
mod fuzz_case;
mod generate;
mod html;
mod idiom;
mod judge;
pub(crate) mod masters;
mod mutate;
mod novelty;
pub(crate) mod on_record;
mod on_rig;
mod on_sim;
mod oracle;
mod order;
mod play;
mod promote;
mod setup;
pub(crate) mod shrink;
mod spice;
pub(crate) mod text;
mod tour;

#[cfg(test)]
pub(crate) use case::OtherRing;
pub(crate) use case::{Act, ActKind, Case, Harm, MOST_BYTES};
#[cfg(test)]
pub(crate) use generate::Generator;
pub(crate) use generate::{CaseScope, RingScope};
#[cfg(test)]
pub(crate) use mutate::mutate;
pub(crate) use novelty::features;
pub(crate) use on_record::AttemptRecord;
pub(crate) use on_rig::OnRig;
pub(crate) use on_sim::OnSim;
#[cfg(test)]
pub(crate) use oracle::{Difference, against_reference, beside};
pub(crate) use play::MasterView;
#[cfg(test)]
pub(crate) use play::play;
pub(crate) use setup::RingSetup;
pub(crate) use setup::planted_setup;
pub(crate) use spice::Spice;

/// A finding on a ring.
pub(crate) type Finding = harness_bench::explore::Finding<Case>;
/// The settings of a run on rings.
pub(crate) type FuzzSettings = harness_bench::explore::FuzzSettings<Case>;
/// A run on rings.
pub(crate) type FuzzRun = harness_bench::explore::FuzzRun<Case>;
/// A run on rings that was read.
pub(crate) type KeptRun = harness_bench::explore::KeptRun<Case>;
/// The cases that a run on rings keeps.
pub(crate) type Pool = harness_bench::explore::Pool<Case>;
/// What a model of a ring makes of a case.
pub(crate) type Rehearsal = harness_bench::explore::Rehearsal<Case>;
/// The outcome of a case on a ring.
pub(crate) type Tried = harness_bench::explore::Tried<Case>;
/// What a round of a run on rings may have.
pub(crate) type Swarm = harness_bench::explore::Swarm<Spice>;
