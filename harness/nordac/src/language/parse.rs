//! From text to the syntax of this bus.

mod job;
mod slave;
mod telegram;
mod value;

pub(super) use job::{NAMES, word_name};
pub(super) use telegram::message;

use super::syntax::{Header, OctetHarm, Sender, SlaveLine, TelegramHarm, TelegramStep};
use harness_bench::scenario::expression;
use harness_bench::scenario::language::Opening;
use harness_bench::scenario::parse::header::{deviating_master, once};
use harness_bench::scenario::parse::step::{behind_the_first, header_too_late};
use harness_bench::scenario::parse::words::{named, required};
use harness_bench::scenario::problem::{Problem, Spanned, TextSpan};
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_proto::profibus::BusRate;
use harness_sim::fault::LinkFault;
use harness_sim::nordac::deviation::MASTER_DEVIATIONS;
use harness_sim::octet_segment::TelegramFault;

/// Words with which header lines of this bus begin.
pub(super) const HEADER: [&str; 3] = ["rate", "slave", "master"];

/// Words with which steps begin that are no jobs.
pub(super) const STEPS: [&str; 1] = ["slave"];

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
        "slave" => slave_line(word, scanner, header, begun),
        "master" => Some(master(word, scanner, header, begun)),
        _ => None,
    }
}

/// The first thing that a header lacks.
pub(super) fn incomplete(header: &Header) -> Option<Problem> {
    let what = "the scenario has no slave";
    let problem = Problem::new(TextSpan::default(), what, "a `slave` line expected");
    let help = "add a line such as `slave 8`, or `slave 8 ppo 2`";
    header.slaves.is_empty().then(|| problem.help(help))
}

/// `500`, `93.75` or `9.6`, in kbit/s.
fn rate(scanner: &mut Scanner<'_>) -> Result<BusRate, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit() || c == '.');
    let digits = digits.map_or("", |digits| digits.value);
    let Some(rate) = BusRate::from_name(digits) else {
        let known = BusRate::ALL.map(BusRate::name);
        let expected = format!("a rate in kbit/s ({})", known.join(", "));
        return Err(scanner.unexpected(&expected));
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

/// A line that begins with `slave` is a header line where it can be one.
fn slave_line(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Option<Result<(), Problem>> {
    let mut ahead = scanner.clone();
    let read = slave::line(&mut ahead).and_then(|read| ahead.expect_end().map(|()| read));
    let (slave, line) = match read {
        Ok(read) => read,
        Err(problem) => return Some(Err(problem)),
    };
    let what = match line {
        slave::ParsedSlaveLine::Setup(setup) => setup,
        slave::ParsedSlaveLine::Outside(_) => return None,
    };
    if begun {
        let problem = behind_the_first(word.span, "slave");
        let help = "move the line up, above the first step; steps are `slave 8 link`, `fault` and `restart`; `write 8 1205 = 70.0Hz` changes a parameter over the bus";
        return Some(Err(problem.help(help)));
    }
    let span = ahead.since(word.span);
    *scanner = ahead;
    header.slaves.push(SlaveLine { slave, what, span });
    Some(Ok(()))
}

/// Reads what stands after the opening of a step; `None` if there is no such word.
pub(super) fn step(
    opening: Opening<'_>,
    scanner: &mut Scanner<'_>,
) -> Option<Result<TelegramStep, Problem>> {
    Some(match opening {
        Opening::Fault => fault(scanner),
        Opening::Check => check(scanner),
        Opening::Word(word) => match word.value {
            "slave" => slave::step(scanner),
            name => return Some(job::job(name, scanner)?.map(TelegramStep::Job)),
        },
    })
}

/// `byte 7: drop`, `slave 8 byte 3: flip 0`, `master telegram 3: lost`, `slave 8: off`
fn fault(scanner: &mut Scanner<'_>) -> Result<TelegramStep, Problem> {
    let sender = if scanner.eat_word("master") {
        Sender::Master
    } else if scanner.eat_word("slave") {
        Sender::Slave(expression::sum(scanner)?)
    } else {
        Sender::Any
    };
    if let Sender::Slave(slave) = &sender
        && scanner.eat(":")
    {
        let names = [("off", false), ("on", true)];
        let on = named(scanner, &names, "a fault of a slave")?;
        return Ok(TelegramStep::Power(slave.clone(), on));
    }
    let counted = [("byte", true), ("telegram", false)];
    let of_octet = named(scanner, &counted, "what the fault happens to")?;
    let number = expression::sum(scanner)?;
    if !scanner.eat(":") {
        return Err(scanner.unexpected("`:` and the fault, as in `! slave 8 byte 3: drop`"));
    }
    Ok(match of_octet {
        true => TelegramStep::Octet(sender, number, octet_harm(scanner)?),
        false => TelegramStep::Telegram(sender, number, telegram_harm(scanner)?),
    })
}

fn telegram_harm(scanner: &mut Scanner<'_>) -> Result<TelegramHarm, Problem> {
    let delay = times::Duration::millis(0);
    let names = [
        ("lost", TelegramHarm::Plain(TelegramFault::Lost)),
        ("doubled", TelegramHarm::Plain(TelegramFault::Doubled)),
        ("former", TelegramHarm::Plain(TelegramFault::Former)),
        ("delay", TelegramHarm::Delay(delay)),
    ];
    match named(scanner, &names, "a fault of a telegram")? {
        TelegramHarm::Delay(_) => Ok(TelegramHarm::Delay(times::duration(scanner)?)),
        plain => Ok(plain),
    }
}

fn octet_harm(scanner: &mut Scanner<'_>) -> Result<OctetHarm, Problem> {
    let names = [
        ("flip", 0),
        ("replace", 1),
        ("drop", 2),
        ("duplicate", 3),
        ("insert", 4),
        ("delay", 5),
    ];
    let plain = match named(scanner, &names, "a fault of a byte")? {
        0 => LinkFault::Flip(telegram::flips(scanner, true)?),
        1 => LinkFault::Replace(telegram::byte(scanner)?),
        2 => LinkFault::Drop,
        3 => LinkFault::Duplicate,
        4 => LinkFault::Insert(telegram::byte(scanner)?),
        _ => return Ok(OctetHarm::Delay(times::duration(scanner)?)),
    };
    Ok(OctetHarm::Plain(plain))
}

/// `quiet`, `slave 8 parameter 1202 = 100`
fn check(scanner: &mut Scanner<'_>) -> Result<TelegramStep, Problem> {
    let checks = [("quiet", true), ("slave", false)];
    if named(scanner, &checks, "a check")? {
        return Ok(TelegramStep::Quiet);
    }
    let slave = expression::sum(scanner)?;
    required(scanner, &["parameter"])?;
    let (name, value) = value::assigned(scanner)?;
    Ok(TelegramStep::Parameter(slave, name, value))
}
