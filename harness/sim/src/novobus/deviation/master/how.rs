//! What a deviation of the master is, and the ways to inject one.

use super::speech::SentByte;
use super::table::DEVIATIONS;
use crate::deviation::{Deviation, DeviationTable};
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{Event, Job, JobId, MasterOptions, Phase, ReadData};
use harness_proto::time::{Instant, Span};
use std::collections::VecDeque;

/// A way in which a master breaks the manual.
pub type MasterDeviation = Deviation<MasterInjection>;

/// How a master is made to deviate.
pub struct MasterInjection(pub(super) How);

/// All deviations of a master: in the bytes sent, in the reading of the bytes that come back, in the work, and in the reports.
pub static MASTER_DEVIATIONS: DeviationTable<MasterInjection> = DeviationTable(&[DEVIATIONS]);

/// What becomes of a byte that the master inside sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sending {
    /// This goes out.
    Byte(u8),
    /// It does not go out, and the next one takes its place.
    LeftOut,
    /// Nothing goes out in its byte time.
    Silence,
}

/// A byte that has come back, beside the one that it is the answer to.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReturnedByte {
    pub(super) received: Received,
    /// What the master inside has sent for it.
    pub(super) spoken: SentByte,
    /// What must come; `None` for data.
    pub(super) expected: Option<u8>,
}

impl ReturnedByte {
    /// What must come, where that is known and no line error is in it.
    pub(super) fn believed(&self) -> Received {
        match self.expected {
            Some(byte) if self.received.error.is_none() => Received::good(byte),
            _ => self.received,
        }
    }
}

/// What a wrong master keeps in mind.
#[derive(Clone, Debug)]
pub(super) struct MasterNotes {
    pub(super) ring: RingSize,
    /// Jobs that have not ended.
    pub(super) open: Vec<(JobId, Job)>,
    /// Jobs whose end is not reported any more.
    pub(super) told: Vec<JobId>,
    /// What the last read brought.
    pub(super) last: Option<ReadData>,
    /// A result that is held back.
    pub(super) held: Option<(JobId, ReadData)>,
    /// Events to report next.
    pub(super) queue: VecDeque<Event>,
}

/// The deadline of the master inside: in which phase, when, the slack of its options and the time of a byte.
pub(super) type Due = (Phase, Instant, Span, Span);

/// How a deviation is injected.
pub(super) enum How {
    /// It works by other options.
    Options(fn(MasterOptions) -> MasterOptions),
    /// It sends other bytes.
    Sends(fn(&SentByte) -> Sending),
    /// It takes bytes for others.
    Hears(fn(&ReturnedByte) -> Received),
    /// Both, so that it does not notice.
    Mistakes(fn(&SentByte) -> Sending, fn(&ReturnedByte) -> Received),
    /// It does another job than the one that it is given.
    Submits(fn(RingSize, Job) -> Job),
    /// It does what it is given twice, where this says so.
    Doubles(fn(&Job) -> bool),
    /// It tells something as soon as it has taken a job.
    Takes(fn(&mut MasterNotes, JobId, &Job)),
    /// It tells something else.
    Tells(fn(&mut MasterNotes, Event) -> Option<Event>),
    /// It gives the drives other nominal values.
    Nominal(fn(u16) -> u16),
    /// It gives the actual value of another drive.
    Actual(fn(RingSize, u8) -> u8),
    /// It waits for another time; `None` for ever.
    Waits(fn(Due) -> Option<Instant>),
    /// It sends no check sequence.
    NoSequence,
}
