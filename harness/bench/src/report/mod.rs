//! Reports: pure functions of a finished run.

pub mod chart;
pub mod html;
pub mod pcapng;
pub mod pcapng_frames;
pub mod pcapng_telegrams;
