//! Benches: what stands in `rigs/*.toml`, who holds one, and what may be done with it.
//!
//! [`file`](mod@file) has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake
//! of a text with its place, and [`find`](mod@find) a rig by its name. [`lock`] says who holds a rig or a port, [`state`] where
//! that is kept, and which rigs must not be used. [`hook`] runs the programs that a rig names, [`scan`] finds ports.

mod check;
mod ends;
pub mod file;
pub mod find;
pub mod hook;
pub mod lock;
mod open;
pub(crate) mod run;
pub mod scan;
pub(crate) mod schema;
mod session;
pub(crate) mod sim;
pub mod state;
pub mod values;

pub use check::{Rig, parse};
pub use ends::Ends;
pub use find::{FindError, find};
pub use open::OpenRigError;
pub use run::{Attempt, Keeper, Played, Run, Way, play_one};
pub use schema::schema;
pub use session::{End, Health, Options, Session, SessionError, Unhealthy, examine};
