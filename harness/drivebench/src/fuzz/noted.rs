//! What the inputs of the targets for texts, captures and records reach: which statements are taken, and which mistakes are found.

use super::capture::capture as capture_body;
use super::text::{rig as rig_body, scenario as scenario_body};
use crate::buses::{carrier, named};
use crate::capture::{self, CaptureError, Carries, JudgeOptions};
use crate::evidence;
use crate::scenario::parse::bus;
use crate::scenario::problem::Problems;
use crate::scenario::settled::BenchSize;
use crate::scenario::source::Source;
use harness_proto::line::LineError;
use harness_proto::nd21::cells::cell;
use harness_sim::fuzz::{Feature, Notebook};
use harness_sim::record::{Channel, LineByte};

/// The sizes of ring for which a scenario is settled: its own, the smallest and the largest (ND21 8.4).
const SIZES: [BenchSize; 3] = [BenchSize::Own, BenchSize::Of(1), BenchSize::Of(250)];

/// How many words of a line identify its statement.
const STATEMENT: usize = 3;

/// A text as a scenario: the statements of one that is taken, or the mistakes.
///
/// # Panics
pub(crate) fn scenario(data: &[u8], notes: &mut Notebook<'_>) {
    scenario_body(data);
    let Ok(source) = Source::from_bytes("input.scn".to_owned(), data.to_vec()) else {
        return notes.note(|| Feature::new("", "no text", "not UTF-8"));
    };
    let bus = named(bus(&source));
    if let Err(found) = (bus.comes_back)(&source) {
        return problems(notes, "a mistake", &found);
    }
    for line in source.text.lines() {
        let said = statement(line);
        if !said.is_empty() {
            notes.note(|| Feature::new("", "a statement", said));
        }
    }
    for size in SIZES {
        if let Err(found) = (bus.settle)(&source, size) {
            problems(notes, "a mistake for a size of ring", &found);
        }
    }
}

/// A text as a rig file: the keys of one that is taken, or the mistakes.
///
/// # Panics
pub(crate) fn rig(data: &[u8], notes: &mut Notebook<'_>) {
    rig_body(data);
    let Ok(source) = Source::from_bytes("input.toml".to_owned(), data.to_vec()) else {
        return notes.note(|| Feature::new("", "no text", "not UTF-8"));
    };
    if let Err(found) = crate::buses::parse_rig(&source) {
        return problems(notes, "a mistake", &found);
    }
    let Ok(table) = source.text.parse::<toml::Table>() else {
        return;
    };
    keys(notes, "", &toml::Value::Table(table));
}

/// Any bytes as a capture: which marks are in it and what it can be made into, or why it is none.
///
/// # Panics
pub(crate) fn capture(data: &[u8], notes: &mut Notebook<'_>) {
    capture_body(data);
    let form = match data.iter().find(|byte| !byte.is_ascii_whitespace()) {
        Some(b'{') => "JSON",
        _ => "pcapng",
    };
    let read = match capture::read(data, None) {
        Ok(read) => read,
        Err(error) => {
            let what = match error {
                CaptureError::At { what, .. } | CaptureError::Link { what, .. } => shape(&what),
                CaptureError::Foreign { .. } => "it begins differently".to_owned(),
                other => shape(&other.to_string()),
            };
            return notes.note(|| Feature::new("", format!("no capture, {form}"), what));
        }
    };
    let place = format!("a capture, {form}");
    let mut note = |what: String| notes.note(|| Feature::new("", place.clone(), what));
    note(format!("{} rings", read.traces.len()));
    note(format!("{} bit/s", read.rate.bits_per_second()));
    for byte in read
        .traces
        .iter()
        .flat_map(|trace| &trace.channels)
        .flat_map(Channel::octets)
    {
        note(arrival(byte).to_owned());
    }
    let options = JudgeOptions {
        title: "any",
        ..JudgeOptions::default()
    };
    let bus = carrier(Carries::of(&read.traces));
    note(match (bus.replayed)(&read, &options) {
        Ok(_) => "a scenario can be made of it".to_owned(),
        Err(error) => shape(&error),
    });
}

fn arrival(byte: &LineByte) -> &'static str {
    match byte.arrival() {
        None => "a byte that did not arrive",
        Some(received) => match received.error {
            None => "a good byte",
            Some(LineError::Parity) => "a parity error",
            Some(LineError::Framing) => "a framing error",
            Some(LineError::Break) => "a break",
            Some(LineError::Overrun) => "an overrun",
        },
    }
}

/// Any bytes as a run's record: its kinds of lines and what comes of judging it again, or why it is none.
///
/// # Panics
pub(crate) fn record(data: &[u8], notes: &mut Notebook<'_>) {
    evidence::fuzz::record(data);
    evidence::fuzz::noted(data, &mut |place, what| {
        notes.note(|| Feature::new("", place, shape(&what)));
    });
}

/// Notes mistakes by their messages.
fn problems(notes: &mut Notebook<'_>, place: &'static str, found: &Problems) {
    for problem in found.all() {
        notes.note(|| {
            let (what, expected) = (shape(&problem.message), shape(&problem.expected));
            // Leave out an expectation that repeats the message.
            let is_new = !what.contains(expected.trim_end_matches(" expected here"));
            let more = if is_new {
                format!("; {expected}")
            } else {
                String::new()
            };
            Feature::new("", place, what + &more)
        });
    }
}

/// The keys of a file, tables in tables with points between.
fn keys(notes: &mut Notebook<'_>, table: &str, value: &toml::Value) {
    match value {
        toml::Value::Table(inner) => {
            for (key, value) in inner {
                // A name that the file gives is any name.
                let name = if table.is_empty() || !free(table) {
                    key.as_str()
                } else {
                    "NAME"
                };
                let dot = if table.is_empty() { "" } else { "." };
                keys(notes, &format!("{table}{dot}{name}"), value);
            }
        }
        toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
            items.iter().for_each(|item| keys(notes, table, item));
        }
        _ => notes.note(|| Feature::new("", "a key", table.to_owned())),
    }
}

/// Whether the keys of a table are names that the file gives.
fn free(table: &str) -> bool {
    table == "power" || table.ends_with(".match")
}

/// Which statement a line is: its first words, without what they say it of.
fn statement(line: &str) -> String {
    let code = line.split('#').next().unwrap_or_default();
    let mut words = code.split_whitespace().peekable();
    let mut said = Vec::new();
    if let Some(time) = words.next_if(|word| word.starts_with(['+', '@'])) {
        said.push(&time[..1]);
    }
    let is_word = |word: &&str| {
        word.bytes()
            .all(|byte| byte.is_ascii_lowercase() || byte == b'-')
    };
    let is_sign = |word: &&str| [">", "<", "!", "?"].contains(word);
    if words
        .peek()
        .is_some_and(|first| ["title", "source"].contains(first))
    {
        return words.next().unwrap_or_default().to_owned();
    }
    // Of which cell it says it is not asked.
    let words = words.filter(|word| is_sign(word) || is_word(word) && cell(word).is_none());
    said.extend(words.take(STATEMENT));
    said.join(" ")
}

/// What a message says, without the names and numbers that it says it of, and without what a parser of JSON or TOML says beyond the kind
/// of mistake.
pub(crate) fn shape(message: &str) -> String {
    let mut shape: Vec<&str> = Vec::new();
    let first = message.lines().next().unwrap_or_default();
    // A parser says behind its message where it stands.
    let plain = unquoted(first.split(" at line ").next().unwrap_or_default());
    for word in plain.split_whitespace() {
        let bare = word.trim_matches(|letter: char| !letter.is_ascii_alphanumeric());
        let is_hex = |bare: &str| {
            (2..=4).contains(&bare.len()) && bare.bytes().all(|byte| matches!(byte, b'A'..=b'F'))
        };
        let word = if bare.bytes().any(|byte| byte.is_ascii_digit()) || is_hex(bare) {
            "N"
        } else {
            word
        };
        if word != "N" || shape.last() != Some(&word) {
            shape.push(word);
        }
    }
    let kinds = [
        "invalid",
        "missing",
        "unclosed",
        "unexpected",
        "duplicate",
        "extra",
        "EOF",
    ];
    if shape.first().is_some_and(|first| kinds.contains(first)) {
        shape.truncate(2);
    }
    shape.join(" ").trim_end_matches([',', ':']).to_owned()
}

/// A message with two points for what stands in quotes.
fn unquoted(message: &str) -> String {
    let mut plain = String::new();
    let mut quote = None;
    for letter in message.chars() {
        match quote {
            Some(end) if letter == end => {
                quote = None;
                plain.push_str("..");
            }
            Some(_) => {}
            None if letter == '`' || letter == '"' => quote = Some(letter),
            None if letter.is_control() => plain.push(' '),
            None => plain.push(letter),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_without_names_and_numbers() {
        assert_eq!(
            shape("`foo` is not a drive of 250: \"a\""),
            ".. is not a drive of N ..",
        );
        assert_eq!(shape("line 1, an open `quote"), "line N an open");
        assert_eq!(
            shape("it begins with 0A FF 3C and ends"),
            "it begins with N and ends"
        );
        assert_eq!(shape("invalid type: map, expected u8"), "invalid type");
        assert_eq!(
            shape("trailing characters at line 1 column 2"),
            "trailing characters"
        );
    }

    #[test]
    fn statements_without_values() {
        assert_eq!(statement("> 88 FE # a read"), ">");
        assert_eq!(statement("+1ms ! link 3->2 flip"), "+ ! link flip");
        assert_eq!(statement("title a b c"), "title");
        assert_eq!(statement("? drive 0 display none"), "? drive display");
        assert_eq!(statement("? drive 0 nist = 0rpm"), "? drive");
        assert_eq!(statement("# nothing"), "");
    }
}
