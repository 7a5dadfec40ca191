//! A master that deviates.

use super::how::{How, MasterDeviation, MasterNotes, ReturnedByte, Sending};
use super::speech::{SentByte, Speech, What};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::Reply;
use harness_proto::novobus::master::{
    Event, Job, JobId, Master, MasterOptions, Outcome, Phase, Refused,
};
use harness_proto::novobus::sync::PAUSE;
use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, VecDeque};

/// Maximum number of bytes left out in a row.
const MOST_LEFT_OUT: usize = 16;

/// Maximum number of bytes under way: more than the inner master allows.
const MOST_FLOWN: usize = 8_192;

/// Maximum number of results whose report is suppressed.
const MOST_TOLD: usize = 8_192;

/// A master with a deviation around it.
#[derive(Clone, Debug)]
pub struct DeviantMaster {
    inner: Master,
    deviation: &'static MasterDeviation,
    slack: Span,
    byte_time: Span,
    speech: Speech,
    /// What the master inside waits for, oldest first, and whether it went out.
    flown: VecDeque<(SentByte, bool)>,
    /// The sums of the answers begun.
    answers: BTreeMap<u8, Checksum>,
    notes: MasterNotes,
}

impl DeviantMaster {
    /// Creates a master with this deviation; the other arguments are those of `Master::new`.
    #[must_use]
    pub fn new(
        ring: RingSize,
        rate: Rate,
        options: MasterOptions,
        deviation: &'static MasterDeviation,
    ) -> Self {
        let options = match deviation.injection.0 {
            How::Options(change) => change(options),
            _ => options,
        };
        Self {
            inner: Master::new(ring, rate, options),
            deviation,
            slack: options.slack,
            byte_time: rate.byte_time(),
            speech: Speech::new(ring.drives(), options.read_long),
            flown: VecDeque::new(),
            answers: BTreeMap::new(),
            notes: MasterNotes {
                ring,
                open: Vec::new(),
                told: Vec::new(),
                last: None,
                held: None,
                queue: VecDeque::new(),
            },
        }
    }

    pub(crate) fn inner(&self) -> &Master {
        &self.inner
    }

    pub(crate) fn inner_mut(&mut self) -> &mut Master {
        &mut self.inner
    }

    /// As `Master::submit`.
    pub(crate) fn submit(&mut self, job: Job) -> Result<JobId, Refused> {
        let job = match self.deviation.injection.0 {
            How::Submits(change) => change(self.notes.ring, job),
            _ => job,
        };
        let id = self.inner.submit(job)?;
        self.notes.open.push((id, job));
        match self.deviation.injection.0 {
            How::Takes(takes) => takes(&mut self.notes, id, &job),
            How::Doubles(doubles) if doubles(&job) => {
                if let Ok(second) = self.inner.submit(job) {
                    self.notes.told.push(second);
                }
            }
            _ => {}
        }
        Ok(id)
    }

    /// As `Master::set_nominal`.
    pub(crate) fn set_nominal(&mut self, drive: u8, value: u16) -> Result<(), Refused> {
        let value = match self.deviation.injection.0 {
            How::Nominal(change) => change(value),
            _ => value,
        };
        self.inner.set_nominal(drive, value)
    }

    /// As `Master::actual`.
    pub(crate) fn actual(&self, drive: u8) -> Option<u16> {
        let drive = match self.deviation.injection.0 {
            How::Actual(other) => other(self.notes.ring, drive),
            _ => drive,
        };
        self.inner.actual(drive)
    }

    /// As `Master::poll_transmit`.
    pub(crate) fn poll_transmit(&mut self, now: Instant) -> Option<u8> {
        for _ in 0..MOST_LEFT_OUT {
            if matches!(self.deviation.injection.0, How::NoSequence) {
                self.skip_sequence(now);
            }
            let phase = self.inner.phase();
            let byte = self.inner.poll_transmit(now)?;
            let spoken = self.speech.read(byte, phase);
            // The first drive swallows it: nothing comes back.
            if byte == PAUSE && spoken.what == What::Idle {
                return Some(byte);
            }
            let sending = match self.deviation.injection.0 {
                How::Sends(sends) | How::Mistakes(sends, _) => sends(&spoken),
                _ => Sending::Byte(byte),
            };
            let goes_out = matches!(sending, Sending::Byte(_));
            if is_compared(phase) || phase == Phase::Verifying {
                self.flown.push_back((spoken, goes_out));
                if self.flown.len() > MOST_FLOWN {
                    self.flown.pop_front();
                }
            }
            match sending {
                Sending::Byte(byte) => return Some(byte),
                Sending::LeftOut => self.take_unsent(now),
                Sending::Silence => {
                    self.take_unsent(now);
                    return None;
                }
            }
        }
        None
    }

    /// The master inside believes that the check sequence has been sent and has come back.
    fn skip_sequence(&mut self, now: Instant) {
        if self.inner.phase() != Phase::Resetting {
            return;
        }
        for _ in CHECK_SEQUENCE {
            let _unsent = self.inner.poll_transmit(now);
        }
        for byte in SEQUENCE {
            self.inner.handle_byte(now, Received::good(byte));
        }
        self.speech.reset();
        self.flown.clear();
    }

    /// What did not go out comes back for the master inside when it is its turn.
    fn take_unsent(&mut self, now: Instant) {
        while is_compared(self.inner.phase()) {
            match self.flown.front() {
                Some((spoken, false)) => {
                    let byte = self.expected(spoken).unwrap_or(spoken.byte);
                    self.flown.pop_front();
                    self.inner.handle_byte(now, Received::good(byte));
                }
                _ => return,
            }
        }
    }

    /// What must come back for a byte; `None` for data (9.3, 9.6, 10).
    fn expected(&self, spoken: &SentByte) -> Option<u8> {
        match spoken.what {
            What::Address => Some(spoken.byte.wrapping_add(self.notes.ring.drives())),
            What::ProcessData | What::Field(_, Reply::Data(_)) => None,
            What::Field(_, Reply::Check) => {
                let sum = spoken.drive.and_then(|drive| self.answers.get(&drive));
                sum.map(|sum| sum.minus())
            }
            _ => Some(spoken.byte),
        }
    }

    /// As `Master::handle_byte`.
    pub(crate) fn handle_byte(&mut self, now: Instant, received: Received) {
        let mut received = received;
        if is_compared(self.inner.phase())
            && let Some((spoken, _)) = self.flown.pop_front()
        {
            let heard = ReturnedByte {
                received,
                spoken,
                expected: self.expected(&spoken),
            };
            if let How::Hears(hears) | How::Mistakes(_, hears) = self.deviation.injection.0 {
                received = hears(&heard);
            }
            if let Some(drive) = spoken.drive {
                let sum = match spoken.what {
                    What::Code => Some(Checksum::EMPTY),
                    What::Field(..) => self.answers.get(&drive).copied(),
                    _ => None,
                };
                if let Some(sum) = sum {
                    self.answers.insert(drive, sum.with(received.byte));
                }
            }
        }
        self.inner.handle_byte(now, received);
        self.settle(now);
    }

    /// Where work has stopped, nothing that was sent before is compared any more.
    fn settle(&mut self, now: Instant) {
        let phase = self.inner.phase();
        if is_compared(phase) {
            self.take_unsent(now);
        } else if phase != Phase::Verifying {
            self.flown.clear();
        }
    }

    /// As `Master::poll_timeout`.
    pub(crate) fn poll_timeout(&self) -> Option<Instant> {
        let due = self.inner.poll_timeout()?;
        match self.deviation.injection.0 {
            How::Waits(waits) => waits((self.inner.phase(), due, self.slack, self.byte_time)),
            _ => Some(due),
        }
    }

    /// As `Master::handle_timeout`.
    pub(crate) fn handle_timeout(&mut self, now: Instant) {
        if self.poll_timeout().is_none_or(|due| due > now) {
            return;
        }
        let due = self.inner.poll_timeout().unwrap_or(now);
        self.inner.handle_timeout(due.max(now));
        self.settle(now);
    }

    /// As `Master::poll_event`.
    pub(crate) fn poll_event(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.notes.queue.pop_front() {
                return Some(event);
            }
            let Some(event) = self.inner.poll_event() else {
                let (id, data) = self.notes.held.take_if(|_| self.inner.jobs() == 0)?;
                let outcome = Outcome::Read(data);
                return Some(Event::Ended { id, outcome });
            };
            if let Event::Ended { id, .. } = event {
                if self.notes.told.contains(&id) {
                    self.notes.told.retain(|told| *told != id);
                    continue;
                }
                self.notes.open.retain(|(open, _)| *open != id);
            }
            let told = match self.deviation.injection.0 {
                How::Tells(tells) => tells(&mut self.notes, event),
                _ => Some(event),
            };
            self.notes.told.truncate(MOST_TOLD);
            if told.is_some() {
                return told;
            }
        }
    }
}

/// Whether what comes back is compared with what was sent.
const fn is_compared(phase: Phase) -> bool {
    matches!(phase, Phase::Running | Phase::Counting)
}
