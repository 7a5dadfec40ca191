//! Why a call of the driver failed.

use super::axis::Axis;
use harness_bench::counted::counted;
use harness_bench::link::Trouble;
use harness_proto::nd21::errors::in_words;
use harness_proto::novobus::master::{BusStop, Fault, Refused};
use harness_proto::time::Span;
use thiserror::Error;

/// Why a call failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Error {
    /// It was refused before a byte was sent.
    #[error("{0}")]
    Refused(Refused),
    /// The answer was lost: the job has run or has not, and was not repeated.
    #[error("unknown, not repeated: {0}")]
    Unknown(Fault),
    /// The bus has been stopped (11.5).
    #[error("{0}")]
    Stopped(BusStop),
    /// The link carries nothing more.
    #[error("{0}")]
    Link(Trouble),
    /// What was waited for did not come.
    #[error("waited {waited} for {what}")]
    TimeOut {
        /// How long.
        waited: Span,
        what: String,
    },
    /// The result of this order has been fetched (11.6).
    #[error("no such order: its result has been fetched already (ND21 11.6)")]
    NoSuchOrder,
    /// The drive is in error mode.
    #[error("drive {axis} is in error mode: {}", in_words(*code))]
    InErrorMode {
        axis: Axis,
        /// Its error code.
        code: u16,
    },
    /// The drive still tests itself.
    #[error("drive {axis} is in reset: its self-test still runs (ND21 11.8)")]
    InReset { axis: Axis },
    /// A stop or a block has ended what was going on.
    #[error("drive {axis}: {what} was interrupted by {by} (ND21 13.2.1.1)")]
    Interrupted {
        axis: Axis,
        what: &'static str,
        /// `stop` or `block`.
        by: &'static str,
    },
    /// The drive's position would not settle at the value given.
    #[error(
        "drive {axis}: the actual value is off by {deviation} increments after {} (ND21 13.2.1.2)",
        counted(*.attempts, "attempt")
    )]
    NotSet {
        axis: Axis,
        /// How far it is off.
        deviation: i32,
        /// How often it was tried.
        attempts: u8,
    },
    /// Every attempt of a step was disturbed so that it may have run once or twice.
    #[error("{what} was disturbed {}", counted(*.attempts, "time"))]
    Disturbed {
        what: String,
        /// How often it was tried.
        attempts: u8,
    },
    /// The manual does not describe this operation.
    #[error("{0}")]
    Open(&'static str),
    /// A value that cannot be.
    #[error("{0}")]
    Value(String),
}
