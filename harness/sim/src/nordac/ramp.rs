//! The ramp generator: the exact frequency at any instant (3.2.1, 5.1; section 7 of the reading).
//!
//! A ramp is linear, and its time is the one from 0 to the maximum frequency. A change of sign goes down to 0 with one time and up
//! again with the other. The frequency is computed from the start of a course and never step by step, so that it does not
//! depend on how often it is read.

use super::frequency::Frequency;
use harness_proto::time::{Instant, Span};
use std::hash::{Hash as _, Hasher};

/// The unit of a ramp time, 0.05 s, in units of [`Span`].
const TIME: i128 = 150_000_000;

/// Where the frequency goes, and how fast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Course {
    /// The frequency at its end.
    pub target: Frequency,
    /// Time away from 0, in 0.05 s for the maximum frequency (1202); at least 1.
    pub up: u16,
    /// Time towards 0, in 0.05 s for the maximum frequency (1203 or 1615); at least 1.
    pub down: u16,
    /// The maximum frequency in 0.1 Hz (1205). The frequency is 0 where this is 0.
    pub maximum: u16,
}

impl Course {
    /// The units of time after which the course that begins at `from` is certainly over.
    fn longest(&self, from: Frequency) -> u64 {
        let way = from.abs().cut(1, 1) + self.target.abs().cut(1, 1) + 2;
        let time = way * TIME * i128::from(self.up.max(self.down));
        // At most 2^61: frequencies have 17 bits, times 15.
        let units = time / i128::from(self.maximum.max(1));
        u64::try_from(units + 1).unwrap_or(u64::MAX)
    }

    /// How far the frequency moves in a span at most.
    #[must_use]
    pub fn step(self, span: Span) -> Frequency {
        let moved = i128::from(span.units()) * i128::from(self.maximum);
        Frequency::new(moved, TIME * i128::from(self.up.min(self.down)))
    }

    /// Standstill at once.
    pub const STOPPED: Self = Self {
        target: Frequency::ZERO,
        up: 1,
        down: 1,
        maximum: 0,
    };
}

/// A course with its start.
#[derive(Clone, Copy, Debug)]
pub struct Ramp {
    from: Frequency,
    since: Instant,
    /// From here on the frequency is the target.
    ends: Instant,
    course: Course,
}

impl Default for Ramp {
    /// A motor that stands.
    fn default() -> Self {
        Self {
            from: Frequency::ZERO,
            since: Instant::START,
            ends: Instant::START,
            course: Course::STOPPED,
        }
    }
}

impl Ramp {
    /// The frequency at `at`, which must not be before the start of the course.
    #[must_use]
    pub fn at(&self, at: Instant) -> Frequency {
        let Course {
            target, maximum, ..
        } = self.course;
        if maximum == 0 {
            return Frequency::ZERO;
        }
        if at >= self.ends {
            return target;
        }
        let elapsed = i128::from(at.since(self.since).units());
        let (size, positive) = (self.from.abs(), self.is_positive());
        let denominator = size.denominator();
        let (rise, fall) = (
            TIME * i128::from(self.course.up),
            TIME * i128::from(self.course.down),
        );
        // The frequency changes by this much, divided by the denominator and by `rise` or `fall`.
        let passed = elapsed * i128::from(maximum) * denominator;
        let end = target.signed(positive);
        if end >= size {
            let risen = Frequency::new(size.numerator() * rise + passed, denominator * rise);
            return risen.min(end).signed(positive);
        }
        let left = size.numerator() * fall - passed;
        if left > 0 || !end.is_negative() {
            let fallen = Frequency::new(left, denominator * fall);
            return fallen.max(end).signed(positive);
        }
        let risen = Frequency::new(-left, denominator * rise);
        risen.min(end.abs()).signed(!positive)
    }

    /// The course that it takes.
    #[must_use]
    pub const fn course(&self) -> Course {
        self.course
    }

    /// Until when the frequency certainly moves no more; `None` where it does not move.
    #[must_use]
    pub fn moves_until(&self, at: Instant) -> Option<Instant> {
        (self.at(at) != self.course.target).then_some(self.ends)
    }

    /// Feeds all that decides its frequency from `at` on to a checksum.
    pub fn hash_state(&self, at: Instant, sum: &mut impl Hasher) {
        let moves = self.moves_until(at);
        let begun = moves.map(|_| (self.from, at.since(self.since)));
        (self.course, begun).hash(sum);
    }

    /// When the frequency is 0 for the first time on the way to 0; `None` if the course does not end there.
    #[must_use]
    pub fn zero_at(&self) -> Option<Instant> {
        let Course {
            target,
            down,
            maximum,
            ..
        } = self.course;
        if maximum == 0 || self.from.is_zero() {
            return target.is_zero().then_some(self.since);
        }
        let size = self.from.abs();
        let time = size.numerator() * TIME * i128::from(down);
        let rate = i128::from(maximum) * size.denominator();
        let units = u64::try_from((time + rate - 1) / rate).unwrap_or(u64::MAX);
        target
            .is_zero()
            .then_some(self.since + Span::from_units(units))
    }

    /// Takes another course from `at` on. The same course again changes nothing.
    pub fn take(&mut self, at: Instant, course: Course) {
        if course != self.course {
            let from = self.at(at).settled();
            let way = if from == course.target {
                0
            } else {
                course.longest(from)
            };
            *self = Self {
                from,
                since: at,
                ends: at + Span::from_units(way),
                course,
            };
        }
    }

    /// The phase sequence in which the course begins.
    fn is_positive(&self) -> bool {
        let counts = if self.from.is_zero() {
            self.course.target
        } else {
            self.from
        };
        !counts.is_negative()
    }
}

#[cfg(test)]
mod tests {
    use super::super::property::property;
    use super::*;
    use proptest::prelude::*;

    fn course(target: i64) -> Course {
        Course {
            target: Frequency::tenths(target),
            up: 100,
            down: 50,
            maximum: 700,
        }
    }

    fn millis(millis: u64) -> Instant {
        Instant::START + Span::from_millis(millis)
    }

    /// 70 Hz in 5 s up and in 2.5 s down.
    #[test]
    fn linear_and_through_zero_with_two_times() {
        let mut ramp = Ramp::default();
        ramp.take(millis(1_000), course(350));
        for (at, tenths) in [(1_000, 0), (2_000, 140), (3_500, 350), (9_000, 350)] {
            assert_eq!(ramp.at(millis(at)), Frequency::tenths(tenths), "{at} ms");
        }
        ramp.take(millis(9_000), course(-350));
        for (at, tenths) in [
            (9_000, 350),
            (10_000, 70),
            (10_250, 0),
            (11_250, -140),
            (12_750, -350),
        ] {
            assert_eq!(ramp.at(millis(at)), Frequency::tenths(tenths), "{at} ms");
        }
        assert_eq!(ramp.zero_at(), None);
        ramp.take(millis(13_000), course(-70));
        assert_eq!(ramp.at(millis(13_500)), Frequency::tenths(-210));
        assert_eq!(ramp.at(millis(14_000)), Frequency::tenths(-70));
        ramp.take(millis(14_000), course(0));
        assert_eq!(ramp.zero_at(), Some(millis(14_250)));
    }

    #[test]
    fn zero_is_the_first_instant_without_frequency() {
        let mut ramp = Ramp::default();
        let Course { target, .. } = course(333);
        ramp.take(
            Instant::START,
            Course {
                target,
                up: 1,
                down: 7,
                maximum: 999,
            },
        );
        ramp.take(
            millis(70),
            Course {
                target: Frequency::ZERO,
                up: 1,
                down: 7,
                maximum: 997,
            },
        );
        let zero = ramp.zero_at().unwrap();
        assert!(ramp.at(zero).is_zero());
        assert!(!ramp.at(zero - Span::from_units(1)).is_zero());
    }

    #[test]
    fn no_maximum_no_frequency() {
        let mut ramp = Ramp::default();
        ramp.take(Instant::START, course(350));
        ramp.take(
            millis(500),
            Course {
                maximum: 0,
                ..course(0)
            },
        );
        assert!(ramp.at(millis(500)).is_zero());
        assert_eq!(ramp.zero_at(), Some(millis(500)));
    }

    fn courses() -> impl Strategy<Value = (u64, Course)> {
        let times = (0..5_000_000_000_u64, 1..=32_000_u16, 1..=32_000_u16);
        (times, 0..=9_990_u16, -0x8000..0x8000_i128).prop_map(
            |((after, up, down), maximum, hsw)| {
                let target = Frequency::new(hsw * i128::from(maximum), 16_384);
                let target = if hsw % 5 == 0 {
                    Frequency::ZERO
                } else {
                    target
                };
                (
                    after,
                    Course {
                        target,
                        up,
                        down,
                        maximum,
                    },
                )
            },
        )
    }

    /// No course overflows, none goes on after its end, and 0 is reached where it is announced.
    #[test]
    fn every_course_stays_between_its_ends() {
        let cuts = prop::collection::vec(0..2_000_000_000_u64, 0..8);
        let all = prop::collection::vec(courses(), 1..12);
        property(
            "every_course_stays_between_its_ends",
            &(all, cuts),
            |(courses, cuts)| {
                let mut ramp = Ramp::default();
                let mut now = Instant::START;
                for (after, course) in courses {
                    now += Span::from_units(after);
                    check_course(&mut ramp, now, course, &cuts);
                }
            },
        );
    }

    fn check_course(ramp: &mut Ramp, now: Instant, course: Course, cuts: &[u64]) {
        let from = ramp.at(now);
        ramp.take(now, course);
        if let Some(zero) = ramp.zero_at() {
            assert!(ramp.at(zero).is_zero());
            let before = zero - Span::from_units(1);
            assert!(before <= now || !ramp.at(before).is_zero());
        }
        if course.maximum == 0 {
            return;
        }
        let (low, high) = (from.min(course.target), from.max(course.target));
        for part in cuts {
            let then = ramp.at(now + Span::from_units(*part));
            assert!(low <= then && then <= high, "{then:?}");
        }
        let last = ramp.at(ramp.ends - Span::from_units(1));
        assert!(ramp.ends == now || last == course.target);
    }
}
