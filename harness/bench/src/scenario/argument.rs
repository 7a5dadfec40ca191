//! Numbers and times on a command line, written as in a scenario.

use super::problem::Problem;
use super::quantity::{self, Dimension, Quantity};
use super::scanner::Scanner;
use super::times;
use harness_proto::time::Span;

/// A number with a unit of this dimension.
///
/// # Errors
/// It is none, in a sentence.
pub fn number(text: &str, dimension: Dimension) -> Result<Quantity, String> {
    one(text, |scanner| quantity::quantity(scanner, Some(dimension)))
}

/// A length of time on the line: `100ms`.
///
/// # Errors
/// It is none, in a sentence.
pub fn duration(text: &str) -> Result<Span, String> {
    let found = one(text, times::duration)?;
    Ok(found.on(harness_proto::line::Rate::default().byte_time()))
}

/// Reads a text as a whole; what is wrong with it as a sentence.
fn one<T>(text: &str, read: impl Fn(&mut Scanner<'_>) -> Result<T, Problem>) -> Result<T, String> {
    let mut scanner = Scanner::new(text, 0);
    let found = read(&mut scanner).and_then(|found| scanner.expect_end().map(|()| found));
    found.map_err(|problem| problem.sentence())
}
