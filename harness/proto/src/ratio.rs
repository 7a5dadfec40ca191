//! Exact rational numbers: as many operations as the manual's scales need, and no more.

use core::cmp::Ordering;
use core::fmt;

/// A rational number in lowest terms; the denominator is positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ratio {
    numerator: i64,
    denominator: i64,
}

impl Ratio {
    /// 0.
    pub const ZERO: Self = Self::of(0, 1);

    /// `numerator` / `denominator`. `None` if the denominator is 0 or if a part does not fit 64 bits.
    #[must_use]
    pub fn new(numerator: i64, denominator: i64) -> Option<Self> {
        if denominator == 0 {
            return None;
        }
        let sign = if denominator < 0 { -1 } else { 1 };
        Some(Self::of(
            numerator.checked_mul(sign)?,
            denominator.checked_mul(sign)?,
        ))
    }

    /// `digits` / 10^`places`: the number 10,25 is `decimal(1025, 2)`. `None` for more than 18 places.
    #[must_use]
    pub fn decimal(digits: i64, places: u32) -> Option<Self> {
        Self::new(digits, 10_i64.checked_pow(places)?)
    }

    /// A whole number.
    #[must_use]
    pub const fn whole(number: i32) -> Self {
        Self {
            numerator: number as i64,
            denominator: 1,
        }
    }

    /// The numerator, in lowest terms.
    #[must_use]
    pub const fn numerator(self) -> i64 {
        self.numerator
    }

    /// The denominator, in lowest terms; at least 1.
    #[must_use]
    pub const fn denominator(self) -> i64 {
        self.denominator
    }

    /// The number as `f64`: good to about 15 digits.
    #[expect(clippy::cast_precision_loss, reason = "for people and for formulas")]
    #[must_use]
    pub const fn to_f64(self) -> f64 {
        self.numerator as f64 / self.denominator as f64
    }

    /// The nearest whole number; a half goes away from 0.
    #[must_use]
    pub const fn round(self) -> i64 {
        // The quotient of two i64 with a divisor of at least 1 is an i64.
        #[expect(clippy::cast_possible_truncation, reason = "it fits, see above")]
        let rounded = round_div(self.numerator as i128, self.denominator as i128) as i64;
        rounded
    }

    /// A ratio of constants: the denominator must be positive, and is here.
    pub(super) const fn of(numerator: i64, denominator: i64) -> Self {
        let (mut a, mut b) = (numerator.unsigned_abs(), denominator.unsigned_abs());
        while b != 0 {
            (a, b) = (b, a % b);
        }
        // `a` is at least 1 and divides a positive i64, so it fits.
        #[expect(clippy::cast_possible_wrap, reason = "it fits, see above")]
        let divisor = a as i64;
        Self {
            numerator: numerator / divisor,
            denominator: denominator / divisor,
        }
    }
}

/// The nearest whole number to `a` / `b`, a half away from 0. `b` is positive.
pub(super) const fn round_div(a: i128, b: i128) -> i128 {
    let (quotient, rest) = (a / b, a % b);
    if rest.abs() < b - rest.abs() {
        quotient
    } else {
        quotient + a.signum()
    }
}

impl Ord for Ratio {
    fn cmp(&self, other: &Self) -> Ordering {
        let left = i128::from(self.numerator) * i128::from(other.denominator);
        let right = i128::from(other.numerator) * i128::from(self.denominator);
        left.cmp(&right)
    }
}

impl PartialOrd for Ratio {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.denominator == 1 {
            write!(f, "{}", self.numerator)
        } else {
            write!(f, "{}", self.to_f64())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lowest_terms() {
        let ratio = Ratio::new(6, -4).unwrap();
        assert_eq!((ratio.numerator(), ratio.denominator()), (-3, 2));
        assert_eq!(Ratio::new(0, 7), Some(Ratio::ZERO));
        assert_eq!(Ratio::new(1, 0), None);
        assert_eq!(Ratio::new(i64::MIN, -1), None);
        assert_eq!(Ratio::new(1, i64::MIN), None);
        assert_eq!(
            Ratio::new(i64::MIN, 2),
            Some(Ratio::of(i64::MIN.wrapping_shr(1), 1))
        );
        assert_eq!(Ratio::decimal(1025, 2), Ratio::new(41, 4));
        assert_eq!(Ratio::decimal(1, 19), None);
    }

    #[test]
    fn rounds_halves_away_from_zero() {
        for (numerator, denominator, expected) in [
            (5, 2, 3),
            (-5, 2, -3),
            (7, 3, 2),
            (-7, 3, -2),
            (8, 3, 3),
            (1, 2, 1),
            (-1, 2, -1),
            (0, 1, 0),
            (i64::MIN, 1, i64::MIN),
            (i64::MAX, 2, 1 << 62),
        ] {
            let ratio = Ratio::new(numerator, denominator).unwrap();
            assert_eq!(ratio.round(), expected, "{numerator}/{denominator}");
        }
    }

    #[test]
    fn ordered_by_value() {
        assert!(Ratio::of(1, 3) < Ratio::of(34, 100));
        assert!(Ratio::of(-1, 3) > Ratio::of(-34, 100));
    }
}
