//! What comes back while all is well: every byte is compared, and data are taken out (ND21 9.3-9.6, 10).

use super::Master;
use super::diagnosis::Cause;
use super::event::Event;
use super::in_flight::{Owner, Place, Slot};
use super::job::Outcome;
use super::recovery::Stumble;
use crate::line::Received;
use crate::time::Instant;

/// Data that have come back and have no check of their own: they count when a byte other than 00 has
/// come back right behind them.
#[derive(Clone, Debug, Default)]
pub(super) struct Unconfirmed {
    high: u8,
    exchange: Option<(u8, u16)>,
    read: Option<Slot>,
}

impl Master {
    /// Takes a byte for the oldest one under way.
    #[inline]
    pub(super) fn take(&mut self, received: Received, now: Instant) {
        let Some(sent) = self.in_flight.pop() else {
            self.disturb(Cause::Unasked, now);
            self.see(received);
            return;
        };
        let composed = sent.composed;
        let byte = received.byte;
        let mut right = received.error.is_none() && composed.back.is_none_or(|back| back == byte);
        if right {
            if composed.back.is_some_and(|back| back != 0) {
                self.confirm();
            }
            match (composed.place, composed.owner) {
                (Place::Parameter, Owner::Job(slot)) => right = self.take_answer(slot, byte),
                (Place::ProcessHigh, _) => self.unconfirmed.high = byte,
                (Place::ProcessLow, Owner::Exchange(drive)) => {
                    let value = u16::from_be_bytes([self.unconfirmed.high, byte]);
                    self.unconfirmed.exchange = Some((drive, value));
                }
                (Place::Last, _) => self.counted(),
                _ => {}
            }
        }
        if right {
            self.episode.byte_was_right(self.ring);
        } else {
            self.disturb(Cause::Wrong(sent), now);
            self.see(received);
        }
    }

    /// Takes a byte of a job's answer; false where it is wrong.
    fn take_answer(&mut self, slot: Slot, byte: u8) -> bool {
        let Some(entry) = self.store.get_mut(slot) else {
            return false;
        };
        if !entry.take(byte) {
            return false;
        }
        if entry.is_answered() {
            if entry.is_checked() {
                // A checking byte is never 00: it speaks for what came before it.
                self.confirm();
                self.finish(slot);
            } else {
                self.unconfirmed.read = Some(slot);
            }
        }
        true
    }

    fn confirm(&mut self) {
        if let Some((drive, value)) = self.unconfirmed.exchange.take() {
            self.episode.is_done(Stumble::Exchange(drive));
            if self.cycle.answer(drive, value) {
                self.counters.rounds += 1;
                self.events.round(self.counters.rounds);
            }
        }
        if let Some(slot) = self.unconfirmed.read.take() {
            self.finish(slot);
        }
    }

    /// A job has run.
    fn finish(&mut self, slot: Slot) {
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
