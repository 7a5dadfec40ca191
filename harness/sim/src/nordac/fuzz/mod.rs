//! The bodies of the fuzz targets for NORDAC drives: each takes any bytes and panics where a rule is broken.
//!
//! Inputs are read by [`arbitrary`] in records of a fixed length; each target describes its own. Plain `cargo test` plays the inputs that
//! `corpora/fuzz/<target>/` keeps.

mod cells;
mod dp;
mod fdl;
mod heard;
mod pkw;
mod slave;
mod telegrams;

pub use cells::CELLS;
pub use dp::dp;
pub use fdl::fdl;
pub use pkw::pkw;
pub use slave::{slave, slave_counted};

use crate::fuzz::{FuzzTarget, InputPieces, Noting};
use cells::DpCell;

/// Every target whose body is here.
pub const TARGETS: [FuzzTarget; 4] = [
    ("nordac-slave", slave),
    ("nordac-pkw", pkw),
    ("nordac-fdl", fdl),
    ("nordac-dp", dp),
];

/// The same, with what their inputs reach.
pub const NOTING: [Noting; 4] = [
    Noting {
        name: "nordac-slave",
        body: slave::noted,
        pieces: InputPieces::Bytes {
            head: 1,
            record: 12,
        },
        of: Some(|| DpCell::reachable().count()),
    },
    Noting {
        name: "nordac-pkw",
        body: pkw::noted,
        pieces: InputPieces::Bytes { head: 1, record: 9 },
        of: None,
    },
    Noting {
        name: "nordac-fdl",
        body: fdl::noted,
        pieces: InputPieces::Bytes { head: 0, record: 2 },
        of: None,
    },
    Noting {
        name: "nordac-dp",
        body: dp::noted,
        pieces: InputPieces::Bytes { head: 0, record: 1 },
        of: None,
    },
];
