//! From text to a [`Scenario`](super::syntax::Scenario): the header, then the steps, one line each.

pub mod header;
pub mod step;
pub mod words;

pub use header::bus;
pub use header::{parse, parse_step};
