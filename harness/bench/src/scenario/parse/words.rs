//! Elements that lines of several kinds share: words of a list, signs.

use crate::scenario::problem::Problem;
use crate::scenario::scanner::Scanner;
use harness_sim::deviation::{Deviation, DeviationTable};

/// Reads one of a list of words.
pub fn named<T: Copy>(
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

/// The name of a deviation. There are too many to list them all in a message.
pub fn deviation<Injection>(
    scanner: &mut Scanner<'_>,
    table: &DeviationTable<Injection>,
    of: &str,
    line: &str,
) -> Result<&'static Deviation<Injection>, Problem> {
    let before = scanner.clone();
    let word = scanner.word().map_or("", |word| word.value);
    table.named(word).ok_or_else(|| {
        *scanner = before;
        let expected = format!("the name of a deviation of {of}, as in {line}");
        let problem = scanner.unexpected(&expected);
        problem.did_you_mean(word, &table.names())
    })
}

/// `=` must come next.
pub fn equals(scanner: &mut Scanner<'_>) -> Result<(), Problem> {
    if scanner.eat("=") {
        Ok(())
    } else {
        Err(scanner.unexpected("`=`"))
    }
}

/// One of these words must come next; the first of them is named where none does.
pub fn required(scanner: &mut Scanner<'_>, words: &[&str]) -> Result<(), Problem> {
    if words.iter().any(|word| scanner.eat_word(word)) {
        return Ok(());
    }
    let mut ahead = scanner.clone();
    let found = ahead.chunk().value;
    Err(scanner
        .unexpected(&format!("`{}`", words[0]))
        .did_you_mean(found, words))
}
