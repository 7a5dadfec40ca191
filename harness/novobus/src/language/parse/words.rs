//! What stands in several kinds of lines: words of a list, drives.

use super::super::syntax::DriveRange;
use harness_bench::scenario::expression;
pub(crate) use harness_bench::scenario::parse::words::{equals, named, required};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_sim::novobus::deviation::{DEVIATIONS, MASTER_DEVIATIONS, deviation};
use harness_sim::novobus::deviation::{Deviation, MasterDeviation};

/// The name of a deviation of a drive.
pub(crate) fn deviates(scanner: &mut Scanner<'_>) -> Result<&'static Deviation, Problem> {
    let others = MASTER_DEVIATIONS.names();
    let other = ("a drive", "a master", "`master deviates NAME`");
    one_of(scanner, deviation, &DEVIATIONS.names(), &others, other)
}

/// The name of a deviation of the master.
pub(crate) fn master_deviates(
    scanner: &mut Scanner<'_>,
) -> Result<&'static MasterDeviation, Problem> {
    let (names, others) = (MASTER_DEVIATIONS.names(), DEVIATIONS.names());
    let other = ("a master", "a drive", "`drive 2 deviates NAME`");
    let find = |name: &str| MASTER_DEVIATIONS.named(name);
    one_of(scanner, find, &names, &others, other)
}

/// Reads a name that `find` knows; `others` are names of the other end of the ring.
fn one_of<T>(
    scanner: &mut Scanner<'_>,
    find: impl Fn(&str) -> Option<T>,
    names: &[&str],
    others: &[&str],
    (whose, other, line): (&str, &str, &str),
) -> Result<T, Problem> {
    let before = scanner.clone();
    let word = scanner.word().map_or("", |word| word.value);
    find(word).ok_or_else(|| {
        *scanner = before;
        let expected =
            format!("the name of a deviation of {whose} (`drivebench deviations` lists them)");
        let problem = scanner.unexpected(&expected);
        match others.contains(&word) {
            true => problem.help(format!("{word} is a deviation of {other}: {line}")),
            false => problem.did_you_mean(word, names),
        }
    })
}

/// `95..99`, `N-1`, `2:0..last`.
pub(crate) fn drives(scanner: &mut Scanner<'_>) -> Result<DriveRange, Problem> {
    let ring = ring_prefix(scanner);
    let from = expression::sum(scanner)?;
    let to = if scanner.eat("..") {
        Some(expression::sum(scanner)?)
    } else {
        None
    };
    Ok(DriveRange { ring, from, to })
}

/// `2:` in front of a drive or a link of the second ring. The colon of `drive 2: off` is another one:
/// no number follows it.
pub(crate) fn ring_prefix(scanner: &mut Scanner<'_>) -> usize {
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
