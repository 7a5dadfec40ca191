//! The steps of this bus: faults, checks, what happens to drives, records and jobs.

use super::cell::CellPlace;
use super::check::{Check, DriveCheck};
use super::header::{DriveRange, Influence};
use super::job::JobStep;
use crate::language::Novobus;
use harness_bench::scenario::expression::Located;
use harness_bench::scenario::syntax::{Action, Step};
use harness_bench::scenario::times::Duration;
use harness_proto::nd21::errors::ErrorCode;
use harness_sim::fault::{DriveFault, Flips, LinkFault};

/// A step of this bus.
#[derive(Clone, Debug)]
pub enum RingStep {
    /// `!`: a fault.
    Fault(FaultStep),
    /// `?`: a check.
    Check(Check),
    /// `until`: time passes until a check holds, at most this long.
    Until(DriveCheck, Duration),
    /// `drive ...`: something happens to drives from outside the bus.
    Influence(DriveRange, Influence),
    /// `record`: cells are recorded from here on, or no longer.
    Record(CellRecording),
    /// A job of the master.
    Job(JobStep),
}

impl From<RingStep> for Step<Novobus> {
    /// The step without a time in front.
    fn from(step: RingStep) -> Self {
        Action::Own(step).into()
    }
}

/// A cell that is recorded: `record drive 0 nist every 10ms`.
#[derive(Clone, Debug)]
pub struct CellRecording {
    pub drives: DriveRange,
    pub place: CellPlace,
    /// When it is looked at.
    pub looks: Looks,
}

/// When a recorded cell is noted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looks {
    /// `every T`
    Every(Duration),
    /// `changes`
    Changes,
    /// `off`: no longer.
    Off,
}

/// A fault as written.
#[derive(Clone, Debug)]
pub struct FaultStep {
    /// Which ring, counted from 0.
    pub ring: usize,
    pub what: FaultKind,
    /// At which byte, counted from 1.
    pub byte: Option<Located>,
    /// At which time since the start.
    pub at: Option<Duration>,
}

impl FaultStep {
    /// A fault on a link of a ring, counted from 0, at a byte, counted from 1.
    #[must_use]
    pub fn on_link(ring: usize, ends: LinkEnds, kind: LinkFaultKind, byte: u64) -> Self {
        Self {
            ring,
            what: FaultKind::Link(Located::number(0), ends, kind),
            byte: Some(Located::number(byte.cast_signed())),
            at: None,
        }
    }
}

/// Where a fault happens, and what.
#[derive(Clone, Debug)]
pub enum FaultKind {
    Link(Located, LinkEnds, LinkFaultKind),
    Drive(Located, DriveFault),
    /// The drive's own monitoring reports an error.
    Error(Located, ErrorCode),
}

#[derive(Clone, Debug)]
pub struct LinkEnds {
    /// The transmitter; `None` for the master.
    pub from: Option<Located>,
    /// The receiver; `None` for the master.
    pub to: Option<Located>,
}

impl LinkEnds {
    /// The ends of the link that goes from one drive to another; `None` is the master.
    #[must_use]
    pub fn between(from: Option<u8>, to: Option<u8>) -> Self {
        let end = |drive: u8| Located::number(drive.into());
        Self {
            from: from.map(end),
            to: to.map(end),
        }
    }

    /// The ends of a link of a ring of `drives`, by its place: 0 for the link that begins at the master.
    #[must_use]
    pub(crate) fn of_place(drives: u8, place: usize) -> Self {
        let behind = |place: usize| u8::try_from(usize::from(drives).checked_sub(place)?).ok();
        let from = behind(place).filter(|_| place > 0);
        Self::between(from, behind(place + 1))
    }
}

/// What happens on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFaultKind {
    /// `flip b ...`
    Flip(Flips),
    /// `replace HH`
    Replace(u8),
    /// `drop`
    Drop,
    /// `duplicate`
    Duplicate,
    /// `insert HH`
    Insert(u8),
    /// `delay T`
    Delay(Duration),
    /// `break T`
    Break(Duration),
    /// `overrun`
    Overrun,
    /// `cut`
    Cut,
    /// `join`
    Join,
}

impl From<LinkFault> for LinkFaultKind {
    /// The same fault; times to the nanosecond.
    fn from(fault: LinkFault) -> Self {
        match fault {
            LinkFault::Flip(flips) => Self::Flip(flips),
            LinkFault::Replace(byte) => Self::Replace(byte),
            LinkFault::Drop => Self::Drop,
            LinkFault::Duplicate => Self::Duplicate,
            LinkFault::Insert(byte) => Self::Insert(byte),
            LinkFault::Delay(time) => Self::Delay(Duration::nanos(time.as_nanos())),
            LinkFault::Break(time) => Self::Break(Duration::nanos(time.as_nanos())),
            LinkFault::Overrun => Self::Overrun,
            LinkFault::Cut => Self::Cut,
            LinkFault::Join => Self::Join,
        }
    }
}
