//! Times in a scenario: `5ms`, `286.458us`, `12 bytes`, and windows of them.

use super::problem::{Problem, Spanned, TextSpan};
use super::scanner::Scanner;
use harness_proto::time::Span;
use std::fmt;

/// The longest time that a scenario can speak of: eleven minutes. A DP watchdog has at most 650.25 s.
const MAX: Span = Span::from_millis(660_000);

/// Digits after the point that are taken.
const MAX_DECIMALS: usize = 9;

/// A length of time as written: in units of time, or of bytes on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Duration {
    /// The digits without their point.
    digits: u64,
    /// How many of them follow the point.
    decimals: u32,
    unit: DurationUnit,
    span: TextSpan,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DurationUnit {
    Time(Span),
    Bytes,
}

const UNITS: [(&str, DurationUnit); 6] = [
    ("us", DurationUnit::Time(Span::from_micros(1))),
    ("ms", DurationUnit::Time(Span::from_millis(1))),
    ("s", DurationUnit::Time(Span::from_millis(1000))),
    ("bytes", DurationUnit::Bytes),
    ("byte", DurationUnit::Bytes),
    ("ns", DurationUnit::Time(Span::from_nanos(1))),
];

impl Duration {
    #[must_use]
    pub const fn nanos(number: u64) -> Self {
        Self::of(number, Span::from_nanos(1))
    }

    #[must_use]
    pub const fn micros(number: u64) -> Self {
        Self::of(number, Span::from_micros(1))
    }

    #[must_use]
    pub const fn millis(number: u64) -> Self {
        Self::of(number, Span::from_millis(1))
    }

    /// The same digits with one more of them after the point: a tenth of the time.
    #[must_use]
    pub const fn tenth(self) -> Self {
        Self {
            decimals: self.decimals + 1,
            ..self
        }
    }

    const fn of(digits: u64, unit: Span) -> Self {
        Self {
            digits,
            decimals: 0,
            unit: DurationUnit::Time(unit),
            span: TextSpan { start: 0, end: 0 },
        }
    }

    /// The time on a line with the given byte time.
    #[must_use]
    pub fn on(self, byte_time: Span) -> Span {
        self.scaled(self.digits, byte_time)
    }

    /// Half a unit of the last digit written: how exact an exact time is meant.
    #[must_use]
    pub fn tolerance(self, byte_time: Span) -> Span {
        let digit = self.scaled(1, byte_time);
        Span::from_units(digit.units() / 2)
    }

    #[must_use]
    pub const fn span(self) -> TextSpan {
        self.span
    }

    fn scaled(self, digits: u64, byte_time: Span) -> Span {
        let unit = match self.unit {
            DurationUnit::Time(unit) => unit,
            DurationUnit::Bytes => byte_time,
        };
        let units = u128::from(digits) * u128::from(unit.units()) / 10u128.pow(self.decimals);
        Span::from_units(u64::try_from(units).unwrap_or(u64::MAX))
    }
}

impl fmt::Display for Duration {
    /// As the language writes it: every digit, and no space before the unit.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = self.decimals as usize;
        let digits = format!("{:0>width$}", self.digits, width = decimals + 1);
        let (whole, fraction) = digits.split_at(digits.len() - decimals);
        let point = if decimals == 0 { "" } else { "." };
        let row = UNITS.iter().find(|(_, unit)| *unit == self.unit);
        let unit = row.map_or("", |(name, _)| name);
        write!(f, "{whole}{point}{fraction}{unit}")
    }
}

/// A time, or a window between two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    pub from: Duration,
    /// To; the same as `from` for an exact time.
    pub to: Duration,
}

impl Window {
    /// Whether it is one time and no window.
    #[must_use]
    pub(crate) fn is_exact(self) -> bool {
        self.from == self.to
    }
}

impl From<Duration> for Window {
    /// One exact time.
    fn from(time: Duration) -> Self {
        Self {
            from: time,
            to: time,
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.is_exact() {
            true => self.from.fmt(f),
            false => write!(f, "{}..{}", self.from, self.to),
        }
    }
}

pub fn duration(scanner: &mut Scanner<'_>) -> Result<Duration, Problem> {
    let start = scanner.here();
    let (digits, decimals) = number(scanner)?;
    finish(scanner, digits, decimals, start)
}

/// Reads a time or a window.
pub(crate) fn window(scanner: &mut Scanner<'_>) -> Result<Window, Problem> {
    let start = scanner.here();
    let (digits, decimals) = number(scanner)?;
    // In `5..7ms` the first number borrows the unit of the second.
    if scanner.eat("..") {
        let to = duration(scanner)?;
        let span = scanner.since(start);
        let from = Duration {
            digits,
            decimals,
            unit: to.unit,
            span,
        };
        return ordered(Window { from, to }, span);
    }
    let from = finish(scanner, digits, decimals, start)?;
    if !scanner.eat("..") {
        return Ok(Window { from, to: from });
    }
    let to = duration(scanner)?;
    ordered(Window { from, to }, scanner.since(start))
}

fn ordered(window: Window, span: TextSpan) -> Result<Window, Problem> {
    let nominal = Span::from_micros(286);
    if window.from.on(nominal) > window.to.on(nominal) {
        return Err(Problem::new(
            span,
            "the window ends before it begins",
            "the earlier time comes first",
        ));
    }
    Ok(window)
}

fn number(scanner: &mut Scanner<'_>) -> Result<(u64, u32), Problem> {
    let Some(whole) = scanner.take_while(|c| c.is_ascii_digit()) else {
        return Err(scanner.unexpected("a time such as 5ms"));
    };
    let mut digits = whole.value.to_owned();
    let mut decimals = 0;
    let rest = scanner.rest();
    let point = rest.starts_with('.') && !rest.starts_with("..");
    if point && scanner.eat(".") {
        let fraction = scanner
            .take_while(|c| c.is_ascii_digit())
            .ok_or_else(|| scanner.unexpected("digits behind the point"))?;
        digits.push_str(fraction.value);
        decimals = fraction.value.len();
    }
    match (digits.parse(), u32::try_from(decimals)) {
        (Ok(digits), Ok(decimals)) if decimals as usize <= MAX_DECIMALS => Ok((digits, decimals)),
        _ => Err(Problem::new(
            scanner.since(whole.span),
            "the number has too many digits",
            "a shorter number expected here",
        )),
    }
}

fn finish(
    scanner: &mut Scanner<'_>,
    digits: u64,
    decimals: u32,
    start: TextSpan,
) -> Result<Duration, Problem> {
    let Spanned { value, span } = scanner
        .take_while(|c| c.is_ascii_alphabetic())
        .ok_or_else(|| scanner.unexpected("a unit: us, ms, s or bytes"))?;
    let Some((_, unit)) = UNITS.iter().find(|(name, _)| *name == value) else {
        let names: Vec<_> = UNITS.iter().map(|(name, _)| *name).collect();
        return Err(Problem::new(
            span,
            format!("`{value}` is not a unit of time"),
            "us, ms, s or bytes expected here",
        )
        .did_you_mean(value, &names));
    };
    let span = scanner.since(start);
    let duration = Duration {
        digits,
        decimals,
        unit: *unit,
        span,
    };
    if duration.on(Span::from_micros(1146)) > MAX {
        return Err(Problem::new(
            span,
            "the time is longer than eleven minutes",
            "a shorter time expected here",
        ));
    }
    Ok(duration)
}
