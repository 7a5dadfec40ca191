//! The time in the rings, as clients have it.

use harness_proto::time::{Instant, Span};
use std::time;

/// The most that handing over bytes counts for: less than a bit (ND21 8.1).
const MOST: Span = Span::from_micros(20);

/// The weight of the latest handover in the estimate of how long one takes.
const LAST: u64 = 8;

/// The clock of served rings. A write to a socket takes microseconds, the end of a line takes none. The rings' time is therefore ahead of
/// the system's by that much, so that a byte reaches the client when it is due; bytes from a client count as sent that much before they
/// arrived here.
#[derive(Debug)]
pub(super) struct Clock {
    start: time::Instant,
    handing: Span,
}

impl Clock {
    /// The rings start now.
    pub(super) fn start() -> Self {
        Self {
            start: time::Instant::now(),
            handing: Span::ZERO,
        }
    }

    /// The time in the rings.
    pub(super) fn now(&self) -> Instant {
        self.at(time::Instant::now())
    }

    /// When the client sent bytes that arrived here `ago`.
    pub(super) fn left(&self, ago: Span) -> Instant {
        self.sent(time::Instant::now(), ago)
    }

    /// Notes how long handing over bytes took.
    pub(super) fn handed_over(&mut self, took: time::Duration) {
        let took = u64::try_from(took.as_nanos()).map_or(MOST, Span::from_nanos);
        let all = self.handing * (LAST - 1) + took.min(MOST);
        self.handing = Span::from_nanos(all.as_nanos() / LAST);
    }

    fn at(&self, time: time::Instant) -> Instant {
        self.since_start(time) + self.handing
    }

    fn sent(&self, time: time::Instant, ago: Span) -> Instant {
        self.since_start(time) - ago - self.handing
    }

    fn since_start(&self, time: time::Instant) -> Instant {
        let since = time.saturating_duration_since(self.start);
        Instant::START + Span::from_nanos(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::{Clock, LAST, MOST};
    use harness_proto::time::{Instant, Span};
    use std::time::Duration;

    #[test]
    fn the_rings_are_ahead_by_what_handing_over_takes() {
        let mut clock = Clock::start();
        let time = clock.start + Duration::from_secs(1);
        let second = Instant::START + Span::from_millis(1000);
        assert_eq!(clock.at(time), second);
        let took = Duration::from_micros(6);
        for _ in 0..100 {
            clock.handed_over(took);
        }
        // The mean is rounded down to nanoseconds each time.
        let ahead = clock.at(time).since(second);
        let least = Span::from_nanos(6_000 - LAST);
        assert!(least <= ahead && ahead <= Span::from_micros(6), "{ahead:?}");
        let ago = Span::from_millis(3);
        assert_eq!(clock.sent(time, ago) + ago + ahead, second);
        for _ in 0..100 {
            clock.handed_over(Duration::from_secs(100));
        }
        let ahead = clock.at(time).since(second);
        assert!(
            ahead <= MOST,
            "a program that stood still is not ahead: {ahead:?}"
        );
    }
}
