//! Benches: the files `rigs/*.toml`, locks, and what may be done with a bench.
//!
//! [`file`](mod@file) has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake of a text
//! with its place, and [`find`](mod@find) a rig by its name. [`lock`] locks rigs and ports, and [`state`] keeps the locks and
//! which rigs must not be used. [`hook`] runs the programs that a rig names, [`scan`] finds ports.

pub use harness_bench::rig::*;
pub(crate) mod open;
pub(crate) mod shared;
pub use open::OpenRigError;
pub(crate) use open::{line_rate, stated_rate};
pub use shared::{Shared, SharedLine};
