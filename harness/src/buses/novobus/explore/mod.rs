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

pub use case::{
    Act, ActKind, Case, Damage, Harm, MOST_ACTS, MOST_BYTES, MOST_NET, OtherRing, Talk, To,
};
pub use confirm::judged_again;
pub use finding::{scenario, sources};
pub use generate::{CaseScope, Generator, RingScope};
pub use mutate::mutate;
pub use novelty::features;
pub use on_record::AttemptRecord;
pub use on_rig::OnRig;
pub use on_sim::OnSim;
pub use oracle::{Difference, against_model, against_reference, against_witnesses, beside};
pub use order::{CommandSent, RawCommand, Spoil};
pub use page::page;
pub use play::{MasterView, play};
pub use setup::RingSetup;
pub(crate) use setup::planted_setup;
pub use spice::Spice;

/// A finding on a ring.
pub type Finding = crate::explore::Finding<Case>;
/// The settings of a run on rings.
pub type FuzzSettings = crate::explore::FuzzSettings<Case>;
/// A run on rings.
pub type FuzzRun = crate::explore::FuzzRun<Case>;
/// A run on rings that was read.
pub type KeptRun = crate::explore::KeptRun<Case>;
/// A line of the record of a run on rings.
pub type LogLine = crate::explore::LogLine<Case>;
/// The cases that a run on rings keeps.
pub type Pool = crate::explore::Pool<Case>;
/// What a model of a ring makes of a case.
pub type Rehearsal = crate::explore::Rehearsal<Case>;
/// The outcome of a case on a ring.
pub type Tried = crate::explore::Tried<Case>;
/// What a round of a run on rings may have.
pub type Swarm = crate::explore::Swarm<Spice>;
