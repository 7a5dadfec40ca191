//! Time as a number, so that two runs agree to the last digit.
//!
//! The unit is a third of a nanosecond: a bit at 38400, 19200 and 9600 bit/s is then a whole number
//! of units (78125, 156250, 312500), and so are a microsecond (3000) and the bit times of CAN and
//! PROFIBUS. No sum of byte times is ever rounded, and two events that fall on the same instant on
//! paper fall on the same instant here.

use core::fmt;
use core::ops::{Add, AddAssign, Mul, Sub};

const PER_NANOSECOND: u64 = 3;

/// A length of time, in thirds of a nanosecond; up to 194 years. Sums and products stop at that end
/// instead of wrapping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Span(u64);

impl Span {
    /// No time at all.
    pub const ZERO: Self = Self(0);
    /// The longest span there is.
    pub const MAX: Self = Self(u64::MAX);

    /// A span of whole thirds of a nanosecond.
    #[must_use]
    pub const fn from_units(units: u64) -> Self {
        Self(units)
    }

    /// A span of whole nanoseconds.
    #[must_use]
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos.saturating_mul(PER_NANOSECOND))
    }

    /// A span of whole microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self::from_nanos(micros.saturating_mul(1_000))
    }

    /// A span of whole milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self::from_nanos(millis.saturating_mul(1_000_000))
    }

    /// The span in thirds of a nanosecond.
    #[must_use]
    pub const fn units(self) -> u64 {
        self.0
    }

    /// The span in nanoseconds, cut off below.
    #[must_use]
    pub const fn as_nanos(self) -> u64 {
        self.0 / PER_NANOSECOND
    }

    /// The span as milliseconds, for people: good to about 15 digits.
    #[must_use]
    #[expect(
        clippy::cast_precision_loss,
        reason = "a figure for people, never computed with"
    )]
    pub fn as_millis_f64(self) -> f64 {
        self.0 as f64 / (PER_NANOSECOND * 1_000_000) as f64
    }

    /// The difference, or zero where `other` is the longer one.
    #[must_use]
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl Add for Span {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl Mul<u64> for Span {
    type Output = Self;
    fn mul(self, times: u64) -> Self {
        Self(self.0.saturating_mul(times))
    }
}

impl fmt::Display for Span {
    /// In milliseconds with three decimals, the manual's own unit for the bus: `2.865 ms`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ms", self.as_millis_f64())
    }
}

/// A point in virtual time, counted from the start of the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Instant(u64);

impl Instant {
    /// The start of the run.
    pub const START: Self = Self(0);
    /// The end of all time: later than anything that happens.
    pub const NEVER: Self = Self(u64::MAX);

    /// The time since the start of the run.
    #[must_use]
    pub const fn since_start(self) -> Span {
        Span(self.0)
    }

    /// The time since `earlier`, or zero where `earlier` is the later one.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Span {
        Span(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Span> for Instant {
    type Output = Self;
    fn add(self, span: Span) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl Sub<Span> for Instant {
    type Output = Self;
    fn sub(self, span: Span) -> Self {
        Self(self.0.saturating_sub(span.0))
    }
}

impl AddAssign<Span> for Instant {
    fn add_assign(&mut self, span: Span) {
        *self = *self + span;
    }
}

impl fmt::Display for Instant {
    /// As the span since the start: `5.729 ms`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.since_start().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_is_286458_ns_and_a_third() {
        let byte = Span::from_units(11 * 78_125);
        assert_eq!(byte.as_nanos(), 286_458);
        assert_eq!((byte * 3).as_nanos(), 859_375);
    }

    #[test]
    fn sums_stop_at_the_end_of_time() {
        assert_eq!(Instant::NEVER + Span::from_millis(1), Instant::NEVER);
        assert_eq!(Instant::START - Span::from_millis(1), Instant::START);
    }
}
