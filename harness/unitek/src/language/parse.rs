//! From text to the syntax of this bus.

mod drive;
mod job;
mod message;
mod value;

pub(super) use drive::mode_word;
pub(super) use job::NAMES;
pub(super) use message::{comment, message};
pub(super) use value::register_of_force;

use super::syntax::{DriveHarm, FrameHarm, FrameStep, Header, SetupKind};
use harness_bench::scenario::expression;
use harness_bench::scenario::language::Opening;
use harness_bench::scenario::parse::header::{deviating_master, once};
use harness_bench::scenario::parse::step::{behind_the_first, header_too_late};
use harness_bench::scenario::parse::words::{named, required};
use harness_bench::scenario::problem::{Problem, Spanned, TextSpan};
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_proto::can::BitRate;
use harness_sim::unitek::deviation::MASTER_DEVIATIONS;

/// Words with which header lines of this bus begin.
pub(super) const HEADER: [&str; 2] = ["rate", "drive"];

/// Words with which steps begin that are no jobs.
pub(super) const STEPS: [&str; 2] = ["drive", "master"];

/// Reads a line that begins with `word` as a header line; `None` if it is a step.
pub(super) fn header(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Option<Result<(), Problem>> {
    match word.value {
        "rate" if begun => Some(Err(header_too_late(word.span, word.value))),
        "rate" => Some(rate(scanner).and_then(|rate| once(&mut header.rate, rate, word))),
        "master" if scanner.clone().eat_word("deviates") => {
            Some(master(word, scanner, header, begun))
        }
        "drive" => drive_line(word, scanner, header, begun),
        _ => None,
    }
}

/// The first thing that a header lacks.
pub(super) fn incomplete(header: &Header) -> Option<Problem> {
    let what = "the scenario has no drive";
    let problem = Problem::new(TextSpan::default(), what, "a `drive` line expected");
    let help = "add a line such as `drive 1`, or `drive 3 rx 210 tx 190`";
    header.drives.is_empty().then(|| problem.help(help))
}

/// `500`, in kbit/s.
fn rate(scanner: &mut Scanner<'_>) -> Result<BitRate, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit());
    let bits = digits.and_then(|digits| digits.value.parse::<u32>().ok()?.checked_mul(1000));
    let most = BitRate::M1.bits_per_second();
    let rate = bits
        .filter(|bits| *bits <= most)
        .and_then(BitRate::from_bits_per_second);
    let Some(rate) = rate else {
        let expected = "a bit rate from 1 to 1000 kbit/s (UNITEK 3.1: 1000, 625, 500, 250, 100)";
        return Err(scanner.unexpected(expected));
    };
    ahead.eat("kbit/s");
    *scanner = ahead;
    scanner.expect_end()?;
    Ok(rate)
}

/// `master deviates NAME`
fn master(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Result<(), Problem> {
    deviating_master(word, scanner, &mut header.master, begun, &MASTER_DEVIATIONS)
}

/// A line that begins with `drive` is a header line where it can be one.
fn drive_line(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Option<Result<(), Problem>> {
    let mut ahead = scanner.clone();
    let read = drive::line(&mut ahead).and_then(|read| ahead.expect_end().map(|()| read));
    let (drive, what) = match read {
        Ok(read) => read,
        Err(problem) => return Some(Err(problem)),
    };
    let what = what.into_setup(begun)?;
    if begun {
        let problem = behind_the_first(word.span, "drive");
        let help = "move the line up, above the first step; steps are `drive 1 input`, `force`, `register` and `restart`";
        return Some(Err(problem.help(help)));
    }
    let span = ahead.since(word.span);
    *scanner = ahead;
    header
        .drives
        .push(super::syntax::DriveLine { drive, what, span });
    Some(Ok(()))
}

/// Reads what stands after the opening of a step; `None` if there is no such word.
pub(super) fn step(
    opening: Opening<'_>,
    scanner: &mut Scanner<'_>,
) -> Option<Result<FrameStep, Problem>> {
    Some(match opening {
        Opening::Fault => fault(scanner),
        Opening::Check => check(scanner),
        Opening::Word(word) => match word.value {
            "drive" => drive::step(scanner),
            "master" => job::by_driver(scanner).map(FrameStep::Master),
            name => return Some(job::job(name, scanner)?.map(FrameStep::Job)),
        },
    })
}

/// `frame 3: lost`, `drive 1: off`
fn fault(scanner: &mut Scanner<'_>) -> Result<FrameStep, Problem> {
    let places = [("frame", true), ("drive", false)];
    let of_frame = named(scanner, &places, "where the fault is")?;
    let number = expression::sum(scanner)?;
    if !scanner.eat(":") {
        return Err(scanner.unexpected("`:` and the fault, as in `! frame 3: lost`"));
    }
    if !of_frame {
        let kinds = [
            ("off", DriveHarm::Off),
            ("on", DriveHarm::On),
            ("bus-off", DriveHarm::BusOff),
        ];
        return Ok(FrameStep::Drive(
            number,
            named(scanner, &kinds, "a fault of a drive")?,
        ));
    }
    let delay = times::Duration::millis(0);
    let kinds = [
        ("lost", FrameHarm::Lost),
        ("doubled", FrameHarm::Doubled),
        ("delay", FrameHarm::Delay(delay)),
        ("corrupt", FrameHarm::Corrupt),
        ("no-acknowledge", FrameHarm::NoAcknowledge),
        ("bus-off", FrameHarm::BusOff),
    ];
    let harm = match named(scanner, &kinds, "a fault of a frame")? {
        FrameHarm::Delay(_) => FrameHarm::Delay(times::duration(scanner)?),
        harm => harm,
    };
    Ok(FrameStep::Frame(number, harm))
}

/// `quiet`, `drive 1 register 6E = 11E1CA10`
fn check(scanner: &mut Scanner<'_>) -> Result<FrameStep, Problem> {
    let checks = [("quiet", true), ("drive", false)];
    if named(scanner, &checks, "a check")? {
        return Ok(FrameStep::Quiet);
    }
    let drive = expression::sum(scanner)?;
    required(scanner, &["register"])?;
    let register = value::register(scanner)?;
    let expect = value::expect(scanner, &register)?;
    Ok(FrameStep::Register(drive, register, expect))
}

impl drive::ParsedDriveLine {
    /// The header line that it is; `None` if it is a step.
    fn into_setup(self, begun: bool) -> Option<SetupKind> {
        match self {
            Self::Setup(setup) => Some(setup),
            Self::Outside(outside) => (!begun).then_some(SetupKind::Outside(outside)),
            Self::Restart => None,
        }
    }
}
