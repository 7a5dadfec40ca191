//! Lines that begin with `slave`.

use super::super::syntax::{Outside, SetupKind, TelegramStep};
use super::value;
use harness_bench::scenario::expression::{self, Located};
use harness_bench::scenario::parse::words::{deviation, named, required};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::Properties;
use harness_proto::nordac::properties::{Choices, NordacProperty, PROPERTIES};
use harness_sim::nordac::deviation::DEVIATIONS;

pub(super) enum ParsedSlaveLine {
    /// A header line.
    Setup(SetupKind),
    /// A step.
    Outside(Outside),
}

#[derive(Clone, Copy)]
enum Word {
    Ppo,
    Posicon,
    Property,
    Parameter,
    Deviates,
    Link,
    Fault,
    Restart,
}

const WORDS: [(&str, Word); 8] = [
    ("ppo", Word::Ppo),
    ("posicon", Word::Posicon),
    ("parameter", Word::Parameter),
    ("property", Word::Property),
    ("deviates", Word::Deviates),
    ("link", Word::Link),
    ("fault", Word::Fault),
    ("restart", Word::Restart),
];

/// Reads what stands after `slave`.
pub(super) fn line(scanner: &mut Scanner<'_>) -> Result<(Located, ParsedSlaveLine), Problem> {
    let slave = expression::sum(scanner)?;
    let before = scanner.clone();
    if scanner.at_end() {
        return Ok((slave, ParsedSlaveLine::Setup(there(scanner)?)));
    }
    let line = match named(scanner, &WORDS, "what the line says of the slave")? {
        Word::Ppo | Word::Posicon => {
            *scanner = before;
            ParsedSlaveLine::Setup(there(scanner)?)
        }
        Word::Property => ParsedSlaveLine::Setup(property(scanner)?),
        Word::Parameter => {
            let (name, value) = value::assigned(scanner)?;
            ParsedSlaveLine::Setup(SetupKind::Parameter(name, value))
        }
        Word::Deviates => {
            let known = deviation(scanner, &DEVIATIONS, "a slave", "`slave 8 deviates NAME`")?;
            ParsedSlaveLine::Setup(SetupKind::Deviates(known))
        }
        Word::Link => {
            let ends = [("lost", false), ("found", true)];
            let found = named(scanner, &ends, "what becomes of the link")?;
            ParsedSlaveLine::Outside(Outside::Link(found))
        }
        Word::Fault => {
            let digit = scanner
                .peek()
                .is_some_and(|c| c.is_ascii_digit() || c == '(');
            let number = digit.then(|| expression::sum(scanner)).transpose()?;
            let levels = [("on", true), ("off", false)];
            let on = named(scanner, &levels, "whether the cause is there")?;
            ParsedSlaveLine::Outside(Outside::Fault { number, on })
        }
        Word::Restart => ParsedSlaveLine::Outside(Outside::Restart),
    };
    Ok((slave, line))
}

/// A line that begins with `slave`, as a step.
pub(super) fn step(scanner: &mut Scanner<'_>) -> Result<TelegramStep, Problem> {
    let before = scanner.clone();
    let (slave, line) = line(scanner)?;
    match line {
        ParsedSlaveLine::Outside(outside) => Ok(TelegramStep::Outside(slave, outside)),
        // A time stands in front of it.
        ParsedSlaveLine::Setup(_) => {
            *scanner = before;
            Err(scanner.unexpected("a slave and what happens to it (link, fault, restart)"))
        }
    }
}

/// `ppo 2`, `posicon`, in either order; both may be left out.
fn there(scanner: &mut Scanner<'_>) -> Result<SetupKind, Problem> {
    let (mut ppo, mut posicon) = (None, false);
    while !scanner.at_end() {
        let before = scanner.clone();
        required(scanner, &["ppo", "posicon"])?;
        let mut again = before.clone();
        let twice = match again.eat_word("ppo") {
            true => ppo.replace(ppo_type(scanner)?).is_some(),
            false => std::mem::replace(&mut posicon, true),
        };
        if twice {
            *scanner = before;
            return Err(scanner.unexpected("the end of the line (it is given twice)"));
        }
    }
    Ok(SetupKind::There { ppo, posicon })
}

/// `1` to `4`.
pub(super) fn ppo_type(scanner: &mut Scanner<'_>) -> Result<PpoType, Problem> {
    let before = scanner.clone();
    let digits = scanner.take_while(|c| c.is_ascii_alphanumeric());
    let number = digits.and_then(|digits| digits.value.parse().ok());
    let found = number.and_then(PpoType::from_number);
    found.ok_or_else(|| {
        *scanner = before;
        scanner.unexpected("a PPO type, 1 to 4")
    })
}

/// `pzd-invalid = hold`; without `=` as well.
fn property(scanner: &mut Scanner<'_>) -> Result<SetupKind, Problem> {
    let before = scanner.clone();
    // Some names begin with the number of a parameter.
    let name = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '-');
    let name = name.map_or("", |name| name.value);
    let Some(property) = NordacProperty::of(name) else {
        *scanner = before;
        let known: Vec<_> = PROPERTIES.iter().map(|property| property.name).collect();
        let problem = scanner.unexpected("a property, such as pzd-invalid");
        return Err(problem.did_you_mean(name, &known));
    };
    scanner.eat("=");
    let before = scanner.clone();
    let word = scanner.take_while(|c| c.is_ascii_alphanumeric() || "-.".contains(c));
    let word = word.map_or("", |word| word.value);
    if property.set(&mut Properties::default(), word) {
        return Ok(SetupKind::Property(property, word.to_owned()));
    }
    *scanner = before;
    Err(match property.accepts {
        Choices::Words(words) => {
            let problem = scanner.unexpected(&words.join(" or "));
            problem.did_you_mean(word, words)
        }
        Choices::Count { least, most, .. } => {
            scanner.unexpected(&format!("a number from {least} to {most}"))
        }
    })
}
