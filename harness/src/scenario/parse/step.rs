//! Steps: a time or none, then `>`, `<`, `!`, `?` or a job.

use super::check;
use super::drive::{self, DriveLine};
use super::job;
use super::place as cell;
use super::words::{drives, named, required, ring_prefix};
use crate::scenario::expression::{self, Counter, Located};
use crate::scenario::pattern;
use crate::scenario::problem::{Problem, Span, nearest};
use crate::scenario::scanner::Scanner;
use crate::scenario::syntax::{
    Action, Check, DriveCheck, Drives, Fault, FaultKind, LinkEnds, LinkFaultKind, Looks, Recording,
    SetupKind, Step, When,
};
use crate::scenario::times;
use harness_sim::fault::{DriveFault, Flips};

/// Reads a step.
pub(crate) fn step(scanner: &mut Scanner<'_>) -> Result<Step, Problem> {
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
            "a window of time stands before a line that does not wait for a byte",
            "one time expected here; a window can stand before `<`",
        ));
    }
    Ok(Step {
        when,
        action,
        span: scanner.since(start),
    })
}

fn action(scanner: &mut Scanner<'_>) -> Result<Action, Problem> {
    let rest = scanner.rest();
    let mut ring = 0;
    if rest.starts_with("2>") || rest.starts_with("2<") {
        scanner.eat("2");
        ring = 1;
    } else if rest.starts_with("1>") || rest.starts_with("1<") {
        scanner.eat("1");
    }
    match scanner.peek() {
        Some('>') => {
            scanner.eat(">");
            let bytes = pattern::pattern(scanner)?;
            Ok(Action::Send { ring, bytes })
        }
        Some('<') => {
            scanner.eat("<");
            let bytes = pattern::pattern(scanner)?;
            Ok(Action::Receive { ring, bytes })
        }
        Some('!') => {
            scanner.eat("!");
            Ok(Action::Fault(fault(scanner)?))
        }
        Some('?') => {
            scanner.eat("?");
            Ok(Action::Check(check::check(scanner)?))
        }
        _ => word_action(scanner),
    }
}

/// A step that begins with a word.
fn word_action(scanner: &mut Scanner<'_>) -> Result<Action, Problem> {
    let here = scanner.here();
    let mut ahead = scanner.clone();
    let word = ahead.word().map_or("", |word| word.value);
    let action = match word {
        "until" => until(&mut ahead)?,
        "wait" => Action::Wait(times::duration(&mut ahead)?),
        "for" => begin_loop(&mut ahead)?,
        "end" => Action::End,
        "record" => Action::Record(record(&mut ahead)?),
        word if drive::WORDS.contains(&word) => {
            let (drives, line) = drive::line(&mut ahead)?;
            drive_action(drives, line, ahead.since(here))?
        }
        _ => return job_action(scanner),
    };
    *scanner = ahead;
    Ok(action)
}

/// `k in 0..last`
fn begin_loop(scanner: &mut Scanner<'_>) -> Result<Action, Problem> {
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

/// A line that begins with `drive`, as a step.
pub(crate) fn drive_action(drives: Drives, line: DriveLine, span: Span) -> Result<Action, Problem> {
    match line {
        DriveLine::Setup(what) => Err(not_a_step(span, &what)),
        DriveLine::Influence(influence) => Ok(Action::Influence(drives, influence)),
        DriveLine::Condition(condition) => Ok(Action::Check(Check::Drive(DriveCheck {
            drives,
            condition,
            span,
        }))),
    }
}

/// A header line among the steps.
pub(crate) fn behind_the_first(span: Span, word: &str) -> Problem {
    Problem::new(
        span,
        format!("`{word}` stands behind the first step"),
        "header lines come before all steps",
    )
}

/// A header line of one word and its value among the steps.
pub(crate) fn header_too_late(span: Span, word: &str) -> Problem {
    let help = format!("move the line up, above the first step (line `{word}`)");
    behind_the_first(span, word).help(help)
}

/// What a drive is set to hold or to be, among the steps.
pub(crate) fn not_a_step(span: Span, what: &SetupKind) -> Problem {
    let help = match what {
        SetupKind::Memory(..) => {
            "move the line up, above the first step; `? drive ...` checks cells, `write-byte` writes one"
        }
        _ => "move the line up, above the first step (line `drive`)",
    };
    behind_the_first(span, "drive").help(help)
}

/// `until drive 3 ps_status = 01 within 2s`
fn until(scanner: &mut Scanner<'_>) -> Result<Action, Problem> {
    required(scanner, &drive::WORDS)?;
    let check = drive::check(scanner)?;
    if !scanner.eat_word("within") {
        return Err(scanner.unexpected("`within` and the longest time, as in `within 2s`"));
    }
    Ok(Action::Until(check, times::duration(scanner)?))
}

/// `record drive 0 nist every 10ms`
fn record(scanner: &mut Scanner<'_>) -> Result<Recording, Problem> {
    required(scanner, &drive::WORDS)?;
    let drives = drives(scanner)?;
    let place = cell(scanner)?;
    let names = [("every", 0), ("changes", 1), ("off", 2)];
    let looks = match named(scanner, &names, "when to look at it")? {
        0 => Looks::Every(times::duration(scanner)?),
        1 => Looks::Changes,
        _ => Looks::Off,
    };
    Ok(Recording {
        drives,
        place,
        looks,
    })
}

fn job_action(scanner: &mut Scanner<'_>) -> Result<Action, Problem> {
    let mut ahead = scanner.clone();
    let expected = "a step (`>`, `<`, `!`, `?` or a job) or a header line";
    let Some(name) = ahead.word() else {
        return Err(scanner.unexpected(expected));
    };
    match job::job(name.value, &mut ahead) {
        Some(job) => {
            *scanner = ahead;
            Ok(Action::Job(job?))
        }
        None => {
            let mut known = job::names();
            known.extend(super::header::WORDS);
            known.extend(super::bus_header::WORDS);
            known.extend(["until", "wait", "record", "for", "end"]);
            let problem = scanner.unexpected(expected);
            Err(match nearest(name.value, &known) {
                Some(near) => problem.help(format!("did you mean `{near}`?")),
                None => problem.help(format!(
                    "jobs are {}; other steps are drive, until, wait, record",
                    job::names().join(", ")
                )),
            })
        }
    }
}

fn fault(scanner: &mut Scanner<'_>) -> Result<Fault, Problem> {
    if scanner.eat_word("drive") {
        let ring = ring_prefix(scanner);
        let drive = expression::sum(scanner)?;
        let (byte, at) = place(scanner)?;
        let what = drive_fault(scanner, drive)?;
        return Ok(Fault {
            ring,
            what,
            byte,
            at,
        });
    }
    let (ring, link, ends) = link(scanner)?;
    let (byte, at) = place(scanner)?;
    let kind = link_fault(scanner)?;
    Ok(Fault {
        ring,
        what: FaultKind::Link(link, ends, kind),
        byte,
        at,
    })
}

/// A link by its two ends: its ring, where it stands, and the ends.
pub(crate) fn link(scanner: &mut Scanner<'_>) -> Result<(usize, Located, LinkEnds), Problem> {
    let here = scanner.here();
    let ring = ring_prefix(scanner);
    let from = end(scanner)?;
    if !scanner.eat("->") {
        return Err(scanner.unexpected("`->`, as in 98->97"));
    }
    let to = end(scanner)?;
    let place = Located {
        span: scanner.since(here),
        ..Located::number(0)
    };
    Ok((ring, place, LinkEnds { from, to }))
}

/// An end of a link: a drive, or `master` (`None`).
fn end(scanner: &mut Scanner<'_>) -> Result<Option<Located>, Problem> {
    let mut ahead = scanner.clone();
    let letters = ahead.take_while(|c| c.is_ascii_alphabetic());
    match letters.map(|word| word.value) {
        Some("master") => {
            *scanner = ahead;
            Ok(None)
        }
        Some(other) if !matches!(other, "N" | "last") => Err(scanner
            .unexpected("`master` or a drive's number")
            .did_you_mean(other, &["master", "last"])),
        _ => Ok(Some(expression::sum(scanner)?)),
    }
}

/// `byte n`, `from byte n`, `@20ms`, `from 20ms`, or nothing, and a colon.
fn place(scanner: &mut Scanner<'_>) -> Result<(Option<Located>, Option<times::Duration>), Problem> {
    let mut byte = None;
    let mut at = None;
    let from = scanner.eat_word("from");
    if scanner.eat_word("byte") {
        byte = Some(expression::sum(scanner)?);
    } else if scanner.eat("@") || from {
        at = Some(times::duration(scanner)?);
    }
    scanner.eat(":");
    Ok((byte, at))
}

fn drive_fault(scanner: &mut Scanner<'_>, drive: Located) -> Result<FaultKind, Problem> {
    let names = [
        ("off", 0),
        ("on", 1),
        ("stuck", 2),
        ("unstuck", 3),
        ("error", 4),
    ];
    let fault = match named(scanner, &names, "a fault of a drive")? {
        0 => DriveFault::Off,
        1 => DriveFault::On,
        2 => DriveFault::Stuck(byte(scanner)?),
        3 => DriveFault::Unstuck,
        _ => return Ok(FaultKind::Error(drive, drive::error(scanner)?)),
    };
    Ok(FaultKind::Drive(drive, fault))
}

fn link_fault(scanner: &mut Scanner<'_>) -> Result<LinkFaultKind, Problem> {
    let names = [
        ("flip", 0),
        ("replace", 1),
        ("drop", 2),
        ("duplicate", 3),
        ("insert", 4),
        ("delay", 5),
        ("break", 6),
        ("overrun", 7),
        ("cut", 8),
        ("join", 9),
    ];
    Ok(match named(scanner, &names, "a fault of a link")? {
        0 => LinkFaultKind::Flip(flips(scanner)?),
        1 => LinkFaultKind::Replace(byte(scanner)?),
        2 => LinkFaultKind::Drop,
        3 => LinkFaultKind::Duplicate,
        4 => LinkFaultKind::Insert(byte(scanner)?),
        5 => LinkFaultKind::Delay(times::duration(scanner)?),
        6 => LinkFaultKind::Break(times::duration(scanner)?),
        7 => LinkFaultKind::Overrun,
        8 => LinkFaultKind::Cut,
        _ => LinkFaultKind::Join,
    })
}

/// Bits 0 to 7, `p`, `s` and `b`.
fn flips(scanner: &mut Scanner<'_>) -> Result<Flips, Problem> {
    let expected = "a bit: 0 to 7, p (parity), s (stop) or b (start)";
    let mut flips = Flips::default();
    if scanner.at_end() {
        return Err(scanner.unexpected(expected));
    }
    while !scanner.at_end() {
        let bit = scanner.peek();
        let known = match bit {
            Some('p') => Flips {
                parity: true,
                ..Flips::default()
            },
            Some('s') => Flips {
                stop: true,
                ..Flips::default()
            },
            Some('b') => Flips {
                start: true,
                ..Flips::default()
            },
            Some(digit @ '0'..='7') => Flips {
                data: 1 << digit.to_digit(8).unwrap_or(0),
                ..Flips::default()
            },
            _ => return Err(scanner.unexpected(expected)),
        };
        if flips.and(known) != merge(flips, known) {
            let here = scanner.here();
            return Err(Problem::new(
                here,
                "a bit that is flipped twice is not flipped",
                "each bit once",
            ));
        }
        flips = flips.and(known);
        let mut ahead = scanner.clone();
        if ahead.chunk().value.trim_end_matches(',').len() != 1 {
            return Err(scanner.unexpected(expected));
        }
        *scanner = ahead;
    }
    Ok(flips)
}

fn merge(a: Flips, b: Flips) -> Flips {
    Flips {
        data: a.data | b.data,
        parity: a.parity | b.parity,
        stop: a.stop | b.stop,
        start: a.start | b.start,
    }
}

fn byte(scanner: &mut Scanner<'_>) -> Result<u8, Problem> {
    let before = scanner.clone();
    let word = scanner.take_while(|c| c.is_ascii_alphanumeric());
    match word.map(|word| (word.value.len(), u8::from_str_radix(word.value, 16))) {
        Some((2, Ok(byte))) => Ok(byte),
        _ => {
            *scanner = before;
            Err(scanner.unexpected("a byte of two hexadecimal digits"))
        }
    }
}
