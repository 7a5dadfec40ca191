//! Numbers with a unit: `1500rpm`, `-2.5 A`, `95°C`, and tolerances: `+-1%`, `+-10rpm`.

use super::problem::{Problem, TextSpan};
use super::scanner::Scanner;
use harness_proto::ratio::Ratio;
use std::fmt;

/// Digits after the point that are shown of turns: one increment is 0.000015 turns.
const TURN_DECIMALS: usize = 5;

/// Significant digits shown of all other quantities: a word has no more.
const DIGITS: usize = 5;

/// Maximum number of digits of a number.
const MOST_DIGITS: u32 = 12;

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// rpm
    Speed,
    /// rpm/s
    Ramp,
    /// A
    Current,
    /// turns
    Angle,
    /// °C
    Temperature,
    /// ohm
    Resistance,
    /// V; of the back EMF, V per 1000 rpm
    Voltage,
    /// us
    Time,
    /// h
    Hours,
    /// Hz
    Frequency,
}

/// A unit: its name, and how many of the unit of the scales it is, as a fraction.
#[derive(Debug, PartialEq, Eq)]
pub struct Unit {
    /// The name as written and shown.
    pub name: &'static str,
    dimension: Dimension,
    factor: (i128, i128),
}

const fn unit(name: &'static str, dimension: Dimension, factor: (i128, i128)) -> Unit {
    Unit {
        name,
        dimension,
        factor,
    }
}

/// Every unit. The first of a dimension is the one in which the scales of the drive measure it.
/// A current is written in A or Aeff, whichever the cell measures: the cell decides.
static UNITS: [Unit; 25] = [
    unit("rpm", Dimension::Speed, (1, 1)),
    unit("rpm/s", Dimension::Ramp, (1, 1)),
    // 60 / 2 pi (ND21 14.5.4 prints both units).
    unit("rad/s2", Dimension::Ramp, (9_549_296_586, 1_000_000_000)),
    unit("A", Dimension::Current, (1, 1)),
    unit("mA", Dimension::Current, (1, 1_000)),
    unit("Aeff", Dimension::Current, (1, 1)),
    unit("mAeff", Dimension::Current, (1, 1_000)),
    unit("turns", Dimension::Angle, (1, 1)),
    unit("turn", Dimension::Angle, (1, 1)),
    unit("deg", Dimension::Angle, (1, 360)),
    unit("°", Dimension::Angle, (1, 360)),
    unit("C", Dimension::Temperature, (1, 1)),
    unit("°C", Dimension::Temperature, (1, 1)),
    unit("ohm", Dimension::Resistance, (1, 1)),
    unit("kohm", Dimension::Resistance, (1_000, 1)),
    unit("V", Dimension::Voltage, (1, 1)),
    unit("mV", Dimension::Voltage, (1, 1_000)),
    unit("us", Dimension::Time, (1, 1)),
    unit("ms", Dimension::Time, (1_000, 1)),
    unit("s", Dimension::Time, (1_000_000, 1)),
    unit("h", Dimension::Hours, (1, 1)),
    unit("Hz", Dimension::Frequency, (1, 1)),
    unit("kHz", Dimension::Frequency, (1_000, 1)),
    unit("MHz", Dimension::Frequency, (1_000_000, 1)),
    unit("rad/s²", Dimension::Ramp, (9_549_296_586, 1_000_000_000)),
];

impl Dimension {
    /// The name of its first unit.
    pub fn unit(self) -> &'static str {
        let of_dimension = |unit: &&Unit| unit.dimension == self;
        UNITS.iter().find(of_dimension).map_or("", |unit| unit.name)
    }

    /// The names of its units, for a message: "rpm/s or rad/s2". Other spellings are not named.
    fn names(self) -> String {
        let spelling = |unit: &Unit| unit.name == "turn" || !unit.name.is_ascii();
        let names: Vec<_> = UNITS
            .iter()
            .filter(|unit| unit.dimension == self && !spelling(unit))
            .map(|unit| unit.name)
            .collect();
        names.join(" or ")
    }
}

impl Unit {
    /// A value in the unit of the scales as text in this one.
    #[must_use]
    pub fn show(&self, value: f64) -> String {
        #[expect(clippy::cast_precision_loss, reason = "a table of small numbers")]
        let in_unit = value * self.factor.1 as f64 / self.factor.0 as f64;
        format!("{} {}", figures(in_unit, self.name), self.name)
    }
}

/// A number in this unit with as many digits as say something.
#[must_use]
pub fn figures(value: f64, unit: &str) -> String {
    let before = |limit: f64| usize::from(value.abs() >= limit);
    let decimals = match unit {
        "turn" | "turns" => TURN_DECIMALS,
        _ => DIGITS - 1 - [1e1, 1e2, 1e3, 1e4].map(before).iter().sum::<usize>(),
    };
    trimmed(value, decimals)
}

/// A number with at most `decimals` decimals and no trailing zeros.
fn trimmed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let short = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    if short == "-0" { "0" } else { short }.to_owned()
}

/// A number with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// The number, in the unit of the scales.
    pub value: Ratio,
    /// The unit as written.
    pub unit: &'static Unit,
    pub span: TextSpan,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.unit.show(self.value.to_f64()))
    }
}

impl Quantity {
    /// As the language writes it, to the last digit: `1500rpm`; `5 A`, as `5A` would be a byte.
    pub fn written(self) -> String {
        let (n, d) = self.unit.factor;
        let value = decimal(
            i128::from(self.value.numerator()) * d,
            i128::from(self.value.denominator()) * n,
        );
        let is_byte = self.unit.name.bytes().all(|c| c.is_ascii_hexdigit());
        format!(
            "{value}{}{}",
            if is_byte { " " } else { "" },
            self.unit.name
        )
    }

    /// The same, if it measures this.
    fn of(self, dimension: Dimension) -> Result<Self, Problem> {
        if self.unit.dimension == dimension {
            return Ok(self);
        }
        Err(Problem::new(
            self.span,
            format!("`{}` does not fit here", self.unit.name),
            format!("a number in {} expected here", dimension.names()),
        ))
    }

    /// The nearest whole number of `parts` of the unit of the scales, if it is from `least` to `most`
    /// whole units.
    pub fn whole(self, parts: i32, least: i32, most: i32) -> Result<i32, Problem> {
        let (n, d) = (self.value.numerator(), self.value.denominator());
        let number = n
            .checked_mul(i64::from(parts))
            .and_then(|n| Ratio::new(n, d))
            .and_then(|scaled| i32::try_from(scaled.round()).ok());
        let range = Ratio::whole(least)..=Ratio::whole(most);
        number
            .filter(|_| range.contains(&self.value))
            .ok_or_else(|| {
                let first = UNITS
                    .iter()
                    .find(|unit| unit.dimension == self.unit.dimension)
                    .unwrap_or(self.unit);
                Problem::new(
                    self.span,
                    format!("{self} is not possible here"),
                    format!("{least} to {most} {} expected here", first.name),
                )
            })
    }
}

/// The tolerance of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// `+-1%`, of the expected value.
    Percent(Ratio),
    /// `+-10rpm`
    Absolute(Quantity),
}

impl Tolerance {
    /// As the language writes it, to the last digit: `+-1%`.
    pub fn written(self) -> String {
        match self {
            Self::Percent(percent) => {
                let (n, d) = (percent.numerator(), percent.denominator());
                format!("+-{}%", decimal(i128::from(n), i128::from(d)))
            }
            Self::Absolute(quantity) => format!("+-{}", quantity.written()),
        }
    }

    /// How far a value may be from `expected`, in the unit of the scales.
    #[must_use]
    pub fn around(self, expected: f64) -> f64 {
        match self {
            Self::Percent(percent) => expected.abs() * percent.to_f64() / 100.0,
            Self::Absolute(quantity) => quantity.value.to_f64().abs(),
        }
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Percent(percent) => write!(f, "+-{} %", figures(percent.to_f64(), "%")),
            Self::Absolute(quantity) => write!(f, "+-{quantity}"),
        }
    }
}

/// Whether the next text can only be a number with a unit. Text that can be read as bytes is bytes.
pub fn ahead(scanner: &Scanner<'_>) -> bool {
    let mut ahead = scanner.clone();
    let signed = ahead.eat("-") || ahead.eat("+");
    let Some(digits) = ahead.take_while(|c| c.is_ascii_digit()) else {
        return signed;
    };
    let behind = ahead.tight();
    if signed || behind.starts_with('.') && !behind.starts_with("..") {
        return true;
    }
    let apart = behind.starts_with(' ');
    let Some(letters) = ahead.take_while(is_unit) else {
        return false;
    };
    let known = UNITS.iter().any(|unit| unit.name == letters.value);
    let ends = !ahead
        .tight()
        .starts_with(|c: char| c.is_ascii_alphanumeric());
    let hexadecimal = letters.value.chars().all(|c| c.is_ascii_hexdigit());
    let even = (digits.value.len() + letters.value.len()) % 2 == 0;
    if apart || hexadecimal {
        // No byte has one digit: `5 A` and `95C` are numbers, `5A` and `5AB0` are bytes. The bytes AE FF are never written as
        // `Aeff`.
        return known && ends && (apart || !even || letters.value.len() > 1);
    }
    // `xx` is any byte, and `0x88` a mistake of another kind.
    !letters.value.starts_with(['x', 'X']) && (ends || letters.value.contains('/'))
}

/// A value such as `5A`, that a person can mean as a number with a unit and the program must read as
/// bytes: the number and the unit.
pub fn ambiguous(scanner: &Scanner<'_>) -> Option<(String, &'static Unit)> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit())?;
    if ahead.tight().starts_with(' ') {
        return None;
    }
    let letters = ahead.take_while(|c| c.is_ascii_alphabetic())?;
    let unit = UNITS.iter().find(|unit| unit.name == letters.value)?;
    let alone = ahead.at_end() || ahead.rest().starts_with(['+', '±', 'w']);
    (alone && !self::ahead(scanner)).then(|| (digits.value.to_owned(), unit))
}

impl Unit {
    #[must_use]
    pub const fn dimension(&self) -> Dimension {
        self.dimension
    }
}

fn is_unit(c: char) -> bool {
    c.is_alphabetic() || c == '/' || c == '°' || c == '²'
}

/// Reads a number with its unit; where it must measure something, only a unit of that will do.
pub fn quantity(
    scanner: &mut Scanner<'_>,
    dimension: Option<Dimension>,
) -> Result<Quantity, Problem> {
    let start = scanner.here();
    let (digits, decimals) = number(scanner)?;
    let mut known: Vec<_> = UNITS.iter().collect();
    // `rpm/s` before `rpm`.
    known.sort_by_key(|unit| std::cmp::Reverse(unit.name.len()));
    let mut ahead = scanner.clone();
    let found = known.into_iter().find(|unit| {
        let mut behind = scanner.clone();
        let fits = behind.eat(unit.name)
            && !behind
                .tight()
                .starts_with(|c: char| is_unit(c) || c.is_ascii_digit());
        if fits {
            ahead = behind;
        }
        fits
    });
    let Some(unit) = found else {
        let word = ahead.take_while(|c| is_unit(c) || c.is_ascii_digit());
        let names: Vec<_> = UNITS.iter().map(|unit| unit.name).collect();
        let expected = match dimension {
            Some(dimension) => format!("a unit ({})", dimension.names()),
            None => "a unit such as rpm".to_owned(),
        };
        return Err(match word {
            None => scanner.unexpected(&expected),
            Some(word) => Problem::new(
                word.span,
                format!("`{}` is not a unit", word.value),
                format!("{expected} expected here"),
            )
            .did_you_mean(word.value, &names),
        });
    };
    *scanner = ahead;
    let span = scanner.since(start);
    let (n, d) = unit.factor;
    let value = ratio(i128::from(digits) * n, d * 10_i128.pow(decimals))
        .ok_or_else(|| too_many_digits(span))?;
    let quantity = Quantity { value, unit, span };
    match dimension {
        Some(dimension) => quantity.of(dimension),
        None => Ok(quantity),
    }
}

/// Reads `+-` and how far a value may be off, if that comes next.
pub fn tolerance(
    scanner: &mut Scanner<'_>,
    dimension: Dimension,
) -> Result<Option<Tolerance>, Problem> {
    if !plus_minus(scanner) {
        return Ok(None);
    }
    if scanner.rest().starts_with('-') {
        return Err(scanner.unexpected("a tolerance such as 1% or 10rpm"));
    }
    let mut ahead = scanner.clone();
    let start = ahead.here();
    let (digits, decimals) = number(&mut ahead)?;
    if ahead.eat("%") {
        *scanner = ahead;
        let percent = ratio(i128::from(digits), 10_i128.pow(decimals));
        let percent = percent.ok_or_else(|| too_many_digits(scanner.since(start)))?;
        return Ok(Some(Tolerance::Percent(percent)));
    }
    let quantity = quantity(scanner, Some(dimension))?;
    Ok(Some(Tolerance::Absolute(quantity)))
}

/// Takes `+-` or `±` if it comes next.
pub fn plus_minus(scanner: &mut Scanner<'_>) -> bool {
    scanner.eat("+-") || scanner.eat("±")
}

/// A number with a sign and a point: its digits, and how many of them follow the point.
fn number(scanner: &mut Scanner<'_>) -> Result<(i64, u32), Problem> {
    let start = scanner.here();
    let negative = scanner.eat("-");
    if !negative {
        scanner.eat("+");
    }
    let Some(whole) = scanner.take_while(|c| c.is_ascii_digit()) else {
        return Err(scanner.unexpected("a number with a unit, such as 1500rpm"));
    };
    let mut digits = whole.value.to_owned();
    let mut decimals = 0;
    if scanner.tight().starts_with('.') {
        scanner.eat(".");
        let fraction = scanner
            .take_while(|c| c.is_ascii_digit())
            .ok_or_else(|| scanner.unexpected("digits behind the point"))?;
        digits.push_str(fraction.value);
        decimals = fraction.value.len();
    }
    // Twelve digits times the factor of any unit fit.
    match (digits.parse::<i64>(), u32::try_from(decimals)) {
        (Ok(number), Ok(decimals)) if digits.len() <= MOST_DIGITS as usize => {
            Ok((if negative { -number } else { number }, decimals))
        }
        _ => Err(too_many_digits(scanner.since(start))),
    }
}

fn too_many_digits(span: TextSpan) -> Problem {
    Problem::new(
        span,
        "the number has too many digits",
        "a shorter number expected here",
    )
}

/// A fraction as digits with a point: exact where it has at most twelve decimals, as every number of a scenario has.
fn decimal(numerator: i128, denominator: i128) -> String {
    let exact = |places: u32| (numerator * 10_i128.pow(places)) % denominator == 0;
    let places = (0..MOST_DIGITS).find(|n| exact(*n)).unwrap_or(MOST_DIGITS);
    let digits = numerator * 10_i128.pow(places) / denominator;
    let places = places as usize;
    let text = format!("{:0>width$}", digits.abs(), width = places + 1);
    let (whole, fraction) = text.split_at(text.len() - places);
    let sign = if digits < 0 { "-" } else { "" };
    let point = if places == 0 { "" } else { "." };
    format!("{sign}{whole}{point}{fraction}")
}

/// A fraction in lowest terms, if it fits.
fn ratio(numerator: i128, denominator: i128) -> Option<Ratio> {
    let (mut a, mut b) = (numerator.abs(), denominator.abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    let divisor = a.max(1);
    let part = |number: i128| i64::try_from(number / divisor).ok();
    Ratio::new(part(numerator)?, part(denominator)?)
}

/// Reads a text that is a single number with its unit, such as `300rpm` or `3 ms`.
///
/// # Errors
/// It is no such text; places count from its start.
pub fn parse(text: &str) -> Result<Quantity, Problem> {
    let mut scanner = Scanner::new(text, 0);
    let found = quantity(&mut scanner, None)?;
    scanner.expect_end()?;
    Ok(found)
}
