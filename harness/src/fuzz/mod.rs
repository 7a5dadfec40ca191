//! Fuzz targets whose bodies need the whole bench, the kept inputs of all of them, and what those reach.
//!
//! The bodies for bytes of the bus are in `harness_sim::fuzz`; here are those for texts ([`scenario`], [`rig`]).
//! [`coverage`] holds the kept inputs against the matrix of protocol transitions, [`distil`](mod@distil) chooses what is worth keeping.

pub mod coverage;
pub mod distil;
pub mod input;
mod text;

pub use text::{rig, scenario};

use harness_sim::fuzz::{TARGETS, Target};

/// The targets whose bodies are here.
pub const TEXT_TARGETS: [Target; 2] = [("scenario", scenario), ("rig", rig)];

/// Every target.
pub fn targets() -> impl Iterator<Item = Target> {
    TARGETS.into_iter().chain(TEXT_TARGETS)
}
