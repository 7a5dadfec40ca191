//! Exploring: conversations that nobody has written, tried on a ring beside its model.
//!
//! A [`Case`] is a conversation as a value. [`Generator`] and [`mutate`] make them from a seed, within a [`Swarm`]'s subset of
//! what a conversation can have; a [`Target`] tries them: [`OnSim`] on simulated rings, [`OnRig`] on a rig with ports behind
//! its guard. What shows something new stays in a [`Pool`], what is otherwise than the model is a [`Finding`], and every
//! finding is a scenario ([`text`](mod@text)). A [`Campaign`] does all of it, a [`Record`] keeps it as it happens, [`shrink`](mod@shrink) makes
//! findings small and [`promote`](mod@promote) keeps them.

mod campaign;
mod case;
mod dice;
mod error;
mod expect;
mod files;
mod finding;
mod generate;
mod idiom;
mod judge;
pub mod masters;
mod mutate;
mod novelty;
mod on_rig;
mod on_sim;
mod oracle;
mod order;
mod page;
mod play;
pub mod promote;
mod record;
mod setup;
pub mod shrink;
mod swarm;
mod target;
pub mod text;
mod tour;

pub use campaign::{Bounds, Campaign, End, Watcher};
pub use case::{Act, Beside, Case, Damage, Harm, MOST_ACTS, MOST_BYTES, MOST_NET, Talk, To, What};
pub use dice::Dice;
pub use error::ExploreError;
pub use finding::Finding;
pub use generate::{Generator, RingScope, Scope};
pub use mutate::mutate;
pub use novelty::{MOST_KEPT, Pool, by_novelty, features};
pub use on_rig::OnRig;
pub use on_sim::OnSim;
pub use oracle::{Difference, against_model, against_reference, against_witnesses, beside};
pub use order::{Command, Order, Spoil};
pub use page::page;
pub use play::{Seen, play};
pub use record::{About, Kept, Line, Progress, RECORD, Record, read};
pub use setup::{Planted, Setup};
pub use swarm::{Spice, Swarm};
pub use target::{Rehearsal, Target, Tried};
