//! Fuzz targets whose bodies need the whole bench, the kept inputs of all of them, and what those reach.
//!
//! The bodies for bytes of the bus are in `harness_sim::novobus::fuzz`; here are those for texts ([`scenario`], [`rig`]);
//! those for captures and records stand beside what reads them.
//! [`coverage`] holds the kept inputs against the matrix of protocol transitions and sums up what they reach, [`distil`](mod@distil) chooses
//! what is worth keeping.

pub mod input;
mod text;

pub use text::{rig, scenario, written};

use crate::buses::novobus::fuzz::noted;
/// The targets that reach transitions of the one bus that is fuzzed today.
pub use crate::buses::novobus::fuzz::{coverage, distil};
use harness_sim::novobus::fuzz::{FuzzTarget, NOTING, Noting, TARGETS};

/// The targets whose bodies need the whole bench.
pub const BENCH_TARGETS: [FuzzTarget; 4] = [
    ("scenario", scenario),
    ("rig", rig),
    ("capture", crate::capture::fuzz::import),
    ("record", crate::evidence::fuzz::record),
];

/// Every target.
pub fn targets() -> impl Iterator<Item = FuzzTarget> {
    TARGETS.into_iter().chain(BENCH_TARGETS)
}

/// What the inputs of those reach.
pub const BENCH_NOTING: [Noting; 4] = [
    Noting {
        name: "scenario",
        body: noted::scenario,
        of: None,
    },
    Noting {
        name: "rig",
        body: noted::rig,
        of: None,
    },
    Noting {
        name: "capture",
        body: noted::capture,
        of: None,
    },
    Noting {
        name: "record",
        body: noted::record,
        of: None,
    },
];

/// Every target with what its inputs reach.
pub fn noting() -> impl Iterator<Item = Noting> {
    NOTING.into_iter().chain(BENCH_NOTING)
}
