//! The jobs of the master that a scenario can give.

use super::Drives;
use super::cell::{Place, Written};
use crate::link::Capability;
use crate::scenario::pattern::Pattern;
use crate::scenario::quantity::Tolerance;

/// A job as written.
#[derive(Clone, Debug)]
pub enum Job {
    /// `recover`: 17 zeros and the check sequence (ND21 9.8), on the given ring.
    Recover(usize),
    /// `exchange K SEND = RECEIVE`: process data (ND21 9.4).
    Exchange {
        /// Which drive.
        drive: Drives,
        /// What is sent.
        send: Pattern,
        /// What must come back.
        receive: Option<Pattern>,
    },
    /// A command to a drive.
    Command {
        /// Which command.
        kind: JobKind,
        /// Which drive.
        drive: Drives,
        /// The cell, where the command has one.
        place: Option<Place>,
        /// The data that are written, or that must be read.
        data: Option<Written>,
        /// How far what is read may be off.
        tolerance: Option<Tolerance>,
    },
}

/// The jobs that are one command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// `read-byte K CELL [= HH]` (10.1)
    ReadByte,
    /// `read-word K CELL [= HHHH]` (10.1)
    ReadWord,
    /// `read-long K CELL [= HHHHHHHH]` (10.1)
    ReadLong,
    /// `write-byte K CELL = HH` (10.2)
    WriteByte,
    /// `write-word K CELL = HHHH` (10.2)
    WriteWord,
    /// `and K CELL = HH` (10.3)
    And,
    /// `or K CELL = HH` (10.3)
    Or,
    /// `write-io K = CODE` (10.4)
    WriteIo,
    /// `reset K` (10.5)
    Reset,
    /// `go K`: software block and software stop off (11.8)
    Go,
    /// `stop K`: software stop on (11.8)
    Stop,
    /// `block K`: software block on (11.8)
    Block,
    /// `delete-error K` (14.10.1)
    DeleteError,
}

impl Job {
    /// What the job needs of a rig beside the bus itself.
    pub(in crate::scenario) fn needs(&self) -> Option<Capability> {
        match self {
            Self::Command {
                kind: JobKind::Reset,
                ..
            } => Some(Capability::Reset),
            Self::Command {
                kind: JobKind::Go, ..
            } => Some(Capability::Motion),
            _ => None,
        }
    }
}
