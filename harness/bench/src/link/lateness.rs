//! An estimate of how late the computer wakes up.

use super::HARMLESS;
use harness_proto::time::{self, Span};
use std::time::{Duration, Instant};

/// Half-life of the estimate. One late wake-up must not count for long, because the SYNCO sent ahead for it delay each job.
const HALF: Duration = Duration::from_millis(500);

/// The worst lateness seen; it is halved every `HALF`.
#[derive(Clone, Copy, Debug)]
pub struct Lateness {
    worst: Span,
    seen: Instant,
}

impl Lateness {
    /// Nothing has been late.
    pub fn new(now: Instant) -> Self {
        Self {
            worst: Span::ZERO,
            seen: now,
        }
    }

    /// Records a wake-up that was due at `due` and happened at `now`.
    pub fn woken(&mut self, due: Instant, now: Instant) {
        let late = now.saturating_duration_since(due).as_nanos();
        let late = Span::from_nanos(u64::try_from(late).unwrap_or(u64::MAX));
        if late >= self.at(now) {
            *self = Self {
                worst: late,
                seen: now,
            };
        }
    }

    /// How late a wake-up may be now.
    pub fn at(&self, now: Instant) -> Span {
        let halves = now.saturating_duration_since(self.seen).as_millis() / HALF.as_millis();
        let left = self.worst.as_nanos() >> halves.min(63);
        Span::from_nanos(left)
    }
}

/// For how long a computer has stalled while a caller did nothing but use a line.
#[derive(Clone, Copy, Debug)]
pub struct StoodStill {
    /// When the last call ended.
    last: time::Instant,
    total: Span,
}

impl StoodStill {
    /// From now on.
    pub const fn new(now: time::Instant) -> Self {
        Self {
            last: now,
            total: Span::ZERO,
        }
    }

    /// Notes the time now, which should be that of the last call, or `due` where that is later.
    pub fn look(&mut self, now: time::Instant, due: time::Instant) {
        let late = now.since(self.last.max(due));
        if late > HARMLESS {
            self.total = self.total + late;
        }
        self.last = now;
    }

    /// All of it, but for what no drive notices.
    pub const fn total(&self) -> Span {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::{HALF, Lateness, StoodStill};
    use harness_proto::time::Span;
    use std::time::{Duration, Instant};

    #[test]
    fn the_worst_counts_and_is_forgotten_by_and_by() {
        let start = Instant::now();
        let mut late = Lateness::new(start);
        assert_eq!(late.at(start), Span::ZERO);
        late.woken(start, start + Duration::from_millis(8));
        let begun = start + Duration::from_millis(8);
        assert_eq!(late.at(begun), Span::from_millis(8));
        late.woken(begun, begun + Duration::from_millis(3));
        assert_eq!(late.at(begun), Span::from_millis(8), "the worst counts");
        assert_eq!(late.at(begun + HALF), Span::from_millis(4));
        let then = begun + HALF;
        late.woken(then, then + Duration::from_millis(5));
        let then = then + Duration::from_millis(5);
        assert_eq!(
            late.at(then),
            Span::from_millis(5),
            "worse than what is left of it"
        );
        assert_eq!(late.at(then + 200 * HALF), Span::ZERO);
    }

    #[test]
    fn only_what_drives_notice_counts() {
        let at = |ms| harness_proto::time::Instant::START + Span::from_millis(ms);
        let mut still = StoodStill::new(at(0));
        still.look(at(4), at(0));
        // Asked to wait until then.
        still.look(at(104), at(100));
        assert_eq!(still.total(), Span::ZERO);
        still.look(at(304), at(204));
        still.look(at(314), at(0));
        assert_eq!(still.total(), Span::from_millis(110));
    }

    #[test]
    fn whoever_is_woken_early_is_not_late() {
        let start = Instant::now();
        let mut late = Lateness::new(start);
        late.woken(start + Duration::from_millis(1), start);
        assert_eq!(late.at(start), Span::ZERO);
    }
}
