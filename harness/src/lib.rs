//! drivebench: a test bench for serial servo drives, physical or simulated.
//!
//! A [`scenario`] is a conversation with a bus in the manual's own notation. It is played on a
//! [`link`], which is the ring as the master sees it; what came of it is shown by a [`report`]. The
//! buses themselves are in `harness_proto`, the simulated rings in `harness_sim`.
#![forbid(unsafe_code)]

pub mod buses;
pub mod campaign;
pub mod capture;
pub mod cli;
pub mod evidence;
pub mod explore;
pub mod file;
pub mod fuzz;
pub mod guard;
pub mod library;
pub mod link;
pub mod manual;
pub mod port;
pub mod qualify;
mod regular;
pub mod report;
pub mod rig;
pub mod scenario;
pub mod serve;
mod signals;
pub mod top;
mod trouble;
