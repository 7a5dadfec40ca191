//! Times of frames that an adapter has stamped, on the bench's clock.

use harness_proto::time::{Instant, Span};

/// How fast the clocks of adapter and bench may drift apart, in millionths.
const DRIFT: u64 = 100;

/// The clock of an adapter as the bench sees it.
///
/// A frame is read some time after it was stamped. The shortest such time that was seen counts for all frames, so that a computer that
/// reads late does not change the times between frames. A stamp is never later than the reading.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdapterClock {
    /// After how long stamps start again; `None` where they do not.
    period: Option<Span>,
    /// The resolution of stamps.
    tick: Span,
    last: Option<LastStamp>,
}

#[derive(Clone, Copy, Debug)]
struct LastStamp {
    /// When it was read.
    read: Instant,
    /// The adapter's time, with whole periods.
    stamp: Span,
    /// The bench's time at which the adapter's was 0, at the latest; it can be before the bench's own start.
    zero: i128,
}

impl AdapterClock {
    pub(super) const fn new(tick: Span, period: Option<Span>) -> Self {
        Self {
            period,
            tick,
            last: None,
        }
    }

    /// When a frame with this stamp was on the bus that is read at `read`.
    pub(super) fn at(&mut self, stamp: Span, read: Instant) -> Instant {
        let units = |span: Span| i128::from(span.units());
        let stamp = match (self.last, self.period) {
            (Some(last), Some(period)) => {
                unwrapped(last.stamp + read.since(last.read), stamp, period)
            }
            _ => stamp,
        };
        let read_units = units(read.since_start());
        let seen = read_units - units(stamp);
        let zero = match self.last {
            Some(last) => {
                let drift = units(read.since(last.read)) * i128::from(DRIFT) / 1_000_000;
                seen.min(last.zero + drift)
            }
            None => seen,
        };
        self.last = Some(LastStamp { read, stamp, zero });
        let at = (units(stamp) + zero + units(self.tick)).clamp(0, read_units);
        Instant::START + Span::from_units(u64::try_from(at).unwrap_or_default())
    }
}

/// The time nearest to `expected` that shows as `stamp` on a clock which starts again after `period`.
fn unwrapped(expected: Span, stamp: Span, period: Span) -> Span {
    let period = period.units().max(1);
    let half = period / 2;
    let periods = (expected.units() + half).saturating_sub(stamp.units()) / period;
    Span::from_units(periods * period + stamp.units())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(millis: u64) -> Span {
        Span::from_millis(millis)
    }

    /// Frames every 10 ms that are read 1, 25 and 3 ms late keep their distance of 10 ms.
    #[test]
    fn late_reading_does_not_change_the_distance() {
        let mut clock = AdapterClock::new(Span::ZERO, Some(ms(60_000)));
        let at = |millis| Instant::START + ms(millis);
        assert_eq!(clock.at(ms(59_990), at(101)), at(101));
        let second = clock.at(ms(0), at(135));
        let third = clock.at(ms(10), at(123).max(at(135)));
        let drift = ms(1);
        assert!(
            second.since(at(111)) < drift && third.since(at(121)) < drift,
            "{second:?} {third:?}"
        );
    }

    #[test]
    fn a_stamp_is_never_later_than_its_reading() {
        let mut clock = AdapterClock::new(ms(1), Some(ms(60_000)));
        for (stamp, read) in [(0, 1_000), (5, 1_003), (59_999, 1_004), (10, 1_000_000)] {
            let read = Instant::START + ms(read);
            assert!(clock.at(ms(stamp), read) <= read);
        }
    }

    #[test]
    fn stamps_are_unwrapped_to_the_nearest_time() {
        let period = ms(60_000);
        for (expected, stamp, time) in [
            (0, 5, 5),
            (59_999, 1, 60_001),
            (60_001, 59_999, 59_999),
            (600_010, 12, 600_012),
            (630_000, 29_000, 629_000),
        ] {
            assert_eq!(
                unwrapped(ms(expected), ms(stamp), period),
                ms(time),
                "{expected}"
            );
        }
    }
}
