//! Fuzz targets whose bodies need the whole bench, the kept inputs of all of them, and what those reach.
//!
//! The bodies for bytes and frames of a bus are in `harness_sim`, in the folder of the bus. Here are those for texts ([`scenario`], [`rig`]) and
//! for captures ([`capture`](fn@capture)); that for records stands beside what reads them.
//! [`coverage`] compares the kept inputs with the matrix of protocol transitions and sums up what they reach. [`distil`](mod@distil) chooses
//! the inputs to keep.

pub use harness_bench::fuzz::*;
mod capture;
pub mod coverage;
mod noted;
mod text;

pub use capture::capture;
pub use text::{rig, scenario};

use crate::buses::BUSES;
use harness_sim::fuzz::{Body, FuzzTarget, InputPieces, Noting};

/// The targets whose bodies need the whole bench.
pub const BENCH_TARGETS: [FuzzTarget; 4] = [
    ("scenario", scenario),
    ("rig", rig),
    ("capture", capture),
    ("record", crate::evidence::fuzz::record),
];

/// Every target.
pub fn targets() -> impl Iterator<Item = FuzzTarget> {
    let of_buses = BUSES.iter().flat_map(|bus| bus.fuzz.0).copied();
    of_buses.chain(BENCH_TARGETS)
}

/// What the inputs of those reach.
pub const BENCH_NOTING: [Noting; 4] = [
    text("scenario", noted::scenario, "scn"),
    text("rig", noted::rig, "toml"),
    text("capture", noted::capture, "json"),
    text("record", noted::record, "jsonl"),
];

/// A target whose inputs are texts, in files with this ending.
const fn text(name: &'static str, body: Body, ending: &'static str) -> Noting {
    Noting {
        name,
        body,
        pieces: InputPieces::Text(ending),
        of: None,
    }
}

/// Every target with what its inputs reach.
pub fn noting() -> impl Iterator<Item = Noting> {
    let of_buses = BUSES.iter().flat_map(|bus| bus.fuzz.1).copied();
    of_buses.chain(BENCH_NOTING)
}
