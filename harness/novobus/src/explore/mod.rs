//! Exploring the ring: cases as values, and what generates, plays, judges and shrinks them.

mod case;
mod confirm;
mod expect;
mod finding;
mod fuzz_case;
mod generate;
mod html;
mod idiom;
mod judge;
pub mod masters;
mod mutate;
mod novelty;
pub(crate) mod on_record;
mod on_rig;
mod on_sim;
mod oracle;
mod order;
mod page;
mod play;
mod promote;
mod setup;
pub mod shrink;
mod spice;
pub mod text;
mod tour;

pub use case::{Act, ActKind, Case, Damage, Harm, MOST_ACTS, MOST_BYTES, OtherRing, Talk, To};
pub use finding::{scenario, sources};
pub use generate::{CaseScope, Generator, RingScope};
pub use mutate::mutate;
pub use novelty::features;
pub use on_record::AttemptRecord;
pub use on_rig::OnRig;
pub use on_sim::OnSim;
pub use oracle::{Difference, against_reference, beside};
pub use order::{CommandSent, RawCommand, Spoil};
pub use page::page;
pub use play::{MasterView, play};
pub use setup::RingSetup;
pub use setup::planted_setup;
pub use spice::Spice;

/// A finding on a ring.
pub type Finding = harness_bench::explore::Finding<Case>;
/// The settings of a run on rings.
pub type FuzzSettings = harness_bench::explore::FuzzSettings<Case>;
/// A run on rings.
pub type FuzzRun = harness_bench::explore::FuzzRun<Case>;
/// A run on rings that was read.
pub type KeptRun = harness_bench::explore::KeptRun<Case>;
/// A line of the record of a run on rings.
pub type LogLine = harness_bench::explore::LogLine<Case>;
/// The cases that a run on rings keeps.
pub type Pool = harness_bench::explore::Pool<Case>;
/// What a model of a ring makes of a case.
pub type Rehearsal = harness_bench::explore::Rehearsal<Case>;
/// The outcome of a case on a ring.
pub type Tried = harness_bench::explore::Tried<Case>;
/// What a round of a run on rings may have.
pub type Swarm = harness_bench::explore::Swarm<Spice>;
