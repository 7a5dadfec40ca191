//! From text to a [`Scenario`](super::syntax::Scenario): the header, then the steps, one line each.

pub(crate) mod header;
pub(crate) mod step;
pub(crate) mod words;

pub(crate) use header::bus;
pub use header::{parse, parse_step};
