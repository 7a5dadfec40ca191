//! Benches: the files `rigs/*.toml`, locks, and what may be done with a bench.
//!
//! [`file`](mod@file) has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake of a text
//! with its place, and [`find`](mod@find) a rig by its name. [`lock`] locks rigs and ports, and [`state`] keeps the locks and
//! which rigs must not be used. [`hook`] runs the programs that a rig names, [`scan`] finds ports.

pub(crate) mod around;
pub mod buses;
pub(crate) mod check;
mod check_port;
mod check_sim;
pub(crate) mod condition;
mod ends;
pub mod file;
pub mod find;
pub mod hook;
mod in_use;
pub(crate) mod left;
pub mod lock;
pub(crate) mod open;
mod permitted;
mod played;
pub mod port_file;
pub mod port_session;
pub(crate) mod profile;
pub mod rings;
pub mod scan;
pub(crate) mod segment;
mod session_error;
pub(crate) mod shared;
pub mod state;
pub(crate) mod taken;
pub(crate) mod watchdog;

pub use check::{FindProfile, Rig, parse, parse_beside};
pub use ends::Ends;
pub use file::schema;
pub use find::{FindError, find};
pub use in_use::{End, UseOptions};
pub use open::OpenRigError;
pub(crate) use open::{line_rate, stated_rate};
pub(crate) use permitted::standing;
pub(crate) use played::{Again, attempts_of};
pub use played::{Attempt, Keeper, PlayedScenario};
pub use profile::{
    KnownProfile, Profile, ProfileError, ProfileLines, ProfileSetup, SettledProperty,
};
pub use session_error::SessionError;
pub use shared::{Shared, SharedLine};
pub use watchdog::Alarm;

/// Rigs with rings in use, and how they are examined and judged.
pub use crate::buses::rings::rig::{
    Driven, LikelyCause, RingHealth, Run, Session, Unhealthy, Way, examine, figures, play_one,
};
pub(crate) use crate::buses::rings::rig::{judge, run, wrong_parity};
