//! The cycles that a master has started, and the supervision of their intervals.

use super::super::frame::CYCLES;
use super::job::Disturbance;
use crate::time::{Instant, Span};

/// A cycle under supervision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The register.
    pub register: u8,
    /// The interval in ms.
    pub every: u8,
    /// When its first frame came.
    pub first: Instant,
    /// When its last frame came, early ones not counted.
    pub last: Instant,
    /// Frames since the first one, early ones not counted.
    pub frames: u64,
    /// Frames that did not come in time.
    pub missed: u64,
    /// Until when the next frame is not yet missing.
    next: Instant,
    /// The cycle was stopped; frames that were on their way may come until then.
    stopped: Option<Instant>,
}

impl Slot {
    fn interval(&self) -> Span {
        Span::from_millis(self.every.into())
    }

    /// The mean interval; `None` before the second frame.
    #[must_use]
    pub fn mean(&self) -> Option<Span> {
        let passed = self.last.since(self.first).units();
        (self.frames > 0).then(|| Span::from_units(passed / self.frames))
    }
}

/// What a frame is to the cycles.
#[derive(Clone, Copy, Debug)]
pub(super) enum FrameTiming {
    /// A frame of a cycle, in its time or late.
    Due,
    /// Too early for its cycle: the time since the frame before it.
    Early(Span),
    /// A frame of a cycle that was just stopped.
    Stopped,
    /// The register has no cycle.
    Other,
}

/// All cycles.
#[derive(Clone, Debug, Default)]
pub(super) struct Slots {
    slots: [Option<Slot>; CYCLES],
}

impl Slots {
    pub(super) fn iter(&self) -> impl Iterator<Item = &Slot> {
        let slots = self.slots.iter().flatten();
        slots.filter(|slot| slot.stopped.is_none())
    }

    /// The first frame of a cycle has come.
    pub(super) fn start(&mut self, now: Instant, register: u8, every: u8) {
        let is_same = |slot: &Option<Slot>| slot.is_some_and(|slot| slot.register == register);
        let free = |slot: &Option<Slot>| slot.is_none_or(|slot| slot.stopped.is_some());
        let place = self.slots.iter().position(is_same);
        let place = place.or_else(|| self.slots.iter().position(Option::is_none));
        let place = place.or_else(|| self.slots.iter().position(free));
        if let Some(place) = place {
            self.slots[place] = Some(Slot {
                register,
                every,
                first: now,
                last: now,
                frames: 0,
                missed: 0,
                next: now + Span::from_millis(every.into()),
                stopped: None,
            });
        }
    }

    /// A cycle was stopped; frames of it that come until `until` are no disturbance.
    pub(super) fn stop(&mut self, register: u8, until: Instant) {
        for slot in self.slots.iter_mut().flatten() {
            if slot.register == register {
                slot.stopped = Some(until);
            }
        }
    }

    /// A frame with this register has come.
    pub(super) fn heard(&mut self, now: Instant, register: u8, tolerance: Span) -> FrameTiming {
        let mut slots = self.slots.iter_mut().flatten();
        let Some(slot) = slots.find(|slot| slot.register == register) else {
            return FrameTiming::Other;
        };
        match slot.stopped {
            Some(until) if now <= until => return FrameTiming::Stopped,
            Some(_) => return FrameTiming::Other,
            None => {}
        }
        let after = now.since(slot.last);
        if after == Span::ZERO {
            // The frame that has started the cycle.
            return FrameTiming::Stopped;
        }
        if after + tolerance < slot.interval() {
            return FrameTiming::Early(after);
        }
        slot.last = now;
        slot.frames += 1;
        slot.next = now + slot.interval();
        FrameTiming::Due
    }

    pub(super) fn next_missing(&self, tolerance: Span) -> Option<Instant> {
        self.iter().map(|slot| slot.next + tolerance).min()
    }

    /// A frame that is missing at `now`; the next one is due one interval later.
    pub(super) fn missing(&mut self, now: Instant, tolerance: Span) -> Option<Disturbance> {
        let mut slots = self.slots.iter_mut().flatten();
        let slot = slots.find(|slot| slot.stopped.is_none() && slot.next + tolerance <= now)?;
        slot.missed += 1;
        slot.next = slot.next.max(now - tolerance - slot.interval()) + slot.interval();
        Some(Disturbance::Missing {
            register: slot.register,
        })
    }
}
