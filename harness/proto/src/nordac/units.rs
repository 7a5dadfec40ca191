//! Raw numbers and the values that people write: `100` and `5.00 s` are the same acceleration time (NORDAC 5).
//!
//! A raw number is a whole number of steps of its unit. Nothing is rounded: a value between two steps is an error.

use super::parameter::Parameter;
use core::fmt;

/// What a raw number counts: `step` / 10^`places` of something with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Unit {
    /// One raw step in units of the last decimal place.
    pub step: u8,
    /// Decimal places.
    pub places: u8,
    /// The name behind the number; empty for plain numbers.
    pub name: &'static str,
}

impl Unit {
    /// `of(5, 2, "s")` counts 0.05 s.
    #[must_use]
    pub const fn of(step: u8, places: u8, name: &'static str) -> Self {
        Self { step, places, name }
    }

    /// Whether raw numbers and values are the same.
    #[must_use]
    pub const fn is_plain(self) -> bool {
        self.step == 1 && self.places == 0
    }

    /// A raw number as people read it.
    #[must_use]
    pub const fn show(self, raw: i64) -> RawWithUnit {
        RawWithUnit { unit: self, raw }
    }

    /// The raw number of a text: `100` is raw; `5 s`, `5s`, `5.00s` are values; where the unit has no name, so is `0.80`.
    ///
    /// # Errors
    /// [`BadQuantity`] where the text is no number, has another unit, or lies between two steps.
    pub fn parse(self, text: &str) -> Result<i64, BadQuantity> {
        let text = text.trim();
        let (sign, rest) = match text.strip_prefix('-') {
            Some(rest) => (-1, rest),
            None => (1, text.strip_prefix('+').unwrap_or(text)),
        };
        let end = rest
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .unwrap_or(rest.len());
        let (number, name) = rest.split_at(end);
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        let digits = |text: &str| !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit());
        let pointed = number.contains('.');
        if !digits(whole) || pointed && !digits(fraction) {
            return Err(BadQuantity::Number);
        }
        // 12 digits before the point and 6 behind it are more than a double word holds.
        let fraction = fraction.trim_end_matches('0');
        let whole = whole.trim_start_matches('0');
        if whole.len() > 12 {
            return Err(BadQuantity::Size);
        }
        if fraction.len() > 6 {
            return Err(BadQuantity::Step(self));
        }
        let name = name.trim();
        if name.is_empty() && !pointed {
            return Ok(sign * whole.parse().unwrap_or(0));
        }
        if !self.is_called(name) {
            return Err(BadQuantity::Unit(self));
        }
        let places = fraction.len() as u32;
        let all: i128 = [whole, fraction]
            .iter()
            .flat_map(|part| part.bytes())
            .fold(0, |all, digit| all * 10 + i128::from(digit - b'0'));
        let steps = all * 10i128.pow(self.places.into());
        let size = i128::from(self.step) * 10i128.pow(places);
        if size == 0 || steps % size != 0 {
            return Err(BadQuantity::Step(self));
        }
        let raw = i64::try_from(steps / size).map_err(|_| BadQuantity::Size)?;
        Ok(sign * raw)
    }

    /// Whether this is its name: in capital or small letters, and `rpm` for min-1.
    fn is_called(self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name) || self.name == "min-1" && name == "rpm"
    }
}

/// The step with its unit: `0.05 s`.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.show(1).fmt(f)
    }
}

/// A raw number with its unit, shown as a value: `5.00 s`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawWithUnit {
    unit: Unit,
    raw: i64,
}

impl fmt::Display for RawWithUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Unit { step, places, name } = self.unit;
        let all = i128::from(self.raw) * i128::from(step);
        let power = 10u128.pow(places.into());
        let size = all.unsigned_abs();
        let sign = if all < 0 { "-" } else { "" };
        write!(f, "{sign}{}", size / power)?;
        if places > 0 {
            write!(f, ".{:0width$}", size % power, width = places.into())?;
        }
        match name {
            "" => Ok(()),
            name => write!(f, " {name}"),
        }
    }
}

/// Why a text is no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadQuantity {
    /// It is no decimal number.
    Number,
    /// The unit is another one, or is missing behind a number with a point.
    Unit(Unit),
    /// It lies between two steps of the unit.
    Step(Unit),
    /// No parameter holds it.
    Size,
}

impl fmt::Display for BadQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number => f.write_str("this is no number: write it as 100, 5s or 50.0Hz"),
            Self::Unit(unit) if unit.is_plain() && unit.name.is_empty() => {
                f.write_str("this parameter has no unit: give a whole number")
            }
            Self::Unit(unit) if unit.name.is_empty() => {
                write!(
                    f,
                    "this parameter has no unit: give a value such as {unit}, or the raw number without a point"
                )
            }
            Self::Unit(unit) => write!(
                f,
                "this parameter is counted in {}: give a value such as {unit}, or the raw number without unit and point",
                unit.name
            ),
            Self::Step(unit) => write!(
                f,
                "the drive counts in steps of {unit}: give a multiple of it"
            ),
            Self::Size => f.write_str("the number is too large for a parameter"),
        }
    }
}

impl core::error::Error for BadQuantity {}

impl Parameter {
    /// The number that a text means for an element: raw or with its unit. Its limits are not checked.
    ///
    /// # Errors
    /// [`BadQuantity`] where the text is no value of this parameter.
    pub fn parse(&self, element: u16, text: &str) -> Result<i64, BadQuantity> {
        self.unit_of(element).parse(text)
    }

    /// A number as people read it.
    #[must_use]
    pub fn show(&self, element: u16, number: i64) -> RawWithUnit {
        self.unit_of(element).show(number)
    }
}
