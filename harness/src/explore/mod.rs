//! Exploring: generated conversations, tried on a ring beside its model.
//!
//! A [`Case`] is a conversation as a value. [`Generator`] and [`mutate`] make them from a seed, within a [`Swarm`]'s subset of what a
//! conversation can have; a [`Target`] tries them: [`OnSim`] on simulated rings, [`OnRig`] on a rig with ports behind its guard. A [`Pool`]
//! keeps the cases that show something new, a difference from the model is a [`Finding`], and every finding is a scenario
//! ([`text`](mod@text)). A [`FuzzRun`] does all of it and a [`FuzzRecord`] writes it down as it happens. [`shrink`](mod@shrink) reduces
//! findings and [`promote`](mod@promote) makes them regression tests.

mod campaign;
mod confirm;
mod dice;
mod error;
pub(crate) mod files;
mod record;
mod swarm;
mod target;

pub(crate) use campaign::count_finding;
pub use campaign::{Bounds, FuzzRun, RunEnd, Watcher};
pub use confirm::judged_again;
pub use dice::Dice;
pub use error::ExploreError;
pub use record::{FuzzRecord, FuzzSettings, KeptRun, LogLine, Progress, RECORD, read};
pub use swarm::{Spice, Swarm};
pub use target::{Rehearsal, Target, Tried};

/// What the one bus that is explored today gives: its cases and targets.
pub use crate::buses::novobus::explore::{
    Act, ActKind, AttemptRecord, Case, CaseScope, Command, CommandSent, Damage, Difference,
    Finding, Generator, Harm, MOST_ACTS, MOST_BYTES, MOST_KEPT, MOST_NET, MasterView, OnRig, OnSim,
    OtherRing, Planted, Pool, RingScope, RingSetup, Spoil, Talk, To, against_model,
    against_reference, against_witnesses, beside, by_novelty, features, mutate, page, play,
    promote, shrink, text,
};
pub(crate) use crate::buses::novobus::explore::{OnRecord, drive_name, tour};
