//! Cells by name or address, and their values: bytes, or a number with a unit.

use super::words::equals;
use crate::language::scale::dimension_of;
use crate::language::syntax::{CellCheck, CellPlace, Relation, Written};
use harness_bench::scenario::pattern::{self, Pattern};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::quantity::{self, Tolerance};
use harness_bench::scenario::scanner::Scanner;
use harness_proto::nd21::cells::{self, Cell};
use harness_proto::nd21::eeprom;
use harness_proto::nd21::units::Scale;

/// Another name of `umdrist` and what stands behind it: the actual position.
const POSITION: (&str, &str) = ("position", "umdrist");

/// What may follow a value.
const BEHIND: [&str; 3] = ["+-", "±", "within"];

/// Every name of a RAM cell.
pub(crate) fn cell_names() -> impl Iterator<Item = &'static str> {
    let printed = cells::RAM.iter().map(|cell| cell.printed);
    printed.chain([POSITION.0])
}

/// A RAM cell by its printed name (ND21 14.2.1), which may have blanks and signs in it; `None` where no
/// name comes next.
pub(crate) fn cell_by_name(scanner: &mut Scanner<'_>) -> Option<CellPlace> {
    let alias = cells::cell(POSITION.1).map(|cell| (POSITION.0, cell));
    let printed = cells::RAM.iter().map(|cell| (cell.printed, cell));
    named(scanner, printed.chain(alias))
}

fn named(
    scanner: &mut Scanner<'_>,
    names: impl Iterator<Item = (&'static str, &'static Cell)>,
) -> Option<CellPlace> {
    let rest = scanner.rest();
    let comes_next = |name: &str| {
        let behind = rest.strip_prefix(name)?;
        let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        // A name that ends with a sign is at its end.
        (!behind.starts_with(part) || name.ends_with(['+', '-'])).then_some(())
    };
    let (name, cell) = names
        .filter(|(name, _)| !matches!(*name, "" | "reserviert") && comes_next(name).is_some())
        .max_by_key(|(name, _)| name.len())?;
    let here = scanner.here();
    scanner.eat(name);
    Some(CellPlace {
        name: name.to_owned(),
        address: cell.address,
        offset: None,
        cell: Some(cell),
        named: true,
        span: scanner.since(here),
    })
}

/// A cell: four hexadecimal digits, or its printed name.
pub(crate) fn place(scanner: &mut Scanner<'_>) -> Result<CellPlace, Problem> {
    if let Some(place) = cell_by_name(scanner) {
        return Ok(place);
    }
    let before = scanner.clone();
    let Some(word) = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '_') else {
        return Err(scanner.unexpected("an address of four hexadecimal digits (such as FE13)"));
    };
    match u16::from_str_radix(word.value, 16) {
        Ok(address) if word.value.len() == 4 => Ok(CellPlace {
            name: word.value.to_owned(),
            address,
            offset: None,
            cell: cells::cell_at(address).filter(|cell| cell.address == address),
            named: false,
            span: word.span,
        }),
        _ => {
            *scanner = before;
            let names: Vec<_> = cell_names().collect();
            let problem = scanner
                .unexpected("an address of four hexadecimal digits (such as FE13) or a cell's name")
                .help("`drivebench cells` shows the names of the cells (ND21 14.2.1)");
            Err(problem.did_you_mean(word.value, &names))
        }
    }
}

/// An EEPROM cell: two hexadecimal digits, its printed name, or the name of the RAM cell that is loaded
/// from it (ND21 14.2.2).
pub(crate) fn eeprom_place(scanner: &mut Scanner<'_>) -> Result<CellPlace, Problem> {
    let cells = eeprom::EEPROM.iter().map(|cell| (cell.printed, cell));
    if let Some(place) = named(scanner, cells) {
        return Ok(place);
    }
    if let Some(place) = cell_by_name(scanner) {
        let Some(address) = eeprom::eeprom_of(place.address) else {
            return Err(Problem::new(
                place.span,
                format!("`{}` is not loaded from the EEPROM", place.name),
                "a cell of the EEPROM expected here (ND21 14.2.2)",
            )
            .help(format!("`memory {} = ...` sets the RAM", place.name)));
        };
        return Ok(CellPlace {
            address: u16::from(address),
            ..place
        });
    }
    let before = scanner.clone();
    let word = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '_');
    match word
        .as_ref()
        .map(|w| (w.value.len(), u8::from_str_radix(w.value, 16)))
    {
        Some((2, Ok(address))) => {
            let cell = eeprom::cell_at(address);
            Ok(CellPlace {
                name: format!("{address:02X}"),
                address: u16::from(address),
                offset: None,
                cell: cell.filter(|cell| cell.address == u16::from(address)),
                named: false,
                span: scanner.since(before.clone().here()),
            })
        }
        _ => {
            *scanner = before;
            let names: Vec<_> = eeprom::EEPROM
                .iter()
                .map(|cell| cell.printed)
                .chain(cell_names())
                .filter(|name| !name.is_empty())
                .collect();
            let found = word.map_or("", |word| word.value);
            Err(scanner
                .unexpected(
                    "an EEPROM address of two hexadecimal digits (such as 47) or a cell's name",
                )
                .help("`drivebench cells --eeprom` shows the names of the cells (ND21 14.2.2)")
                .did_you_mean(found, &names))
        }
    }
}

/// `= VALUE`
pub(crate) fn assigned(scanner: &mut Scanner<'_>, place: &CellPlace) -> Result<Written, Problem> {
    equals(scanner)?;
    value(scanner, place.scale(), place)
}

/// Bytes up to what may follow a value.
pub(crate) fn bytes(scanner: &mut Scanner<'_>) -> Result<Pattern, Problem> {
    let mut part = scanner.before(&BEHIND);
    let bytes = pattern::pattern(&mut part)?;
    scanner.go_on(&part);
    Ok(bytes)
}

/// Bytes, a number with a unit, or `off`, as it fits the cell.
pub(crate) fn value(
    scanner: &mut Scanner<'_>,
    scale: Option<Scale>,
    place: &CellPlace,
) -> Result<Written, Problem> {
    let here = scanner.here();
    if matches!(scale, Some(Scale::Ramp | Scale::SlippingError)) && scanner.eat_word("off") {
        return Ok(Written::Off(scanner.since(here)));
    }
    let dimension = scale.and_then(dimension_of);
    if let Some((digits, unit)) = quantity::ambiguous(scanner)
        && place.named
        && dimension == Some(unit.dimension())
    {
        let both = format!("{digits}{}", unit.name);
        let problem = Problem::new(
            scanner.chunk().span,
            format!("`{both}` can be bytes or a number with a unit"),
            "one of the two expected here",
        );
        let help = format!(
            "write `{digits} {}` for the number with its unit, `[{both}]` for the bytes",
            unit.name
        );
        return Err(problem.help(help));
    }
    if !quantity::ahead(scanner) {
        let digits = scanner.clone().chunk().value;
        let or_number = |problem: Problem| match dimension {
            Some(dimension) if !digits.is_empty() && digits.bytes().all(|d| d.is_ascii_digit()) => {
                problem.or(&format!("`{digits}{}`", dimension.unit()))
            }
            _ => problem,
        };
        return bytes(scanner).map(Written::Bytes).map_err(or_number);
    }
    let quantity = quantity::quantity(scanner, dimension)?;
    match dimension {
        Some(_) => Ok(Written::Number(quantity)),
        None => Err(Problem::new(
            quantity.span,
            match place.cell {
                Some(cell) => format!("the manual gives no unit for `{}`", cell.printed),
                None => format!("no cell begins at {}", place.name),
            },
            "bytes expected here",
        )),
    }
}

/// `+-1%`, `+-10rpm` behind a number with a unit.
pub(crate) fn tolerance(
    scanner: &mut Scanner<'_>,
    value: &Written,
) -> Result<Option<Tolerance>, Problem> {
    if let Written::Number(number) = value {
        return quantity::tolerance(scanner, number.unit.dimension());
    }
    let mut ahead = scanner.clone();
    if quantity::plus_minus(&mut ahead) {
        return Err(Problem::new(
            scanner.here(),
            "a tolerance follows bytes",
            "a tolerance is allowed after a number with a unit",
        ));
    }
    Ok(None)
}

/// What follows a cell's name in a check: `= 1500rpm +-1%`, `& E0 = 00`, `< 100rpm`.
pub(crate) fn cell_check(
    scanner: &mut Scanner<'_>,
    place: CellPlace,
) -> Result<CellCheck, Problem> {
    let mask = if scanner.eat("&") {
        let mut part = scanner.before(&["=", "<", ">"]);
        let mask = pattern::pattern(&mut part)?;
        scanner.go_on(&part);
        Some(mask)
    } else {
        None
    };
    let here = scanner.here();
    let relation = Relation::NAMES
        .into_iter()
        .find(|(token, _)| scanner.eat(token))
        .map(|(_, relation)| relation);
    let relation =
        relation.ok_or_else(|| scanner.unexpected("`=`, `<`, `>`, `<=`, `>=` or `&`"))?;
    if mask.is_some() && relation != Relation::Equal {
        return Err(Problem::new(
            here,
            "bits are compared",
            "`=` expected here: bits are equal or not",
        ));
    }
    let value = match &mask {
        Some(_) => Written::Bytes(bytes(scanner)?),
        None => value(scanner, place.scale(), &place)?,
    };
    if let Written::Off(span) = value
        && relation != Relation::Equal
    {
        return Err(Problem::new(
            span,
            "`off` is not a number",
            "a number with a unit expected here",
        ));
    }
    let tolerance = match relation {
        Relation::Equal => tolerance(scanner, &value)?,
        _ => None,
    };
    Ok(CellCheck {
        place,
        mask,
        relation,
        value,
        tolerance,
    })
}
