//! Reports: pure functions of a finished run.

pub(crate) mod chart;
pub mod finding;
pub mod html;
pub mod mismatch;
pub mod page;
pub mod pcapng;
pub mod pcapng_frames;
pub(crate) mod pcapng_telegrams;
pub mod vcd;

/// How the one bus that is shown today reads its bytes, and its own tables and pictures.
pub use crate::buses::rings::report::{csv, json, meaning, plot, svg, table, walk};
pub(crate) use crate::buses::rings::report::{diagram, lines, sequence};
