//! The jobs of the master that a scenario can give.

use super::cell::{CellPlace, Written};
use crate::language::syntax::DriveRange;
use harness_bench::link::Capability;
use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::quantity::{Quantity, Tolerance};

/// A job as written.
#[derive(Clone, Debug)]
pub enum JobStep {
    /// `recover`: 17 zeros and the check sequence (ND21 9.8), on the given ring.
    Recover(usize),
    /// `exchange K SEND = RECEIVE`: process data (ND21 9.4).
    Exchange {
        drive: DriveRange,
        /// What is sent.
        send: Pattern,
        /// What must come back.
        receive: Option<Pattern>,
    },
    /// A command to a drive.
    Command {
        kind: JobKind,
        drive: DriveRange,
        /// The cell, where the command has one.
        place: Option<CellPlace>,
        /// The data that are written, or that must be read.
        data: Option<Written>,
        /// The tolerance of the value read.
        tolerance: Option<Tolerance>,
    },
    /// `master ...`: the driver does it, of one drive or of several at once (ND21 11 to 13).
    Master {
        /// What, and of which drives.
        calls: Vec<(DriveRange, MasterCall)>,
        /// Whether its commands must not run twice, and may end in any way: `master once`.
        once: bool,
    },
    /// `master count = N`: the drives of a ring are counted (ND21 9.3).
    Count(usize, Located),
}

/// What the driver is to do.
#[derive(Clone, Debug)]
pub enum MasterCall {
    /// A command, with what is read or written.
    Command(JobKind, Option<CellPlace>, Option<Written>),
    /// `read-eeprom K CELL [= HH]` (12.5)
    ReadEeprom(CellPlace, Option<Pattern>),
    /// `write-eeprom K CELL = HH` (12.5)
    WriteEeprom(CellPlace, Pattern),
    /// `ram-to-eeprom K` (12.5)
    RamToEeprom,
    /// `reference K` (13.2.1.1)
    Reference,
    /// `set-actual-value K = TURNS` (13.2.1.2)
    SetActualValue(WrittenTarget),
    /// `init-ps K` (13.2.1.3)
    InitPs,
    /// `write-ps K = TURNS` or `= by TURNS` (13.2.2)
    WritePs(WrittenTarget),
    /// `exchange K HHHH [= HHHH]` (9.4)
    Exchange(Pattern, Option<Pattern>),
    /// `start-ps K` (13.2.3)
    StartPs,
    /// `wait-for-end K` (13.2.4)
    WaitForEnd,
}

/// A position as written.
#[derive(Clone, Debug)]
pub enum WrittenTarget {
    /// Four bytes: of a target in the format of 13.1.9.
    Bytes(Pattern),
    /// Turns from the zero point.
    At(Quantity),
    /// Turns from here.
    By(Quantity),
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

impl JobStep {
    /// The capability of a rig that the job needs in addition to the bus itself.
    pub(crate) fn needs(&self) -> Option<Capability> {
        match self {
            Self::Command {
                kind: JobKind::Reset,
                ..
            } => Some(Capability::Reset),
            Self::Command {
                kind: JobKind::Go, ..
            } => Some(Capability::Motion),
            Self::Master { calls, .. } => calls.iter().find_map(|(_, call)| call.needs()),
            _ => None,
        }
    }
}

impl MasterCall {
    fn needs(&self) -> Option<Capability> {
        match self {
            Self::Command(JobKind::Go, ..)
            | Self::Reference
            | Self::StartPs
            | Self::Exchange(..) => Some(Capability::Motion),
            Self::Command(JobKind::Reset, ..) => Some(Capability::Reset),
            Self::WriteEeprom(..) | Self::RamToEeprom => Some(Capability::Eeprom),
            _ => None,
        }
    }
}
