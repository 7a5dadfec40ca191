//! drivebench: a test bench for serial servo drives, physical or simulated.
//!
//! This crate is the program `drivebench`, and what another program may use of it:
//!
//! | type | what it is for |
//! |---|---|
//! | [`Scenario`], [`Played`], [`Verdict`] | a scenario on simulated rings, in a test of your own |
//! | [`Drives`], [`Reading`], [`State`] | drives of a rig or of a simulated ring: read, write, move |
//! | [`Served`] | a simulated ring for a controller under test |
//! | [`Error`] | why one of these failed |
//!
//! # Play a scenario
//!
//! ```
#![doc = include_str!("../examples/play_scenario.rs")]
//! ```
//!
//! # Talk to drives
//!
//! ```
#![doc = include_str!("../examples/drive_a_motor.rs")]
//! ```
//!
//! # Serve a ring to a controller
//!
//! ```
#![doc = include_str!("../examples/serve_a_ring.rs")]
//! ```
//!
//! The three stand in `harness/drivebench/examples`; `cargo run --example play_scenario` runs one. The modules of the bench itself are not shown here
//! and may change with every version; `ARCHITECTURE.md` describes them, and `cargo doc --document-private-items` shows them.
#![forbid(unsafe_code)]

pub use embed::{Drives, Error, Played, Reading, Scenario, Served};
#[doc(hidden)]
pub use harness_bench::{
    bus, bus_name, campaign, capture, explore, file, frames, guard, html, link, listen, manual,
    medium, partition, port, qualify, regular, report, rig, scenario, serve, shown, signals, top,
    trouble, web,
};
use harness_proto::counted;
#[doc(inline)]
pub use harness_proto::nd21::State;
#[doc(inline)]
pub use scenario::verdict::Verdict;

mod command;
mod embed;

#[doc(hidden)]
pub mod buses;
#[doc(hidden)]
pub mod cli;
#[doc(hidden)]
pub mod evidence;
#[doc(hidden)]
pub mod fuzz;
#[doc(hidden)]
pub mod library;
