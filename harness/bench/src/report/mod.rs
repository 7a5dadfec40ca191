//! Reports: pure functions of a finished run.

pub mod chart;
pub mod html;
pub(crate) mod lines;
pub mod pcapng;
pub mod pcapng_frames;
pub mod pcapng_telegrams;
pub mod plot;
pub mod vcd;
