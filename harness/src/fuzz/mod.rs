//! Fuzz targets whose bodies need the whole bench, the kept inputs of all of them, and what those reach.
//!
//! The bodies for bytes of the bus are in `harness_sim::fuzz`; here are those for texts ([`scenario`], [`rig`]);
//! those for captures and records stand beside what reads them.
//! [`coverage`] holds the kept inputs against the matrix of protocol transitions, [`distil`](mod@distil) chooses what is worth keeping.

pub mod coverage;
pub mod distil;
pub mod input;
mod text;

pub use text::{rig, scenario};

use harness_sim::fuzz::{TARGETS, Target};

/// The targets whose bodies need the whole bench.
pub const BENCH_TARGETS: [Target; 4] = [
    ("scenario", scenario),
    ("rig", rig),
    ("capture", crate::capture::fuzz::import),
    ("record", crate::evidence::fuzz::record),
];

/// Every target.
pub fn targets() -> impl Iterator<Item = Target> {
    TARGETS.into_iter().chain(BENCH_TARGETS)
}
