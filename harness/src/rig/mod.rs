//! Benches: the files `rigs/*.toml`, locks, and what may be done with a bench.
//!
//! [`file`](mod@file) has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake of a text
//! with its place, and [`find`](mod@find) a rig by its name. [`lock`] locks rigs and ports, and [`state`] keeps the locks and
//! which rigs must not be used. [`hook`] runs the programs that a rig names, [`scan`] finds ports.

mod around;
pub(crate) mod check;
mod check_port;
mod check_sim;
mod driven;
mod ends;
pub mod file;
pub mod find;
pub mod hook;
pub mod lock;
mod open;
mod permitted;
mod played;
pub mod port_file;
pub(crate) mod profile;
pub(crate) mod run;
pub mod scan;
pub(crate) mod segment;
pub(crate) mod session;
mod session_error;
pub(crate) mod shared;
pub mod state;
pub(crate) mod taken;
pub(crate) mod watchdog;

pub use crate::buses::novobus::rig::health::{Health, Unhealthy, examine};
pub use crate::buses::novobus::rig::line_test::Cause;
pub use check::{FindProfile, Rig, parse, parse_beside};
pub use driven::Driven;
pub use ends::Ends;
pub use file::schema;
pub use find::{FindError, find};
pub use open::OpenRigError;
pub(crate) use open::{line_rate, stated_rate};
pub(crate) use permitted::{limits, standing};
pub(crate) use played::{Again, attempts_of};
pub use played::{Attempt, Played};
pub use profile::{KnownProfile, Profile, ProfileError, SettledProperty};
pub use run::{Keeper, Run, Way, play_one};
pub use session::{End, Options, Session};
pub use session_error::SessionError;
pub use shared::{Shared, SharedLine};
pub use watchdog::Alarm;

/// How the one bus that is driven today is examined when a bench is opened.
pub use crate::buses::novobus::rig::figures;
pub(crate) use crate::buses::novobus::rig::{health, interlock, judge, left_open, line_test, sim};
