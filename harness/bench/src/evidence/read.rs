//! A record read back: every line must be valid, possible and in its place. The first that is not is named with its
//! place.

use super::error::RecordError;
use super::record::{RecordLine, SCHEMA};
use crate::link::{Lead, LinkEvent, LinkFault, Moment, PlacedFault};
use crate::rig::rings::rings;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::io::BufRead;

/// The largest record, in bytes.
pub const MAX_SIZE: u64 = 1 << 31;

/// The longest time of a conversation: a damaged digit must not keep a computer busy for years.
pub(crate) const MAX_TIME: Span = Span::from_millis(24 * 3_600_000);

/// Reads a record line by line: `take` gets each one with its number, counted from 1, and its text. Returns whether the last one is whole; a
/// run that was killed leaves half a line.
///
/// # Errors
/// The first line that is invalid or in the wrong place.
pub fn read(
    record: impl BufRead,
    mut take: impl FnMut(usize, &[u8], RecordLine),
) -> Result<bool, RecordError> {
    let mut record = record.take(MAX_SIZE + 1);
    let mut order = Order::default();
    let (mut number, mut offset) = (1, 0);
    let mut text = Vec::new();
    loop {
        text.clear();
        let read = record.read_until(b'\n', &mut text);
        let whole = text.ends_with(b"\n");
        let wrong = |column: usize, message: String| RecordError {
            line: number,
            column: column.max(1),
            offset: offset + column.saturating_sub(1),
            message,
        };
        match read {
            Ok(0) if number == 1 => return Err(wrong(1, "the record is empty".to_owned())),
            Ok(0) => return Ok(true),
            Ok(_) if record.limit() == 0 => {
                return Err(wrong(
                    1,
                    format!("the record has more than {} KiB", MAX_SIZE >> 10),
                ));
            }
            Ok(_) => {}
            Err(error) => return Err(wrong(1, error.to_string())),
        }
        match parse(&text) {
            Ok(line) => {
                order.take(&line).map_err(|message| wrong(1, message))?;
                take(number, &text, line);
            }
            // The first line tells what it is all about.
            Err(_) if !whole && number > 1 => return Ok(false),
            Err((column, message)) => return Err(wrong(column, message)),
        }
        if !whole {
            return Ok(false);
        }
        offset += text.len();
        number += 1;
    }
}

/// Where this program would write a line in other bytes, in a sentence: blanks, another order of fields, digits of another form.
pub fn unlike_written(number: usize, text: &[u8], line: &RecordLine) -> Option<String> {
    // Bytes and times of an event are written from their values.
    let event = line.event().and_then(|event| RecordLine::of(&event));
    let written = serde_json::to_string(event.as_ref().unwrap_or(line)).unwrap_or_default();
    let text = text.strip_suffix(b"\n").unwrap_or(text);
    if text == written.as_bytes() {
        return None;
    }
    let same = text.iter().zip(written.as_bytes());
    let column = same.take_while(|(one, other)| one == other).count() + 1;
    Some(format!(
        "line {number}, column {column}: this program writes the line in other bytes"
    ))
}

/// Parses a line. The error has the column, counted from 1, and the reason.
fn parse(bytes: &[u8]) -> Result<RecordLine, (usize, String)> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let at = error.valid_up_to();
        let byte = bytes.get(at).copied().unwrap_or(0);
        (at + 1, format!("this is not UTF-8: {byte:02X} stands here"))
    })?;
    let text = text.strip_suffix('\n').unwrap_or(text);
    let line = serde_json::from_str::<RecordLine>(text).map_err(|error| {
        let message = error.to_string();
        // The place is reported separately.
        let message = message.split(" at line ").next().unwrap_or_default();
        (error.column(), message.to_owned())
    })?;
    match text.ends_with('\r') {
        true => Err((text.len(), "a CR stands at the end of the line".to_owned())),
        false => Ok(line),
    }
}

/// What precedes a line.
#[derive(Default)]
struct Order {
    drives: Vec<u8>,
    begun: bool,
    scenario: bool,
    /// The attempt has ended in trouble.
    trouble: bool,
    verdict: bool,
    ended: bool,
}

impl Order {
    /// Whether a line can follow those before and have these contents; why not, in a sentence.
    fn take(&mut self, line: &RecordLine) -> Result<(), String> {
        if self.ended {
            return Err("nothing can stand behind the end of the record".to_owned());
        }
        if matches!(line, RecordLine::Run { .. }) == self.begun {
            return Err(match self.begun {
                true => "the record has begun already".to_owned(),
                false => format!("the record of a run expected here, of schema {SCHEMA}"),
            });
        }
        match line {
            RecordLine::Run {
                schema,
                rings,
                tolerance,
                ..
            } => {
                self.run(*schema, rings)?;
                in_time(Span::from_units(*tolerance))
            }
            RecordLine::Scenario { attempt, .. } => {
                (self.scenario, self.trouble, self.verdict) = (true, false, false);
                match attempt {
                    0 => Err("attempts are counted from 1".to_owned()),
                    _ => Ok(()),
                }
            }
            RecordLine::End { verdicts, .. } => {
                self.ended = true;
                verdicts.iter().try_for_each(|name| verdict(name))
            }
            // A scenario that was skipped has one, and no attempt.
            RecordLine::Case {
                verdict: name,
                took,
                ..
            } => {
                self.scenario = false;
                verdict(name)?;
                in_time(Span::from_units(*took))
            }
            _ if !self.scenario => Err("no scenario has begun".to_owned()),
            RecordLine::Verdict {
                verdict: name,
                took,
                ..
            } => {
                if std::mem::replace(&mut self.verdict, true) {
                    return Err("the attempt has a verdict already".to_owned());
                }
                verdict(name)?;
                in_time(Span::from_units(*took))
            }
            _ if self.verdict => Err("an event behind the verdict of its attempt".to_owned()),
            event => match event.event() {
                Some(event) => self.event(&event),
                None => Err("this is an event that cannot be".to_owned()),
            },
        }
    }

    fn run(&mut self, schema: u32, rings: &[u8]) -> Result<(), String> {
        if !(1..=SCHEMA).contains(&schema) {
            return Err(format!(
                "a record of schema {schema}; this program knows 1 to {SCHEMA}"
            ));
        }
        self::rings(rings)?;
        self.begun = true;
        self.drives = rings.to_vec();
        Ok(())
    }

    fn event(&mut self, event: &LinkEvent) -> Result<(), String> {
        let (ring, at) = match event {
            LinkEvent::Begin(at) => (0, *at),
            LinkEvent::Look(look) => {
                let lead = look.lead.unwrap_or(Lead::NONE);
                in_time(lead.far)?;
                in_time(lead.near)?;
                in_time(look.pause.unwrap_or(look.at).since_start())?;
                (0, look.at)
            }
            LinkEvent::Sent(ring, at, _)
            | LinkEvent::Received(ring, at, _)
            | LinkEvent::Fault(ring, at, ..)
            | LinkEvent::Probe(ring, at, ..) => (*ring, *at),
            LinkEvent::Tapped(ring, _, at, _) => (*ring, *at),
            LinkEvent::Step(_) => return Ok(()),
            LinkEvent::Trouble(_) => {
                return match std::mem::replace(&mut self.trouble, true) {
                    true => Err("the attempt is in trouble already".to_owned()),
                    false => Ok(()),
                };
            }
        };
        let Some(drives) = self.drives.get(ring) else {
            return Err(format!("the bench has no ring {}", ring + 1));
        };
        if let LinkEvent::Fault(_, _, PlacedFault::Link(link, what), moment) = event {
            if *link > usize::from(*drives) {
                return Err(format!("a ring of {drives} drives has no link {link}"));
            }
            if let LinkFault::Delay(span) | LinkFault::Break(span) = what {
                in_time(*span)?;
            }
            if let Moment::At(at) = moment {
                in_time(at.since_start())?;
            }
        }
        in_time(at.since_start())
    }
}

fn in_time(span: Span) -> Result<(), String> {
    match span <= MAX_TIME {
        true => Ok(()),
        false => Err("this time is longer than a day".to_owned()),
    }
}

fn verdict(name: &str) -> Result<(), String> {
    let known = Verdict::ALL.iter().any(|verdict| verdict.name() == name);
    match known {
        true => Ok(()),
        false => Err(format!("`{name}` is not a verdict")),
    }
}
