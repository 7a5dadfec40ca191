//! What a scenario can check.

use super::cell::{CellCheck, CellPlace};
use crate::language::syntax::{DriveRange, LinkEnds};
use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::quantity::{Quantity, Tolerance};
use harness_bench::scenario::times::Duration;
use harness_proto::novobus::error::BusError;
use harness_sim::nd21::Mode;

/// What must hold at a point of a scenario.
#[derive(Clone, Debug)]
pub enum Check {
    /// The ring spells out the drive that saw the fault (ND21 9.7), after a limited number of zeros.
    Located {
        drive: DriveRange,
        /// Maximum number of zeros; any number if `None`.
        within: Option<Located>,
    },
    /// It does so after at most this number of zeros (ND21 9.7: 25).
    Within(Located),
    /// Something holds of drives.
    Drive(DriveCheck),
    /// This drive's error mode has this cause.
    Error { error: BusError, drive: DriveRange },
    /// This number of check sequences came back whole.
    Corrected(Located),
    /// The driver named this link as the first fault of its last job.
    Named {
        /// Which ring, counted from 0.
        ring: usize,
        /// Whether it is broken; false if it is damaged.
        broken: bool,
        /// The place of the link in the text.
        link: Located,
        ends: LinkEnds,
    },
    /// The commands of the driver's last job have ended so.
    Ended(Ending),
    /// The bytes that the driver sent into this ring follow the manual.
    RulesKept(usize),
    /// This number of bytes was sent since the last check, in this time.
    Sent {
        bytes: Located,
        /// How long, to the last digit written.
        time: Option<Duration>,
    },
    /// This number of bytes was received since the start.
    Received(Located),
}

/// How a job of the driver can end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It has run once, or has read.
    Done,
    /// It may have run twice.
    Twice,
    /// It is not known whether the job has run.
    Unknown,
    /// It has not run, and the bus is stopped.
    Failed,
}

impl Ending {
    /// The names in a scenario.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("done", Self::Done),
        ("twice", Self::Twice),
        ("unknown", Self::Unknown),
        ("failed", Self::Failed),
    ];

    /// The name in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        let known = Self::NAMES.iter().find(|(_, ending)| *ending == self);
        known.map_or("", |(name, _)| name)
    }
}

/// What must hold of drives.
#[derive(Clone, Debug)]
pub struct DriveCheck {
    pub drives: DriveRange,
    pub condition: Condition,
    /// Where it stands.
    pub span: TextSpan,
}

/// What can hold of a drive.
#[derive(Clone, Debug)]
pub enum Condition {
    /// It is in the error mode, or is not.
    InError(bool),
    /// `memory ADDRESS = BYTES`
    Memory(CellPlace, Pattern),
    /// A cell compares with a value.
    Cell(CellCheck),
    /// It shows this outside the bus.
    Shows(Showing),
}

/// What a drive can show outside the bus (ND21 5.3, 11.8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Showing {
    /// `GPO1 high`
    Gpo1(bool),
    /// `GPO2 high`
    Gpo2(bool),
    /// `ready closed`
    Ready(bool),
    /// `analogue-output = 2.5V +-0.1V`: the voltage in mV too.
    Analogue(i32, Quantity, Option<Tolerance>),
    /// `encoder = 1024 +-2`
    Encoder(i64, i64),
    /// `display 508`, or `display blank`
    Display(Option<[u8; 3]>),
    /// `mode go`
    Mode(Mode),
}
