//! Steps of this bus that are neither checks nor jobs: faults, `drive`, `until`, `record`.

use super::drive::{self, DriveLine};
use super::value::place as cell;
use super::words::{drives, named, required, ring_prefix};
use crate::language::syntax::{
    CellRecording, Check, DriveCheck, DriveRange, FaultKind, FaultStep, LinkEnds, LinkFaultKind,
    Looks, RingStep, SetupKind,
};
use harness_bench::scenario::expression::{self, Located};
use harness_bench::scenario::language::Opening;
use harness_bench::scenario::parse::step::behind_the_first;
use harness_bench::scenario::problem::{Problem, Spanned, TextSpan};
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_sim::fault::{DriveFault, Flips};

/// Words with which steps begin that are no jobs.
pub(crate) const WORDS: [&str; 3] = ["drive", "until", "record"];

/// Reads what follows the opening of a step; `None` if there is no such word.
pub(crate) fn step(
    opening: Opening<'_>,
    scanner: &mut Scanner<'_>,
) -> Option<Result<RingStep, Problem>> {
    Some(match opening {
        Opening::Fault => fault(scanner).map(RingStep::Fault),
        Opening::Check => super::check::check(scanner).map(RingStep::Check),
        Opening::Word(word) => match word.value {
            "until" => until(scanner),
            "record" => record(scanner).map(RingStep::Record),
            name if drive::WORDS.contains(&name) => drive_step(word, scanner),
            name => return Some(super::job::job(name, scanner)?.map(RingStep::Job)),
        },
    })
}

/// A line that begins with `drive`; that `word` has just been read.
fn drive_step(word: &Spanned<&str>, scanner: &mut Scanner<'_>) -> Result<RingStep, Problem> {
    let (drives, line) = drive::line(scanner)?;
    drive_action(drives, line, scanner.since(word.span))
}

/// A line that begins with `drive`, as a step.
fn drive_action(drives: DriveRange, line: DriveLine, span: TextSpan) -> Result<RingStep, Problem> {
    match line {
        DriveLine::Setup(what) => Err(not_a_step(span, &what)),
        DriveLine::Influence(influence) => Ok(RingStep::Influence(drives, influence)),
        DriveLine::Condition(condition) => Ok(RingStep::Check(Check::Drive(DriveCheck {
            drives,
            condition,
            span,
        }))),
    }
}

/// What a drive is set to hold or to be, among the steps.
pub(crate) fn not_a_step(span: TextSpan, what: &SetupKind) -> Problem {
    let help = match what {
        SetupKind::Memory(..) => {
            "move the line up, above the first step; `? drive ...` checks cells, `write-byte` writes one"
        }
        _ => "move the line up, above the first step (line `drive`)",
    };
    behind_the_first(span, "drive").help(help)
}

/// `until drive 3 ps_status = 01 within 2s`
fn until(scanner: &mut Scanner<'_>) -> Result<RingStep, Problem> {
    required(scanner, &drive::WORDS)?;
    let check = drive::check(scanner)?;
    if !scanner.eat_word("within") {
        return Err(scanner.unexpected("`within` and the longest time, as in `within 2s`"));
    }
    Ok(RingStep::Until(check, times::duration(scanner)?))
}

/// `record drive 0 nist every 10ms`
fn record(scanner: &mut Scanner<'_>) -> Result<CellRecording, Problem> {
    required(scanner, &drive::WORDS)?;
    let drives = drives(scanner)?;
    let place = cell(scanner)?;
    let names = [("every", 0), ("changes", 1), ("off", 2)];
    let looks = match named(scanner, &names, "when to look at it")? {
        0 => Looks::Every(times::duration(scanner)?),
        1 => Looks::Changes,
        _ => Looks::Off,
    };
    Ok(CellRecording {
        drives,
        place,
        looks,
    })
}

fn fault(scanner: &mut Scanner<'_>) -> Result<FaultStep, Problem> {
    if scanner.eat_word("drive") {
        let ring = ring_prefix(scanner);
        let drive = expression::sum(scanner)?;
        let (byte, at) = place(scanner)?;
        let what = drive_fault(scanner, drive)?;
        return Ok(FaultStep {
            ring,
            what,
            byte,
            at,
        });
    }
    let (ring, link, ends) = link(scanner)?;
    let (byte, at) = place(scanner)?;
    let kind = link_fault(scanner)?;
    Ok(FaultStep {
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
                "the same bit is flipped twice",
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
