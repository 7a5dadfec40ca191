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
