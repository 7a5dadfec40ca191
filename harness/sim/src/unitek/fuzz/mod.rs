//! The bodies of the fuzz targets for UNITEK drives: each takes any bytes and panics where a rule is broken.
//!
//! Inputs are read by [`arbitrary`] in records of a fixed length, or are raw bytes; each target describes its own. Plain
//! `cargo test` plays the inputs that `corpora/fuzz/<target>/` keeps.

mod cells;
mod codec;
mod drive;
mod master;
mod replay;
mod segment;

pub use cells::CELLS;

pub use codec::codec;
pub use drive::{drive, drive_counted};
pub use master::master;
pub use segment::segment;

use crate::fuzz::{FuzzTarget, InputPieces, Noting};
use cells::DriveCell;

/// Every target whose body is here.
pub const TARGETS: [FuzzTarget; 4] = [
    ("unitek-codec", codec),
    ("unitek-drive", drive),
    ("unitek-segment", segment),
    ("unitek-master", master),
];

/// The same, with what their inputs reach.
pub const NOTING: [Noting; 4] = [
    Noting {
        name: "unitek-codec",
        body: codec::noted,
        pieces: InputPieces::Bytes { head: 0, record: 1 },
        of: None,
    },
    Noting {
        name: "unitek-drive",
        body: drive::noted,
        pieces: InputPieces::Bytes { head: 1, record: 7 },
        of: Some(|| DriveCell::reachable().count()),
    },
    Noting {
        name: "unitek-segment",
        body: segment::noted,
        pieces: InputPieces::Bytes { head: 1, record: 7 },
        of: None,
    },
    Noting {
        name: "unitek-master",
        body: master::noted,
        pieces: InputPieces::Bytes { head: 1, record: 7 },
        of: None,
    },
];
