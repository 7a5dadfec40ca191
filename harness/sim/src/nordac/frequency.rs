//! Exact frequencies: fractions of a tenth of a hertz, the unit of the frequency parameters (5.1).

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};

/// The largest denominator that a frequency keeps when it becomes the start of a ramp.
///
/// It bounds the products of [`super::ramp`] to 127 bits. At 1.5 Mbit/s a ramp reaches it only after its course has
/// changed in motion by two times that have no common factor; the frequency is then rounded to 2^-47 of a tenth of a hertz.
const FINEST: i128 = 1 << 47;

/// A frequency; negative for the negative phase sequence.
#[derive(Clone, Copy, Debug)]
pub struct Frequency {
    /// In tenths of a hertz, times the denominator.
    numerator: i128,
    /// At least 1.
    denominator: i128,
}

impl Frequency {
    /// Standstill.
    pub const ZERO: Self = Self::tenths(0);

    /// Whole tenths of a hertz.
    #[must_use]
    pub const fn tenths(tenths: i64) -> Self {
        Self::new(tenths as i128, 1)
    }

    /// `numerator` / `denominator` tenths of a hertz; the denominator must be positive.
    pub(super) const fn new(numerator: i128, denominator: i128) -> Self {
        Self {
            numerator,
            denominator,
        }
    }

    pub(super) const fn numerator(self) -> i128 {
        self.numerator
    }

    pub(super) const fn denominator(self) -> i128 {
        self.denominator
    }

    /// The frequency without its sign.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self::new(self.numerator.abs(), self.denominator)
    }

    /// The frequency as it is, or of the other sign.
    pub(super) const fn signed(self, positive: bool) -> Self {
        let sign = if positive { 1 } else { -1 };
        Self::new(sign * self.numerator, self.denominator)
    }

    /// Whether the motor stands.
    #[must_use]
    pub const fn is_zero(self) -> bool {
        self.numerator == 0
    }

    /// Whether the phase sequence is negative.
    #[must_use]
    pub const fn is_negative(self) -> bool {
        self.numerator < 0
    }

    /// The frequency times `factor` / `divisor`, rounded to the nearest whole number, a half away from 0. `divisor` must be positive.
    #[must_use]
    pub const fn rounded(self, factor: i64, divisor: i64) -> i128 {
        if self.is_zero() {
            return 0;
        }
        let numerator = self.numerator * factor as i128;
        let denominator = self.denominator * divisor as i128;
        let nearest = quotient(2 * numerator.abs() + denominator, 2 * denominator);
        nearest * numerator.signum()
    }

    /// The frequency times `factor` / `divisor`, cut off towards 0. `divisor` must be positive.
    #[must_use]
    pub const fn cut(self, factor: i64, divisor: i64) -> i128 {
        quotient(
            self.numerator * factor as i128,
            self.denominator * divisor as i128,
        )
    }

    /// Numerator and denominator, if both have 64 bits.
    fn short(self) -> Option<(i64, i64)> {
        let numerator = i64::try_from(self.numerator).ok()?;
        Some((numerator, i64::try_from(self.denominator).ok()?))
    }

    /// In lowest terms, and rounded where the denominator is larger than [`FINEST`].
    pub(super) const fn settled(self) -> Self {
        let (mut a, mut b) = (
            self.numerator.unsigned_abs(),
            self.denominator.unsigned_abs(),
        );
        while b != 0 {
            (a, b) = (b, a % b);
        }
        // The divisor divides the denominator, which is a positive i128.
        let divisor = a.cast_signed();
        let (numerator, denominator) = (self.numerator / divisor, self.denominator / divisor);
        if denominator <= FINEST {
            return Self::new(numerator, denominator);
        }
        let whole = numerator.div_euclid(denominator);
        // Both lose low bits until they have 80, so that the product fits.
        let excess = 48_u32.saturating_sub(denominator.leading_zeros());
        let rest = numerator.rem_euclid(denominator) >> excess;
        let part = rest * FINEST / (denominator >> excess);
        Self::new(whole * FINEST + part, FINEST)
    }
}

/// `a` / `b`, where `b` is positive. Most numbers here have 64 bits, and their division is several times faster.
const fn quotient(a: i128, b: i128) -> i128 {
    let (short_a, short_b) = (a as i64, b as i64);
    if short_a as i128 == a && short_b as i128 == b {
        (short_a / short_b) as i128
    } else {
        a / b
    }
}

impl PartialEq for Frequency {
    #[inline]
    fn eq(&self, other: &Self) -> bool {
        // A motor that stands is the usual case.
        if self.is_zero() || other.is_zero() {
            return self.is_zero() && other.is_zero();
        }
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Frequency {}

impl Hash for Frequency {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let settled = self.settled();
        (settled.numerator, settled.denominator).hash(state);
    }
}

impl PartialOrd for Frequency {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Frequency {
    fn cmp(&self, other: &Self) -> Ordering {
        if self.denominator == other.denominator {
            return self.numerator.cmp(&other.numerator);
        }
        if let (Some(left), Some(right)) = (self.short(), other.short()) {
            // 64 bits times 64 bits: two instructions, and no check.
            return (i128::from(left.0) * i128::from(right.1))
                .cmp(&(i128::from(right.0) * i128::from(left.1)));
        }
        let left = self.numerator.checked_mul(other.denominator);
        let right = other.numerator.checked_mul(self.denominator);
        if let (Some(left), Some(right)) = (left, right) {
            return left.cmp(&right);
        }
        // The whole parts first, and then the reciprocals of what is left.
        let whole = |x: &Self| x.numerator.div_euclid(x.denominator);
        let rest = |x: &Self| x.numerator.rem_euclid(x.denominator);
        let (left, right) = (rest(self), rest(other));
        whole(self).cmp(&whole(other)).then_with(|| {
            if left == 0 || right == 0 {
                return left.cmp(&right);
            }
            Self::new(other.denominator, right).cmp(&Self::new(self.denominator, left))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_rounded_away_from_zero_and_displays_are_cut_off() {
        for (numerator, rounded, cut) in
            [(3, 2, 1), (-3, -2, -1), (1, 1, 0), (-1, -1, 0), (4, 2, 2)]
        {
            let half = Frequency::new(numerator, 2);
            assert_eq!(
                (half.rounded(1, 1), half.cut(1, 1)),
                (rounded, cut),
                "{numerator}/2"
            );
        }
        assert_eq!(Frequency::tenths(350).rounded(16_384, 700), 0x2000);
    }

    #[test]
    fn equal_by_value() {
        assert_eq!(Frequency::new(2, 4), Frequency::new(1, 2));
        assert!(Frequency::new(-1, 3) < Frequency::ZERO);
        let reduced = Frequency::new(6, 64).settled();
        assert_eq!((reduced.numerator(), reduced.denominator()), (3, 32));
    }

    #[test]
    fn ordered_where_products_do_not_fit() {
        let large = 1_i128 << 89;
        let (a, b) = (
            Frequency::new(large - 1, 3 * large),
            Frequency::new(large - 2, 3 * large - 7),
        );
        assert_eq!(a.cmp(&b), Ordering::Less);
        assert_eq!(b.cmp(&a), Ordering::Greater);
        assert_eq!(a.cmp(&a), Ordering::Equal);
        assert!(a.signed(false) > b.signed(false));
    }

    #[test]
    fn a_fine_fraction_is_rounded_below_one_part_in_2_to_the_46() {
        let prime = (1_i128 << 89) - 1;
        for numerator in [prime / 3, -prime / 3, 9_990 * prime + 1, 1 - 9_990 * prime] {
            let rounded = Frequency::new(numerator, prime).settled();
            assert_eq!(rounded.denominator(), FINEST);
            let fine = Frequency::new(numerator, prime).cut(1 << 20, 1);
            assert!((rounded.cut(1 << 20, 1) - fine).abs() <= 1, "{numerator}");
        }
    }
}
