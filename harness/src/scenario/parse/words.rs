//! What stands in several kinds of lines: words of a list, drives, cells.

use crate::scenario::expression;
use crate::scenario::problem::{Problem, Spanned};
use crate::scenario::scanner::Scanner;
use crate::scenario::syntax::Drives;
use harness_proto::nd21::cells;

/// Reads one of a list of words.
pub(super) fn named<T: Copy>(
    scanner: &mut Scanner<'_>,
    names: &[(&str, T)],
    what: &str,
) -> Result<T, Problem> {
    let known: Vec<_> = names.iter().map(|(name, _)| *name).collect();
    let before = scanner.clone();
    let Some(word) = scanner.word() else {
        return Err(scanner.unexpected(&format!("{what} ({})", known.join(", "))));
    };
    match names.iter().find(|(name, _)| *name == word.value) {
        Some((_, value)) => Ok(*value),
        None => {
            *scanner = before;
            Err(scanner
                .unexpected(&format!("{what} ({})", known.join(", ")))
                .did_you_mean(word.value, &known))
        }
    }
}

/// `95..99`, `N-1`, `2:0..last`.
pub(super) fn drives(scanner: &mut Scanner<'_>) -> Result<Drives, Problem> {
    let ring = ring_prefix(scanner);
    let from = expression::sum(scanner)?;
    let to = if scanner.eat("..") {
        Some(expression::sum(scanner)?)
    } else {
        None
    };
    Ok(Drives { ring, from, to })
}

/// `2:` in front of a drive or a link of the second ring. The colon of `drive 2: off` is another one:
/// no number follows it.
pub(super) fn ring_prefix(scanner: &mut Scanner<'_>) -> usize {
    let rest = scanner.rest();
    let behind = |prefix| rest.strip_prefix(prefix).unwrap_or_default();
    let number = |text: &str| {
        text.starts_with(|c: char| c.is_ascii_digit() || c == 'N' || c == '(')
            || text.starts_with("last")
            || text.starts_with("master")
    };
    if number(behind("2:")) {
        scanner.eat("2:");
        return 1;
    }
    if number(behind("1:")) {
        scanner.eat("1:");
    }
    0
}

pub(super) fn equals(scanner: &mut Scanner<'_>) -> Result<(), Problem> {
    if scanner.eat("=") {
        Ok(())
    } else {
        Err(scanner.unexpected("`=`"))
    }
}

/// A cell: four hexadecimal digits, or its printed name (ND21 14.2.1).
pub(super) fn address(scanner: &mut Scanner<'_>) -> Result<Spanned<u16>, Problem> {
    let before = scanner.clone();
    let Some(word) = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '_') else {
        return Err(scanner.unexpected("an address of four hexadecimal digits (such as FE13)"));
    };
    let span = word.span;
    if let Some(cell) = cells::cell(word.value) {
        return Ok(Spanned {
            value: cell.address,
            span,
        });
    }
    match u16::from_str_radix(word.value, 16) {
        Ok(value) if word.value.len() == 4 => Ok(Spanned { value, span }),
        _ => {
            *scanner = before;
            let names: Vec<_> = cells::RAM.iter().map(|cell| cell.printed).collect();
            let problem = scanner
                .unexpected("an address of four hexadecimal digits (such as FE13) or a cell's name")
                .help("`drivebench cells` shows the names of the cells (ND21 14.2.1)");
            Err(problem.did_you_mean(word.value, &names))
        }
    }
}
