//! Steps: a time or none, then `>`, `<`, `!`, `?` or a job.

use super::words::required;
use crate::scenario::expression::{self, Counter};
use crate::scenario::language::{Language, Opening};
use crate::scenario::problem::{Problem, TextSpan, nearest};
use crate::scenario::scanner::Scanner;
use crate::scenario::syntax::{Action, Step, When};
use crate::scenario::times;

/// What a line must be.
const EXPECTED: &str = "a step (`>`, `<`, `!`, `?` or a job) or a header line";

/// Reads a step.
pub fn step<L: Language>(scanner: &mut Scanner<'_>) -> Result<Step<L>, Problem> {
    let start = scanner.here();
    let when = if scanner.eat("+") {
        When::After(times::window(scanner)?)
    } else if scanner.eat("@") {
        When::At(times::window(scanner)?)
    } else {
        When::Now
    };
    let action = action(scanner)?;
    scanner.expect_end()?;
    let window = match when {
        When::Now => None,
        When::After(window) | When::At(window) => Some(window),
    };
    if let Some(window) = window.filter(|window| !window.is_exact())
        && !matches!(action, Action::Receive { .. })
    {
        return Err(Problem::new(
            window.from.span().to(window.to.span()),
            "a time window is only allowed before a line that waits for a byte",
            "one time expected here; a window is allowed before `<`",
        ));
    }
    Ok(Step {
        when,
        action,
        span: scanner.since(start),
    })
}

fn action<L: Language>(scanner: &mut Scanner<'_>) -> Result<Action<L>, Problem> {
    let rest = scanner.rest();
    let mut port = 0;
    if rest.starts_with("2>") || rest.starts_with("2<") {
        scanner.eat("2");
        port = 1;
    } else if rest.starts_with("1>") || rest.starts_with("1<") {
        scanner.eat("1");
    }
    match scanner.peek() {
        Some('>') => {
            scanner.eat(">");
            let message = L::message(scanner)?;
            Ok(Action::Send { port, message })
        }
        Some('<') => {
            scanner.eat("<");
            let message = L::message(scanner)?;
            Ok(Action::Receive { port, message })
        }
        Some('!') => {
            scanner.eat("!");
            bus_step(Opening::Fault, scanner)
        }
        Some('?') => {
            scanner.eat("?");
            bus_step(Opening::Check, scanner)
        }
        _ => word_action(scanner),
    }
}

/// What follows a symbol of which every bus says what it means.
fn bus_step<L: Language>(
    opening: Opening<'_>,
    scanner: &mut Scanner<'_>,
) -> Result<Action<L>, Problem> {
    let step = L::step(opening, scanner);
    step.unwrap_or_else(|| Err(scanner.unexpected(EXPECTED)))
        .map(Action::Own)
}

/// A step that begins with a word.
fn word_action<L: Language>(scanner: &mut Scanner<'_>) -> Result<Action<L>, Problem> {
    let mut ahead = scanner.clone();
    let Some(word) = ahead.word() else {
        return Err(scanner.unexpected(EXPECTED));
    };
    let action = match word.value {
        "wait" => Action::Wait(times::duration(&mut ahead)?),
        "for" => begin_loop(&mut ahead)?,
        "end" => Action::End,
        name => match L::step(Opening::Word(&word), &mut ahead) {
            Some(step) => Action::Own(step?),
            None => return Err(unknown::<L>(name, scanner)),
        },
    };
    *scanner = ahead;
    Ok(action)
}

/// A word with which no line begins.
fn unknown<L: Language>(word: &str, scanner: &mut Scanner<'_>) -> Problem {
    let (jobs, others) = L::step_words();
    let mut known = jobs.clone();
    known.extend(super::header::WORDS);
    known.extend(L::header_words());
    known.extend(others);
    known.extend(["wait", "for", "end"]);
    let problem = scanner.unexpected(EXPECTED);
    match nearest(word, &known) {
        Some(near) => problem.help(format!("did you mean `{near}`?")),
        None => problem.help(format!(
            "jobs are {}; other steps are {}, wait",
            jobs.join(", "),
            others.join(", ")
        )),
    }
}

/// `k in 0..last`
fn begin_loop<L: Language>(scanner: &mut Scanner<'_>) -> Result<Action<L>, Problem> {
    let before = scanner.clone();
    let name = scanner.take_while(|c| c.is_ascii_alphanumeric());
    let Some(counter) = name.and_then(|name| Counter::named(name.value)) else {
        *scanner = before;
        return Err(scanner.unexpected("the counter of the loop, a letter from `a` to `z`"));
    };
    required(scanner, &["in"])?;
    let from = expression::sum(scanner)?;
    if !scanner.eat("..") {
        return Err(scanner.unexpected("`..` and the last number, as in `for k in 0..last`"));
    }
    Ok(Action::For(counter, from, expression::sum(scanner)?))
}

/// A header line among the steps.
pub fn behind_the_first(span: TextSpan, word: &str) -> Problem {
    Problem::new(
        span,
        format!("`{word}` comes after the first step"),
        "header lines come before all steps",
    )
}

/// A header line of one word and its value among the steps.
pub fn header_too_late(span: TextSpan, word: &str) -> Problem {
    let help = format!("move the line up, above the first step (line `{word}`)");
    behind_the_first(span, word).help(help)
}
