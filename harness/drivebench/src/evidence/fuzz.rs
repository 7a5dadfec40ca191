//! The body of the fuzz target for records: hostile ones give a reason with a place, and what is taken is judged without a panic or a
//! hang.

use super::error::RecordError;
use super::read::read;
use super::record::RecordLine;
use super::verify::{Beside, judge_record};
use crate::rig::Rig;
use crate::scenario::source::Source;
use harness_proto::time::Span;
use std::sync::OnceLock;

/// The longest input, in bytes.
const LONGEST: usize = 32 * 1024;

/// A conversation is not judged beyond this time, so that a fuzzer goes on: the twin lives through all of it.
const SHORT: Span = Span::from_millis(2_000);

/// The scenario of every attempt, whatever its name.
pub const SCENARIO: &str = "title A read\nsource nd21 10.1\nring 2\n> 88 FE C0 13 FE D1\n";

/// The bench of every record.
pub const RIG: &str = "schema = 1\n[rig]\nid = \"fuzz\"\n[ring.1]\ndrives = 2\ntransport = \"sim\"\n[limits]\nallow_motion = true\n\
                       allow_eeprom = true\nallow_reset = false\nallow_outputs = true\n";

fn rig() -> &'static Rig {
    static RIG_READ: OnceLock<Rig> = OnceLock::new();
    RIG_READ.get_or_init(|| {
        let source = Source {
            name: "fuzz.toml".to_owned(),
            text: RIG.into(),
        };
        crate::buses::parse_rig(&source).unwrap_or_else(|problems| panic!("{problems}"))
    })
}

/// Reads a record and judges it, as `drivebench verify` does.
///
/// # Panics
/// A rule is broken: an error has a place outside the record, or an event is not written as it was read.
pub fn record(input: &[u8]) {
    if input.len() > LONGEST {
        return;
    }
    let mut lines = Vec::new();
    if let Err(error) = read(input, |_, _, line| lines.push(line)) {
        return placed(&error, input);
    }
    let mut longest = Span::ZERO;
    for line in &lines {
        if let Some(event) = line.event() {
            let again = RecordLine::of(&event).and_then(|line| line.event());
            assert_eq!(
                again.as_ref(),
                Some(&event),
                "an event is another when it is written"
            );
        }
        longest = longest.max(line.time());
    }
    if longest > SHORT {
        return;
    }
    let scenario = |_: &str| Ok(SCENARIO.to_owned());
    let beside = Beside {
        rig: rig(),
        scenario: &scenario,
    };
    if let Err(error) = judge_record(input, &beside) {
        assert!(!error.to_string().is_empty());
    }
}

/// What a record reaches: its kinds of lines and what comes of judging it, or why it is none; as a place and a message.
pub(crate) fn noted(input: &[u8], note: &mut dyn FnMut(&'static str, String)) {
    if input.len() > LONGEST {
        return;
    }
    let mut lines = Vec::new();
    let whole = match read(input, |_, _, line| lines.push(line)) {
        Ok(whole) => whole,
        Err(error) => return note("no record", error.message),
    };
    note(
        "a record",
        if whole {
            "whole"
        } else {
            "half a line at its end"
        }
        .to_owned(),
    );
    for line in &lines {
        note("a line", kind(line));
    }
    if lines.iter().any(|line| line.time() > SHORT) {
        return note("a record", "longer than it is judged here".to_owned());
    }
    let scenario = |_: &str| Ok(SCENARIO.to_owned());
    let beside = Beside {
        rig: rig(),
        scenario: &scenario,
    };
    match judge_record(input, &beside) {
        Err(error) => note("not judged", error.to_string()),
        Ok(verified) => {
            for wrong in verified.files {
                note("a file", wrong);
            }
            for attempt in verified.attempts {
                let recorded = attempt.recorded.unwrap_or_else(|| "nothing".to_owned());
                note(
                    "an attempt",
                    format!("recorded {recorded}, judged {}", attempt.judged),
                );
                if let Some(differs) = attempt.differs {
                    note("an attempt that differs", differs);
                }
            }
        }
    }
}

/// What a line tells, with the words that stand in it for a kind.
fn kind(line: &RecordLine) -> String {
    let value = serde_json::to_value(line).unwrap_or_default();
    let word = |key: &str| value.get(key).and_then(serde_json::Value::as_str);
    let words = ["kind", "cause", "error", "verdict"]
        .into_iter()
        .filter_map(word);
    let mut words: Vec<_> = words.map(str::to_owned).collect();
    if let Some(fault) = value.pointer("/what/0").and_then(serde_json::Value::as_str) {
        words.push(fault.to_owned());
    }
    words.join(", ")
}

/// An error has its place in the input, or directly behind it.
fn placed(error: &RecordError, input: &[u8]) {
    let lines = input.split(|byte| *byte == b'\n').count().max(1);
    assert!((1..=lines).contains(&error.line), "{error}");
    assert!(error.column >= 1 && error.offset <= input.len(), "{error}");
}
