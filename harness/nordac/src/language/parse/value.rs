//! Parameters and their values: `1205.3 = 50.0Hz`, `"Accel. time" = 5s`.

use super::super::syntax::{ParameterChoice, ParameterName, ValueKind, WrittenValue};
use harness_bench::scenario::expression::{self, Located};
use harness_bench::scenario::parse::words::equals;
use harness_bench::scenario::problem::{Problem, nearest};
use harness_bench::scenario::scanner::Scanner;
use harness_proto::nordac::{PARAMETERS, Parameter};

const MOST_DIGITS: usize = 12;

/// `1205.3 = 50.0Hz`
pub(super) fn assigned(
    scanner: &mut Scanner<'_>,
) -> Result<(ParameterName, WrittenValue), Problem> {
    let name = parameter(scanner)?;
    equals(scanner)?;
    Ok((name, value(scanner)?))
}

/// `1205`, `1205.3`, `"Maximum frequ.".3`, `(k)`
pub(super) fn parameter(scanner: &mut Scanner<'_>) -> Result<ParameterName, Problem> {
    let here = scanner.here();
    let which = which(scanner)?;
    let mut index = Vec::new();
    while scanner.tight().starts_with('.') {
        scanner.eat(".");
        index.push(part(scanner)?);
    }
    Ok(ParameterName {
        which,
        index,
        span: scanner.since(here),
    })
}

/// `3`, `(k+1)`
fn part(scanner: &mut Scanner<'_>) -> Result<Located, Problem> {
    let here = scanner.here();
    if !scanner.eat("(") {
        let number = expression::plain(scanner)?;
        let span = scanner.since(here);
        return Ok(Located {
            span,
            ..Located::number(number)
        });
    }
    let number = expression::sum(scanner)?;
    match scanner.eat(")") {
        true => Ok(number),
        false => Err(scanner.unexpected("`)`")),
    }
}

fn which(scanner: &mut Scanner<'_>) -> Result<ParameterChoice, Problem> {
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        return match scanner.eat(")") {
            true => Ok(ParameterChoice::Counted(number)),
            false => Err(scanner.unexpected("`)`")),
        };
    }
    let before = scanner.clone();
    if scanner.eat("\"") {
        let name = scanner.take_while(|c| c != '"');
        let name = name.map_or("", |name| name.value);
        if !scanner.eat("\"") {
            return Err(scanner.unexpected("`\"` behind the name of the parameter"));
        }
        return Parameter::named(name).map(ParameterChoice::Named).map_err(|_| {
            let names: Vec<_> = PARAMETERS.iter().map(|parameter| parameter.name).collect();
            *scanner = before;
            let problem = scanner.unexpected("a parameter");
            problem.help(match nearest(name, &names) {
                Some(near) => format!("did you mean `\"{near}\"`?"),
                None => "give its number, such as 1202, or its name in the manual, such as \"Accel. time\"".to_owned(),
            })
        });
    }
    let digits = scanner.take_while(|c| c.is_ascii_digit());
    let number = digits.and_then(|digits| digits.value.parse().ok());
    number.map(ParameterChoice::Numbered).ok_or_else(|| {
        *scanner = before;
        let problem = scanner.unexpected("a parameter: its number, or its name in quotation marks");
        problem.help("as in 1202 or \"Accel. time\"")
    })
}

/// A raw decimal number, or a number with its unit.
pub(super) fn value(scanner: &mut Scanner<'_>) -> Result<WrittenValue, Problem> {
    let here = scanner.here();
    let kind = kind(scanner)?;
    Ok(WrittenValue {
        kind,
        span: scanner.since(here),
    })
}

fn kind(scanner: &mut Scanner<'_>) -> Result<ValueKind, Problem> {
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        return match scanner.eat(")") {
            true => Ok(ValueKind::Counted(number)),
            false => Err(scanner.unexpected("`)`")),
        };
    }
    let before = scanner.clone();
    let sign = if scanner.eat("-") { "-" } else { "" };
    let digits = scanner.take_while(|c| c.is_ascii_digit() || c == '.');
    let digits = digits.map_or("", |digits| digits.value);
    let Some((number, places)) = decimal(digits) else {
        *scanner = before;
        return Err(scanner
            .unexpected("a raw number such as 700, or a number with its unit such as 70.0Hz"));
    };
    let mut ahead = scanner.clone();
    let unit = ahead.take_while(|c| c.is_alphabetic() || "%/-1°".contains(c));
    match unit.map(|unit| unit.value).filter(|unit| *unit != "error") {
        None if places == 0 => Ok(ValueKind::Raw(if sign == "-" { -number } else { number })),
        None => {
            *scanner = before;
            let problem = scanner.unexpected("a whole number, or a number with its unit");
            Err(problem.help("raw numbers have no point; write the unit, as in 70.0Hz"))
        }
        Some(unit) => {
            *scanner = ahead;
            Ok(ValueKind::Given(format!("{sign}{digits}{unit}")))
        }
    }
}

/// A decimal number without sign: its digits, and how many of them stand after the point.
pub(super) fn decimal(text: &str) -> Option<(i64, u32)> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let all = whole.len() + fraction.len();
    let fits = !whole.is_empty() && fraction.is_empty() != text.contains('.') && all <= MOST_DIGITS;
    let digits = fits.then(|| format!("{whole}{fraction}").parse().ok())??;
    Some((digits, u32::try_from(fraction.len()).ok()?))
}
