//! Benches: what stands in `rigs/*.toml`, who holds one, and what may be done with it.
//!
//! [`file`] has the types of a rig file (the JSON schema is derived from them), `check` finds every mistake
//! of a text with its place, and [`find`] a rig by its name.

mod check;
pub mod file;
pub mod find;
mod schema;
pub mod values;

pub use check::{Rig, parse};
pub use find::{FindError, find};
pub use schema::schema;
