//! Silence where drives monitor time-outs (ND21 9.9).

use crate::novobus::sync::PAUSE;
use crate::time::{Instant, Span};

/// The shortest silence that may be a time-out, which comes after 10 ms (ND21 9.9). A drive may count more of it than the guard.
const TIME_OUT: Span = Span::from_millis(8);

/// When a drive sends zeros at the latest, from the last byte before the silence: 20 ms (ND21 9.9), and as much to spare.
const ZEROS_SENT: Span = Span::from_millis(40);

/// The time of a byte, 11 bits at 38400 baud (ND21 8.3).
const BYTE: Span = Span::from_micros(286);

/// What silence may have done. Behind a time-out a drive waits 10 ms, and the manual does not say whether it passes on what it receives
/// meanwhile. If it keeps that, the drives behind it stand where they stood, and a recovery does not reach them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Silence {
    /// A drive may monitor time-outs.
    monitored: bool,
    /// When the last byte is over; before the first one, when the guard began.
    last: Instant,
    /// The same of the last byte but PAUSE, which the first drive keeps to itself (ND21 9.2).
    heard: Instant,
    /// Until when a drive may keep what it receives.
    until: Instant,
    /// Before the silence, drives were in the middle of something.
    in_part: bool,
}

impl Silence {
    pub(super) const fn new(monitored: bool) -> Self {
        Self {
            monitored,
            last: Instant::START,
            heard: Instant::START,
            until: Instant::START,
            in_part: false,
        }
    }

    /// A drive monitors time-outs.
    pub(super) fn is_monitored(&mut self) {
        self.monitored = true;
    }

    pub(super) const fn may_time_out(self) -> bool {
        self.monitored
    }

    /// The same if a drive does on another line to the same ring.
    pub(super) fn know_as(&mut self, other: Self) {
        self.monitored |= other.monitored;
    }

    /// Behind a link that was cut, or a drive that was off, the time of a drive may be up although bytes were sent.
    pub(super) fn doubt(&mut self) {
        self.until = self.until.max(self.last + ZEROS_SENT);
        self.in_part = true;
    }

    /// The last byte is over at this time.
    pub(super) fn ends(&mut self, at: Instant) {
        let is_heard = self.heard == self.last;
        self.last = self.last.max(at);
        if is_heard {
            self.heard = self.last;
        }
    }

    /// The same at the time of the next byte. `at_rest`: whether no drive is in the middle of anything before it.
    pub(super) fn at(self, now: Instant, at_rest: impl FnOnce() -> bool) -> Self {
        match self.monitored && now.since(self.heard) >= TIME_OUT {
            true => Self {
                until: self.last + ZEROS_SENT,
                in_part: !at_rest(),
                ..self
            },
            false => self,
        }
    }

    /// The same behind a byte.
    pub(super) fn with_byte(self, now: Instant, byte: u8) -> Self {
        let last = self.last.max(now) + BYTE;
        Self {
            last,
            heard: if byte == PAUSE { self.heard } else { last },
            ..self
        }
    }

    /// Until when a byte is kept back; `None` where it may be sent now. `recovers`: it is a zero outside of a telegram.
    ///
    /// Where drives were in the middle of something, nothing may follow the silence before, and where they were not, no recovery: a drive
    /// that has kept one would be ready while it still keeps bytes from those behind it.
    pub(super) fn until(self, now: Instant, recovers: bool) -> Option<Instant> {
        let kept = self.monitored && now < self.until && (self.in_part || recovers);
        kept.then_some(self.until)
    }
}
