//! Benches: the files `rigs/*.toml`, locks, and what may be done with a bench.
//!
//! [`file`](mod@file) has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake of a text
//! with its place, and [`find`](mod@find) a rig by its name. [`lock`] locks rigs and ports, and [`state`] keeps the locks and
//! which rigs must not be used. [`hook`] runs the programs that a rig names, [`scan`] finds ports.

mod around;
pub mod buses;
pub mod check;
pub mod check_port;
pub mod check_sim;
pub mod condition;
pub mod ends;
pub mod file;
pub mod find;
pub mod hook;
mod in_use;
pub mod left;
pub mod lock;
mod permitted;
mod played;
pub mod playing;
pub mod port_file;
pub mod profile;
pub mod rings;
pub mod scan;
pub mod session;
mod session_error;
pub mod state;
mod taken;
mod watchdog;

pub use check::{Rig, parse, parse_beside};
pub use ends::Ends;
pub use file::schema;
pub use find::{FindError, find};
pub use in_use::{End, UseOptions};
pub use permitted::standing;
pub use played::{Attempt, Keeper, LateByte, PlayedScenario, RetryRule, late_each_time};
pub use profile::{KnownProfile, Profile, ProfileError, ProfileSetup, SettledProperty};
pub use session_error::SessionError;
pub use watchdog::Alarm;
