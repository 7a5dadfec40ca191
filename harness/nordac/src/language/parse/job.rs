//! Jobs of the master: `exchange 8 STW=047F HSW=50%`.

use super::super::syntax::{JobKind, JobStep, WantedAnswer, WordKind, WordName, WordValue};
use super::{slave, value};
use harness_bench::scenario::expression;
use harness_bench::scenario::parse::words::{equals, named};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;

pub(in super::super) const NAMES: [&str; 8] = [
    "start",
    "exchange",
    "read",
    "write",
    "on",
    "off",
    "quick-stop",
    "acknowledge",
];

/// The words of a request, and those of a reply.
const SENT: [(&str, WordName); 5] = [
    ("STW", WordName::Control),
    ("HSW", WordName::Main),
    ("PZD3", WordName::Third),
    ("PZD4", WordName::Fourth),
    ("PKW", WordName::Pkw),
];
const RECEIVED: [(&str, WordName); 5] = [
    ("ZSW", WordName::Control),
    ("HIW", WordName::Main),
    ("PZD3", WordName::Third),
    ("PZD4", WordName::Fourth),
    ("PKW", WordName::Pkw),
];

/// How a word is called in a request, or in a reply.
pub(in super::super) fn word_name(word: WordName, sent: bool) -> &'static str {
    let names = if sent { &SENT } else { &RECEIVED };
    let row = names.iter().find(|(_, name)| *name == word);
    row.map_or("", |(name, _)| name)
}

/// Reads the rest of a job; `None` if there is none of this name.
pub(super) fn job(name: &str, scanner: &mut Scanner<'_>) -> Option<Result<JobStep, Problem>> {
    NAMES.contains(&name).then(|| one(name, scanner))
}

fn one(name: &str, scanner: &mut Scanner<'_>) -> Result<JobStep, Problem> {
    let slave = expression::sum(scanner)?;
    let what = match name {
        "start" => start(scanner)?,
        "exchange" => exchange(scanner)?,
        "read" => {
            let name = value::parameter(scanner)?;
            let wanted = match scanner.at_end() {
                true => None,
                false if scanner.eat_word("error") => {
                    Some(WantedAnswer::Error(expression::sum(scanner)?))
                }
                false => {
                    equals(scanner)?;
                    Some(WantedAnswer::Value(value::value(scanner)?))
                }
            };
            JobKind::Read(name, wanted)
        }
        "write" => {
            let (name, value) = value::assigned(scanner)?;
            let refused = scanner.eat_word("error");
            let error = refused.then(|| expression::sum(scanner)).transpose()?;
            JobKind::Write(name, value, error)
        }
        "on" => JobKind::On,
        "off" => JobKind::Off,
        "quick-stop" => JobKind::QuickStop,
        _ => JobKind::Acknowledge,
    };
    Ok(JobStep { slave, what })
}

/// `ppo 1 watchdog 300ms`, in either order; both may be left out.
fn start(scanner: &mut Scanner<'_>) -> Result<JobKind, Problem> {
    let (mut ppo, mut watchdog) = (None, None);
    while !scanner.at_end() {
        let before = scanner.clone();
        let names = [("ppo", true), ("watchdog", false)];
        let twice = match named(scanner, &names, "how the slave is started")? {
            true => ppo.replace(slave::ppo_type(scanner)?).is_some(),
            false => watchdog.replace(times::duration(scanner)?).is_some(),
        };
        if twice {
            *scanner = before;
            return Err(scanner.unexpected("the end of the line (it is given twice)"));
        }
    }
    Ok(JobKind::Start { ppo, watchdog })
}

/// `STW=047F HSW=50% -> ZSW=0F37 HIW=50%`
fn exchange(scanner: &mut Scanner<'_>) -> Result<JobKind, Problem> {
    let (mut send, mut expect) = (Vec::new(), Vec::new());
    while !scanner.at_end() && !scanner.eat("->") {
        // ZSW and HIW stand in replies only, so they need no arrow in front.
        let reply = ["ZSW", "HIW"]
            .iter()
            .any(|name| scanner.rest().starts_with(name));
        match reply {
            true => expect.push(word(scanner, &RECEIVED)?),
            false => send.push(word(scanner, &SENT)?),
        }
    }
    while !scanner.at_end() {
        expect.push(word(scanner, &RECEIVED)?);
    }
    Ok(JobKind::Exchange { send, expect })
}

/// `STW=047F`
fn word(
    scanner: &mut Scanner<'_>,
    names: &[(&str, WordName)],
) -> Result<(WordName, WordValue), Problem> {
    let name = named(scanner, names, "a word of the telegram")?;
    equals(scanner)?;
    let here = scanner.here();
    let kind = contents(scanner, name)?;
    let span = scanner.since(here);
    Ok((name, WordValue { kind, span }))
}

fn contents(scanner: &mut Scanner<'_>, name: WordName) -> Result<WordKind, Problem> {
    if scanner.eat("(") {
        let number = expression::sum(scanner)?;
        return match scanner.eat(")") {
            true => Ok(WordKind::Counted(number)),
            false => Err(scanner.unexpected("`)`")),
        };
    }
    let before = scanner.clone();
    let negative = scanner.eat("-");
    let text = scanner.take_while(|c| c.is_ascii_alphanumeric() || ".%".contains(c));
    let text = text.map_or("", |text| text.value);
    let length = if name == WordName::Pkw { 8 } else { 2 };
    let percent = text.strip_suffix('%').filter(|_| name != WordName::Pkw);
    let found = match percent {
        Some(number) => value::decimal(number).map(|(digits, places)| {
            WordKind::Percent(if negative { -digits } else { digits }, places)
        }),
        None => bytes(text.strip_suffix('h').unwrap_or(text))
            .filter(|bytes| bytes.len() == length && !negative)
            .map(WordKind::Bytes),
    };
    found.ok_or_else(|| {
        *scanner = before;
        scanner.unexpected(match name {
            WordName::Pkw => "the 8 bytes of the parameter channel as 16 hexadecimal digits",
            _ => "four hexadecimal digits such as 047F, or a percentage such as 50%",
        })
    })
}

/// Bytes of two hexadecimal digits each, or `xx`.
fn bytes(text: &str) -> Option<Vec<Option<u8>>> {
    let pairs = text.as_bytes().chunks(2);
    let byte = |pair: &[u8]| match std::str::from_utf8(pair) {
        Ok("xx" | "XX") => Some(None),
        Ok(digits) if pair.len() == 2 && pair.iter().all(u8::is_ascii_hexdigit) => {
            u8::from_str_radix(digits, 16).ok().map(Some)
        }
        _ => None,
    };
    pairs.map(byte).collect()
}
