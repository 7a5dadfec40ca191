//! Cells and their values.

use super::named;
use crate::language::syntax::{CellCheck, CellPlace, Relation, Written};
use harness_bench::scenario::pattern::Pattern;
use harness_bench::scenario::quantity::{self, Tolerance};
use harness_bench::scenario::scanner::Scanner;

/// `FE13`, `nist`, `FE10+i`
pub(super) fn place(place: &CellPlace) -> String {
    match &place.offset {
        None => place.name.clone(),
        Some(offset) => format!("{}+{offset}", place.name),
    }
}

/// Bytes, a number with its unit, or `off`.
pub(super) fn value(value: &Written) -> String {
    match value {
        Written::Bytes(pattern) => bytes(pattern),
        Written::Number(number) => number.written(),
        Written::Off(_) => "off".to_owned(),
    }
}

/// Bytes where a number may stand too: in brackets if they could be read as one.
fn bytes(pattern: &Pattern) -> String {
    let text = pattern.to_string();
    match quantity::ambiguous(&Scanner::new(&text, 0)) {
        Some(_) => format!("[{text}]"),
        None => text,
    }
}

/// A value with ` +-` and its tolerance.
pub(super) fn tolerated(text: String, tolerance: Option<&Tolerance>) -> String {
    match tolerance {
        None => text,
        Some(tolerance) => format!("{text} {}", tolerance.written()),
    }
}

/// `nist = 1500rpm +-1%`, `Flags2 & E0 = 00`
pub(super) fn check(check: &CellCheck) -> String {
    let mask = match &check.mask {
        None => String::new(),
        Some(mask) => format!(" & {mask}"),
    };
    let sign = named(&Relation::NAMES, check.relation);
    let text = format!(
        "{}{mask} {sign} {}",
        place(&check.place),
        value(&check.value)
    );
    tolerated(text, check.tolerance.as_ref())
}
