//! Registers and their contents: `SPEED_ACTUAL = 50%`, `52 = 3000`.

use super::super::syntax::{Expect, RegisterName, ValueKind, WrittenValue};
use harness_bench::scenario::expression;
use harness_bench::scenario::parse::words::equals;
use harness_bench::scenario::problem::{Problem, nearest};
use harness_bench::scenario::scanner::Scanner;
use harness_proto::unitek::register::Unit;
use harness_proto::unitek::units::{Decimal, Given};
use harness_proto::unitek::{ALIASES, BadName, REGISTERS, Register};

const MOST_DIGITS: usize = 12;

impl RegisterName {
    /// What it counts, where it is known.
    pub(super) fn unit(&self) -> Option<Unit> {
        match self {
            Self::Known { register, .. } => Some(register.unit),
            Self::Counted(_) => None,
        }
    }
}

/// The register that shows what is overruled.
pub(in super::super) fn register_of_force(name: &str) -> Option<&'static Register> {
    let number = match name {
        "tol" | "cal" => 0xF4,
        "speed" => 0x30,
        "errors" => 0x8F,
        "motor-temperature" => 0x49,
        "igbt-temperature" => 0x4A,
        "air-temperature" => 0x4B,
        "bus-voltage" => 0xEB,
        _ => return None,
    };
    Some(Register::of(number))
}

/// `52`, `SPEED_ACTUAL`, `(k)`
pub(super) fn register(scanner: &mut Scanner<'_>) -> Result<RegisterName, Problem> {
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        if !scanner.eat(")") {
            return Err(scanner.unexpected("`)`"));
        }
        return Ok(RegisterName::Counted(number));
    }
    let before = scanner.clone();
    let text = scanner
        .take_while(|c| !c.is_whitespace() && c != '=')
        .map_or("", |text| text.value);
    if text.is_empty() {
        return Err(scanner.unexpected("a register: two hexadecimal digits, or a name"));
    }
    match Register::named(text) {
        // A name of the dump that several registers have stands for none of them.
        Ok(register) => Ok(RegisterName::Known {
            register,
            by_name: u8::from_str_radix(text.trim_start_matches("0x"), 16).is_err()
                && Register::named(register.name).is_ok(),
        }),
        Err(bad) => {
            *scanner = before;
            let problem = scanner.unexpected("a register");
            Err(match bad {
                BadName::Ambiguous { .. } => problem.help(bad.to_string()),
                BadName::Unknown => match suggestion(text) {
                    Some(near) => problem.help(format!("did you mean `{near}`?")),
                    None => problem.help(
                        "give its number, such as 30, or its name in the register table, such as SPEED_ACTUAL",
                    ),
                },
            })
        }
    }
}

fn suggestion(text: &str) -> Option<&'static str> {
    let names = REGISTERS.iter().map(|register| register.name);
    let aliases = ALIASES.iter().map(|(alias, _)| *alias);
    let known: Vec<_> = names
        .chain(aliases)
        .filter(|name| Register::named(name).is_ok())
        .collect();
    nearest(&text.to_ascii_uppercase(), &known)
}

/// `= 50% +- 1%`
pub(super) fn expect(
    scanner: &mut Scanner<'_>,
    register: &RegisterName,
) -> Result<Expect, Problem> {
    equals(scanner)?;
    let value = value(scanner, register.unit())?;
    let tolerance = match scanner.eat("+-") {
        true => Some(self::value(scanner, register.unit())?),
        false => None,
    };
    Ok(Expect { value, tolerance })
}

/// Contents: hexadecimal digits as they are, or a decimal number with a unit.
pub(super) fn value(
    scanner: &mut Scanner<'_>,
    unit: Option<Unit>,
) -> Result<WrittenValue, Problem> {
    let here = scanner.here();
    let kind = kind(scanner, unit)?;
    Ok(WrittenValue {
        kind,
        span: scanner.since(here),
    })
}

fn kind(scanner: &mut Scanner<'_>, unit: Option<Unit>) -> Result<ValueKind, Problem> {
    const EXPECTED: &str = "hexadecimal digits such as 0CCD, or a number with its unit such as 10%";
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        if !scanner.eat(")") {
            return Err(scanner.unexpected("`)`"));
        }
        return Ok(ValueKind::Counted(number));
    }
    let before = scanner.clone();
    let negative = scanner.eat("-");
    let signed = negative || scanner.eat("+");
    let text = scanner
        .take_while(|c| c.is_ascii_alphanumeric() || c == '.' || c == '%')
        .map_or("", |text| text.value);
    let unexpected = |help: Option<String>| {
        let problem = before.clone().unexpected(EXPECTED);
        match help {
            Some(help) => problem.help(help),
            None => problem,
        }
    };
    if text.is_empty() {
        return Err(unexpected(None));
    }
    if text.starts_with("0x") || text.starts_with("0X") {
        let help = "numbers are written without 0x, as in the manual: 0CCD";
        return Err(unexpected(Some(help.to_owned())));
    }
    let digits = text.len()
        - text
            .trim_start_matches(|c: char| c.is_ascii_digit() || c == '.')
            .len();
    let (number, name) = text.split_at(digits);
    let hexadecimal = !signed && text.bytes().all(|c| c.is_ascii_hexdigit());
    let given = match name {
        // `50 %`: a unit of its own.
        "" => {
            let mut ahead = scanner_behind(&before, signed, text);
            let word = ahead
                .take_while(|c| c.is_ascii_alphabetic() || c == '%')
                .map_or("", |word| word.value);
            let given = unit_named(word);
            if given.is_some() {
                *scanner = ahead;
            }
            given
        }
        // `5A` can be hexadecimal digits.
        "A" if hexadecimal => {
            if matches!(unit, Some(Unit::Current | Unit::DeciAmpere)) && text.len() < 4 {
                let help = format!(
                    "write `{number}.0A` for amperes, or four hexadecimal digits `{text:0>4}`"
                );
                return Err(unexpected(Some(help)));
            }
            None
        }
        name => unit_named(name),
    };
    if let Some(given) = given {
        let Some(decimal) = decimal(number, negative) else {
            return Err(before
                .clone()
                .unexpected("a decimal number of at most 12 digits"));
        };
        // `5A` would be hexadecimal digits, so amperes are kept with a point.
        let decimal = match (given, decimal.places) {
            (Given::Ampere, 0) => Decimal {
                digits: decimal.digits * 10,
                places: 1,
            },
            _ => decimal,
        };
        return Ok(ValueKind::Given(decimal, given));
    }
    if hexadecimal && text.len() <= 8 {
        let raw = u32::from_str_radix(text, 16).unwrap_or(0);
        return Ok(ValueKind::Raw(raw, text.len()));
    }
    let help = if signed || (!name.is_empty() && !hexadecimal && digits > 0) {
        let units: Vec<_> = Given::ALL.iter().map(|given| given.name()).collect();
        Some(format!("units are {}", units.join(", ")))
    } else {
        None
    };
    Err(unexpected(help))
}

/// The scanner after a number that it had in front of it.
fn scanner_behind<'t>(before: &Scanner<'t>, signed: bool, text: &str) -> Scanner<'t> {
    let mut behind = before.clone();
    if signed && !behind.eat("-") {
        behind.eat("+");
    }
    behind.eat(text);
    behind
}

fn unit_named(name: &str) -> Option<Given> {
    Given::from_name(if name == "turn" { "turns" } else { name })
}

fn decimal(number: &str, negative: bool) -> Option<Decimal> {
    let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
    let fits = fraction.len() <= usize::from(Decimal::MAX_PLACES)
        && !whole.is_empty()
        && fraction.is_empty() != number.contains('.')
        && whole.len() + fraction.len() <= MOST_DIGITS;
    let digits: i64 = fits.then(|| format!("{whole}{fraction}").parse().ok())??;
    Some(Decimal {
        digits: if negative { -digits } else { digits },
        places: u8::try_from(fraction.len()).ok()?,
    })
}
