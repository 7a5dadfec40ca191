//! Exploring: generated conversations, tried on drives and compared with their model.
//!
//! A conversation is a value that implements [`FuzzCase`]; each bus has its own. It is made from a seed, within a [`Swarm`]'s subset of
//! what a conversation can have; a [`Target`] tries it: on simulated drives, or on a rig with ports behind its guard. A [`Pool`] keeps the
//! cases that show something new, a difference from the model is a [`Finding`], and every finding is a scenario. A [`FuzzRun`] does all of
//! it and a [`FuzzRecord`] writes it down as it happens.

pub mod again;
pub mod campaign;
pub mod confirm;
pub mod dice;
pub mod error;
pub mod files;
pub mod finding;
pub mod fuzz_case;
pub mod line;
pub mod page;
pub mod planted;
pub mod pool;
pub mod promote;
pub mod record;
pub mod smaller;
pub mod swarm;
pub mod target;

pub(crate) use again::file_of;
pub use again::{impossible, played_again, tried_again};
pub(crate) use campaign::count_finding;
pub use campaign::{Bounds, FuzzRun, RunEnd, Watcher};
pub use confirm::Confirmation;
pub use dice::Dice;
pub use error::ExploreError;
pub use finding::{Finding, bus_of};
pub use fuzz_case::{Differing, FuzzCase, JudgedAgain, Spiced};
pub use planted::Planted;
pub use planted::is_first;
pub use pool::{MOST_KEPT, Pool, by_novelty};
pub use record::{
    FuzzRecord, FuzzSettings, KeptRun, LogLine, Progress, RECORD, bus_of_run, read_as, rig_of,
};
pub use swarm::Swarm;
pub use target::{Rehearsal, Target, Tried};
