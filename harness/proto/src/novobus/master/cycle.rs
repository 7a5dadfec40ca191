//! The cyclic exchange of process data (ND21 9.4, 14.10.3): which drives, when, and the values.

use super::super::address::RingSize;
use crate::time::{Instant, Span};
use alloc::vec;
use alloc::vec::Vec;

/// When the rounds of the exchange begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CyclePace {
    /// One after another. A job for a drive that takes no part gets a telegram between two
    /// rounds.
    #[default]
    Continuous,
    /// At least so long from the beginning of one round to that of the next; jobs go in between.
    Every(Span),
    /// One for each call of [`Master::start_round`](super::Master::start_round).
    OnRequest,
}

/// The exchange: the list of drives, what they get and what they gave.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    drives: Vec<u8>,
    pace: CyclePace,
    /// The list to come, once every answer for the present one is in.
    change: Option<(Vec<u8>, CyclePace)>,
    /// Telegrams composed and answered, in rounds of `drives`.
    composed: u64,
    answered: u64,
    requested: u32,
    due: Instant,
    nominal: Vec<u16>,
    actual: Vec<Option<u16>>,
}

impl Cycle {
    pub(super) fn new(ring: RingSize) -> Self {
        Self {
            drives: Vec::new(),
            pace: CyclePace::default(),
            change: None,
            composed: 0,
            answered: 0,
            requested: 0,
            due: Instant::START,
            nominal: vec![0; usize::from(ring.drives())],
            actual: vec![None; usize::from(ring.drives())],
        }
    }

    /// Sets which drives take part, in ascending order.
    pub(super) fn set(&mut self, drives: Vec<u8>, pace: CyclePace) {
        self.change = Some((drives, pace));
    }

    pub(super) fn request(&mut self) {
        self.requested = self.requested.saturating_add(1);
    }

    pub(super) fn set_nominal(&mut self, drive: u8, value: u16) {
        if let Some(nominal) = self.nominal.get_mut(usize::from(drive)) {
            *nominal = value;
        }
    }

    pub(super) fn nominal(&self, drive: u8) -> u16 {
        self.nominal.get(usize::from(drive)).copied().unwrap_or(0)
    }

    pub(super) fn actual(&self, drive: u8) -> Option<u16> {
        *self.actual.get(usize::from(drive))?
    }

    /// Whether a drive takes part.
    pub(super) fn includes(&self, drive: u8) -> bool {
        self.drives.binary_search(&drive).is_ok()
    }

    fn position(&self) -> usize {
        match self.drives.len() {
            0 => 0,
            drives => usize::try_from(self.composed % drives as u64).unwrap_or(0),
        }
    }

    /// Whether a round has begun and is not sent whole.
    pub(super) fn inside_round(&self) -> bool {
        self.position() > 0
    }

    /// Whether a round can begin. A change of the list happens here, between two rounds.
    pub(super) fn is_due(&mut self, now: Instant) -> bool {
        if self.change.is_some() {
            if self.composed != self.answered {
                return false;
            }
            if let Some((drives, pace)) = self.change.take() {
                self.drives = drives;
                self.pace = pace;
                self.composed = 0;
                self.answered = 0;
                self.due = now;
            }
        }
        !self.drives.is_empty()
            && match self.pace {
                CyclePace::Continuous => true,
                CyclePace::Every(_) => now >= self.due,
                CyclePace::OnRequest => self.requested > 0,
            }
    }

    /// The drive whose telegram comes next.
    pub(super) fn compose(&mut self, now: Instant) -> Option<u8> {
        let position = self.position();
        let drive = *self.drives.get(position)?;
        if position == 0 {
            self.requested = self.requested.saturating_sub(1);
            if let CyclePace::Every(period) = self.pace {
                // From the time at which it was due, so that a late start does not shift the rest; but
                // rounds that were missed are not caught up with.
                self.due = (self.due + period).max(now);
            }
        }
        self.composed += 1;
        Some(drive)
    }

    /// A drive has given its actual value; true where this ends a round.
    pub(super) fn answer(&mut self, drive: u8, value: u16) -> bool {
        if let Some(actual) = self.actual.get_mut(usize::from(drive)) {
            *actual = Some(value);
        }
        self.answered += 1;
        self.answered
            .is_multiple_of((self.drives.len() as u64).max(1))
    }

    /// Sends unanswered process data again. A restarted round needs no new request.
    pub(super) fn restart(&mut self) {
        let drives = (self.drives.len() as u64).max(1);
        let again = self.composed.div_ceil(drives) - self.answered.div_ceil(drives);
        let again = u32::try_from(again).unwrap_or(u32::MAX);
        self.requested = self.requested.saturating_add(again);
        self.composed = self.answered;
    }
}
