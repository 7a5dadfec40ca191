//! Axes with round numbers: multiples of 1, 2 or 5 times a power of 10, and of powers of 2 for words of bits.

use crate::scenario::quantity::figures;

/// The unit of words of bits, which are shown in hexadecimal digits.
pub const HEX: &str = "hex";

/// Values beyond this are no measurements, and differences of them have no digits.
const LARGEST: f64 = 1e15;

/// A time from which on an axis shows seconds, in milliseconds.
const SECONDS: f64 = 10_000.0;

/// Round numbers between two others, at most one more than `most`.
pub(crate) fn ticks(from: f64, to: f64, most: usize, unit: &str) -> Vec<f64> {
    let raw = (to - from) / most.max(1) as f64;
    if !raw.is_finite() || raw <= 0.0 {
        return vec![from];
    }
    let step = match unit {
        HEX => raw.max(1.0).log2().ceil().exp2(),
        _ => {
            let power = 10_f64.powf(raw.log10().floor());
            let steps = [1.0, 2.0, 5.0].map(|factor| factor * power);
            let step = steps.into_iter().find(|step| *step >= raw * 0.999);
            step.unwrap_or(10.0 * power)
        }
    };
    let first = (from / step - 1e-9).ceil();
    let all = (0..=most + 1).map(|number| (first + number as f64) * step);
    all.take_while(|tick| *tick <= to + step * 1e-9).collect()
}

/// How far two neighbours of a list are apart.
pub fn step(ticks: &[f64]) -> f64 {
    ticks.windows(2).next().map_or(1.0, |two| two[1] - two[0])
}

/// The lowest and the highest value of an axis: round numbers around those that are drawn.
pub fn bounds((least, most): (f64, f64), ticks_at_most: usize, unit: &str) -> (f64, f64) {
    if most <= least {
        let around = (least.abs() * 0.01).max(1.0);
        let low = least - around;
        // A word of bits has no sign.
        let low = if unit == HEX { low.max(0.0) } else { low };
        return (low, least + around);
    }
    let step = step(&ticks(least, most, ticks_at_most, unit)).min(most - least);
    (
        (least / step + 1e-9).floor() * step,
        (most / step - 1e-9).ceil() * step,
    )
}

/// A value without its unit.
pub fn number(value: f64, unit: &str) -> String {
    match unit {
        HEX => format!("{value:X}", value = whole(value)),
        _ => figures(value, unit),
    }
}

/// The value of a text that [`number`] or a table has written; `None` where it is no number that a chart can hold.
#[expect(clippy::cast_precision_loss, reason = "a word of bits has at most 32")]
pub fn number_of(digits: &str, unit: &str) -> Option<f64> {
    let value = match unit {
        HEX => u64::from_str_radix(digits, 16).ok()? as f64,
        _ => digits.parse().ok()?,
    };
    (value.abs() <= LARGEST).then_some(value)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a word of bits is a whole number of at most 32 bits"
)]
fn whole(value: f64) -> u64 {
    value as u64
}

/// What the horizontal axis of a chart shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Along {
    /// Times in milliseconds, shown in seconds where they are long.
    #[default]
    Time,
    /// Numbers of something.
    Count(&'static str),
}

impl Along {
    /// The unit that is shown between these ends, and how many of its own make one of it.
    pub fn unit(self, (from, to): (f64, f64)) -> (&'static str, f64) {
        match self {
            Self::Count(unit) => (unit, 1.0),
            Self::Time if (to - from) >= SECONDS => ("s", 1_000.0),
            Self::Time => ("ms", 1.0),
        }
    }
}

/// A number on an axis without its unit, with the decimals that tell it from its neighbours.
pub fn label(value: f64, apart: f64, unit: &str) -> String {
    match unit {
        HEX => number(value, unit),
        // Adding 0 makes -0 positive.
        _ => format!("{:.*}", decimals(apart), value + 0.0),
    }
}

/// Decimals of numbers that are this far apart.
fn decimals(step: f64) -> usize {
    let places = (-step.log10() - 1e-9).ceil().clamp(0.0, 9.0);
    (0..=9_u8)
        .find(|count| f64::from(*count) >= places)
        .map_or(9, usize::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_numbers() {
        let ticks = |from, to, most| ticks(from, to, most, "");
        assert_eq!(ticks(0.0, 100.0, 8), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        let near = ticks(0.13, 0.31, 4)
            .into_iter()
            .map(|tick| format!("{tick:.3}"));
        assert_eq!(
            near.collect::<Vec<_>>().join(" "),
            "0.150 0.200 0.250 0.300"
        );
        assert_eq!(ticks(-7.0, 7.0, 4), [-5.0, 0.0, 5.0]);
        assert_eq!(ticks(3.0, 3.0, 4), [3.0]);
        assert_eq!(ticks(f64::NAN, 1.0, 4).len(), 1);
        assert_eq!(super::ticks(0.0, 224.0, 4, HEX), [0.0, 64.0, 128.0, 192.0]);
        assert_eq!(bounds((-7.0, 7.0), 4, ""), (-10.0, 10.0));
        assert_eq!(bounds((0.0, 1_000.0), 4, ""), (0.0, 1_000.0));
        assert_eq!(bounds((5.0, 5.0), 4, ""), (4.0, 6.0));
        assert_eq!(bounds((0.0, 0.0), 4, HEX), (0.0, 1.0));
        assert_eq!(number(255.0, HEX), "FF");
        assert_eq!([0.5, 20.0, 0.001].map(decimals), [1, 0, 3]);
        assert_eq!(Along::Time.unit((0.0, 20_000.0)).0, "s");
    }
}
