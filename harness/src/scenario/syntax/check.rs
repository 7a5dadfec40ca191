//! What a scenario can check.

use super::Drives;
use crate::scenario::expression::Located;
use crate::scenario::pattern::Pattern;
use crate::scenario::problem::Spanned;
use crate::scenario::times::Duration;
use harness_proto::novobus::error::BusError;

/// What must hold at a point of a scenario.
#[derive(Clone, Debug)]
pub enum Check {
    /// The ring spells out that this drive saw the fault (ND21 9.7), after at most so many zeros.
    Located {
        /// Which drive.
        drive: Drives,
        /// The most zeros; any number where `None`.
        within: Option<Located>,
    },
    /// It does so after at most so many zeros (ND21 9.7: 25).
    Within(Located),
    /// These drives are in the error mode, or are not.
    InError {
        /// Which drives.
        drives: Drives,
        /// Whether they are, or must not be.
        expected: bool,
    },
    /// This drive's error mode has this cause.
    Error {
        /// The cause.
        error: BusError,
        /// Which drive.
        drive: Drives,
    },
    /// A drive's cells hold these bytes.
    Memory {
        /// Which drives.
        drives: Drives,
        /// From which address on.
        address: Spanned<u16>,
        /// What.
        bytes: Pattern,
    },
    /// So many check sequences came back whole.
    Corrected(Located),
    /// So many bytes were sent since the last check, and took this long.
    Sent {
        /// How many.
        bytes: Located,
        /// How long, to the last digit written.
        time: Option<Duration>,
    },
    /// So many bytes were received since the start.
    Received(Located),
}
