//! Answers of an undisturbed ring: every byte is compared, and data are extracted (ND21 9.3-9.6, 10).

use super::super::sync::SYNCO;
use super::Master;
use super::diagnosis::DisturbanceSign;
use super::event::Event;
use super::in_flight::{BytePlace, ComposedByte, JobSlot, Owner};
use super::job::Outcome;
use super::recovery::Stumble;
use crate::line::Received;
use crate::time::Instant;

/// Data that have come back without an own or an unambiguous check. They count when a significant byte behind them has come
/// back right. 00 is not significant, because a drive in the error mode sends it. Nor is a byte equal
/// to the last data byte: if one byte were lost, it would take that one's place.
#[derive(Clone, Debug, Default)]
pub(super) struct Unconfirmed {
    high: u8,
    exchange: Option<(u8, u16)>,
    /// A job, and the last byte of its data.
    read: Option<(JobSlot, u8)>,
    doubt: DataDoubt,
}

/// Whether data wait for a byte that settles them, although one has come back right after them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum DataDoubt {
    #[default]
    None,
    /// That byte was not significant, and the next ones may not be either.
    Raised,
    /// The telegram that settles it is on its way.
    Asked,
}

impl Unconfirmed {
    #[inline]
    fn is_some(&self) -> bool {
        self.exchange.is_some() || self.read.is_some()
    }

    /// The exchange that is settled by a byte that has come back right. Behind process data the sync byte
    /// of any telegram is good enough: telegrams may follow that hold nothing else that is known.
    fn settled_exchange(&mut self, composed: &ComposedByte) -> Option<(u8, u16)> {
        let (_, value) = self.exchange?;
        let idle = *composed == ComposedByte::SYNCO && value.to_be_bytes()[1] == SYNCO;
        self.settle(composed, idle)
            .then(|| self.exchange.take())
            .flatten()
    }

    /// The read that is settled by a byte that has come back right.
    fn settled_read(&mut self, composed: &ComposedByte) -> Option<JobSlot> {
        let (slot, last) = self.read?;
        let same = composed.back == Some(last);
        self.settle(composed, same).then(|| {
            self.read = None;
            slot
        })
    }

    fn settle(&mut self, composed: &ComposedByte, same: bool) -> bool {
        let known = composed.back.is_some_and(|back| back != 0);
        if known && same && self.doubt == DataDoubt::None {
            self.doubt = DataDoubt::Raised;
        }
        if known && !same {
            self.doubt = DataDoubt::None;
        }
        known && !same
    }

    /// Whether only another telegram can settle the data. Asks but once.
    pub(super) fn must_ask(&mut self) -> bool {
        let raised = self.doubt == DataDoubt::Raised;
        if raised {
            self.doubt = DataDoubt::Asked;
        }
        raised
    }
}

impl Master {
    /// Takes a byte for the oldest one under way.
    #[inline]
    pub(super) fn take(&mut self, received: Received, now: Instant) {
        let Some(sent) = self.in_flight.pop() else {
            self.disturb(DisturbanceSign::Unasked, now);
            self.see(received);
            return;
        };
        let composed = sent.composed;
        let byte = received.byte;
        let mut right = received.error.is_none() && composed.back.is_none_or(|back| back == byte);
        if right {
            if self.unconfirmed.is_some() {
                self.confirm(&composed);
            }
            match (composed.place, composed.owner) {
                (BytePlace::Parameter, Owner::Job(slot)) => right = self.take_answer(slot, byte),
                (BytePlace::ProcessHigh, _) => self.unconfirmed.high = byte,
                (BytePlace::ProcessLow, Owner::Exchange(drive)) => {
                    let value = u16::from_be_bytes([self.unconfirmed.high, byte]);
                    self.unconfirmed.exchange = Some((drive, value));
                }
                (BytePlace::Last, _) => self.counted(),
                _ => {}
            }
        }
        if right {
            self.episode.byte_was_right(self.ring);
        } else {
            self.disturb(DisturbanceSign::Wrong(sent), now);
            self.see(received);
        }
    }

    /// Takes a byte of a job's answer; false where it is wrong.
    fn take_answer(&mut self, slot: JobSlot, byte: u8) -> bool {
        let Some(entry) = self.store.get_mut(slot) else {
            return false;
        };
        if !entry.take(byte) {
            return false;
        }
        if entry.is_answered() {
            // A checking byte that is SYNCO as well may be a SYNCO after an answer that was lost.
            if entry.is_checked() && byte != SYNCO {
                self.finish(slot);
            } else {
                if let Some((before, _)) = self.unconfirmed.read.replace((slot, byte)) {
                    self.finish(before);
                }
            }
        }
        true
    }

    /// A byte has come back right: what stood before it may count.
    fn confirm(&mut self, composed: &ComposedByte) {
        if let Some((drive, value)) = self.unconfirmed.settled_exchange(composed) {
            self.episode.is_done(Stumble::Exchange(drive));
            if self.cycle.answer(drive, value) {
                self.counters.rounds += 1;
                self.events.round(self.counters.rounds);
            }
        }
        if let Some(slot) = self.unconfirmed.settled_read(composed) {
            self.finish(slot);
        }
    }

    /// A job has run.
    fn finish(&mut self, slot: JobSlot) {
        let Some(entry) = self.store.remove(slot) else {
            return;
        };
        let outcome = if entry.kind.reads() {
            Outcome::Read(entry.read())
        } else {
            Outcome::Done {
                perhaps_twice: entry.perhaps_run,
            }
        };
        self.counters.done += 1;
        self.episode.is_done(Stumble::Job(entry.id));
        self.events.ended(entry.id, outcome);
    }

    /// All drives have counted the address byte up, and they are as many as there should be.
    fn counted(&mut self) {
        if self.episode.is_first() {
            self.report(Event::Ready);
        }
        self.resume();
    }
}
