//! What is known of the cycle of one register.

use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Register;

/// How far a single gap may be off: the drive's scan is 1 ms, and so is the clock of many adapters (UNITEK 5.2).
const GAP: Span = Span::from_millis(2);

/// From how many intervals on their mean is judged.
const ENOUGH: u64 = 10;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Cycle {
    /// It may run since before the first frame.
    #[default]
    Unknown,
    /// It does not run since then; one frame may still be in flight.
    Off(Instant),
    On(Running),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Running {
    every: Span,
    /// When it was asked for, or when a frame of the register last came.
    alive: Instant,
    /// Whether it certainly runs: the request was heard, and the table had a place.
    pub(super) sure: bool,
    /// First and last frame of an unbroken series, and how many intervals are between them.
    series: Option<(Instant, Instant, u64)>,
    /// How long the bus was used when the last frame came.
    used: Span,
    /// In how many gaps of the log a frame was due, since the last one came.
    pub(super) owed: usize,
}

/// How a frame of a cycle is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Untimely {
    Gap(Span),
    /// The mean of a number of gaps.
    Mean(Span, u64),
}

impl Running {
    /// A cycle that was asked for.
    pub(super) const fn new(every: u8, asked: Instant, sure: bool) -> Self {
        Self {
            every: Span::from_millis(every as u64),
            alive: asked,
            sure,
            series: None,
            used: Span::ZERO,
            owed: 0,
        }
    }

    /// The interval.
    pub(super) const fn every(&self) -> Span {
        self.every
    }

    /// What differs where its frames do not come.
    pub(super) fn not_there(&self, register: u8) -> String {
        let (name, every) = (Register::of(register).name, self.every);
        format!(
            "no frame of register {register:02X} ({name}) comes, which is asked for every {every}"
        )
    }

    /// A frame that may belong to the cycle or not has begun at `at`: the series begins again.
    pub(super) const fn blur(&mut self, at: Instant) {
        self.series = None;
        self.alive = at;
    }

    /// A frame has begun at `at`, when the bus had been used for `used`. Times may be off by `tolerance`.
    pub(super) fn comes(&mut self, at: Instant, used: Span, tolerance: Span) -> Option<Untimely> {
        let permitted = GAP + tolerance;
        self.sure = true;
        self.alive = at;
        self.owed = 0;
        // Behind a busy bus a frame waits, and one that waits is replaced by its successor.
        let busy = |since: Instant, before: Span| {
            let gap = at.since(since).units();
            let load = (used.units() - before.units()).saturating_mul(2);
            load > gap
        };
        let Some((first, last, count)) = self.series else {
            self.series = Some((at, at, 0));
            self.used = used;
            return None;
        };
        let gap = at.since(last);
        if busy(last, self.used) {
            self.series = Some((at, at, 0));
            self.used = used;
            return None;
        }
        self.used = used;
        self.series = Some((first, at, count + 1));
        let off = |interval: Span, wanted: Span| interval.units().abs_diff(wanted.units());
        if off(gap, self.every) > permitted.units() {
            self.series = Some((at, at, 0));
            return Some(Untimely::Gap(gap));
        }
        let count = count + 1;
        let (whole, wanted) = (at.since(first), self.every * count);
        let most = wanted.units() / 50 + permitted.units();
        if count >= ENOUGH && off(whole, wanted) > most {
            self.series = Some((at, at, 0));
            return Some(Untimely::Mean(
                Span::from_units(whole.units() / count),
                count,
            ));
        }
        None
    }

    /// Whether a frame has been due for long at `now`.
    pub(super) fn is_missing(&self, now: Instant, patience: Span) -> bool {
        self.sure && now.since(self.alive) > self.every + self.every + patience
    }
}

impl Cycle {
    /// Whether a frame that begins at `at` may be one that was in flight when the cycle ended; one alone is, or many where the computer
    /// that stamps them is late.
    pub(super) fn in_flight(&mut self, at: Instant, patience: Span, many: bool) -> bool {
        match *self {
            Self::Off(since) => {
                if !many {
                    *self = Self::Off(Instant::START);
                }
                at.since(since) <= patience && since != Instant::START
            }
            Self::Unknown | Self::On(_) => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// UNITEK 5.2: a gap may be off by a scan and the clock of an adapter, the mean of many gaps may not.
    #[test]
    fn the_mean_of_many_gaps_is_judged() {
        let seen = |gap: Span| {
            let mut cycle = Running::new(10, Instant::START, true);
            (0..=ENOUGH)
                .find_map(|count| cycle.comes(Instant::START + gap * count, Span::ZERO, Span::ZERO))
        };
        assert_eq!(seen(Span::from_millis(10)), None);
        let late = Span::from_millis(11);
        assert_eq!(seen(late), Some(Untimely::Mean(late, ENOUGH)));
        let lost = Span::from_millis(20);
        assert_eq!(seen(lost), Some(Untimely::Gap(lost)));
    }
}
