//! A case as a scenario: every finding is one.

use super::case::{Act, Case, Harm, Talk, To, What};
use super::oracle::{answered, sent};
use super::play::Seen;
use super::setup::drive_name;
use crate::link::link_name;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::roles;
use std::fmt::Write as _;

/// Bytes on a line at most.
const BYTES_A_LINE: usize = 24;

/// Where a comment begins, if the line is not longer.
const COMMENT_AT: usize = 32;

/// How long a line of a remark may be.
const MOST_REMARK: usize = 100;

/// How long a comment may be.
const MOST_COMMENT: usize = 60;

/// What stands around the steps.
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// The title.
    pub title: &'a str,
    /// The tables that it pins, such as `nd21 9.7`.
    pub sources: &'a [String],
    /// More lines of the header, such as `drive 0..last model nd21`.
    pub header: &'a [String],
    /// Remarks in front of the steps.
    pub remarks: &'a [String],
    /// What the master must receive.
    pub expected: Option<Expected<'a>>,
}

/// What the master must receive.
#[derive(Clone, Copy, Debug)]
pub struct Expected<'a> {
    /// The bytes.
    pub seen: &'a Seen,
    /// Indexes of bytes that may have any value: data that a drive measures, and their checking bytes.
    pub any: &'a [usize],
    /// The byte that must come at its time, by its index.
    pub timed: Option<usize>,
}

/// The lines in front of the first empty one, for rings of these sizes.
pub(crate) fn head(sizes: &[u8], strict: bool, page: &Page<'_>) -> String {
    let mut text = format!("title   {}\n", page.title);
    // Writing to a String cannot fail.
    for source in page.sources {
        let _infallible = writeln!(text, "source  {source}");
    }
    let sizes: Vec<_> = sizes.iter().map(u8::to_string).collect();
    let _infallible = writeln!(text, "ring    {}", sizes.join(", "));
    if strict {
        text.push_str("strict\n");
    }
    for line in page.header {
        let _infallible = writeln!(text, "{line}");
    }
    text
}

/// The text of a scenario.
#[must_use]
pub fn text(case: &Case, page: &Page<'_>) -> String {
    let strict = page
        .expected
        .is_some_and(|expected| is_strict(case, expected));
    let mut text = head(&case.sizes(), strict, page);
    text.push('\n');
    for line in page.remarks.iter().flat_map(|remark| wrapped(remark)) {
        let _infallible = writeln!(text, "# {line}");
    }
    let mut faults = case.faults().into_iter();
    for act in &case.acts {
        steps(&mut text, act, case);
        let own = if act.length(case.drives) > 0 {
            act.damages.len()
        } else {
            0
        };
        for (link, byte, harm) in faults.by_ref().take(own) {
            let place = link_name(case.ring(), case.drives, usize::from(link));
            let _infallible = writeln!(text, "! {place} byte {byte}: {}", fault(harm));
        }
    }
    if let Some(expected) = page.expected {
        answers(&mut text, case, expected);
    }
    text
}

/// A remark as lines that are not too long.
fn wrapped(remark: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in remark.split_whitespace() {
        match lines.last_mut() {
            Some(last) if last.is_empty() => last.push_str(word),
            Some(last) if last.len() + word.len() < MOST_REMARK => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Whether the scenario expects every byte that the ring returns. This is not possible with unasked zeros (9.9), which drives send
/// without end.
fn is_strict(case: &Case, expected: Expected<'_>) -> bool {
    expected.seen.received.len() <= case.bytes().len()
}

/// The prefix of `>` and `<` lines, which names ring 2 for a case with that ring.
fn side(case: &Case) -> &'static str {
    ["", "2"][case.ring()]
}

fn steps(text: &mut String, act: &Act, case: &Case) {
    match act.what {
        What::Wait(ms) => line(text, &format!("wait {ms}ms"), ""),
        What::Power { drive, on } => {
            let state = if on { "on" } else { "off" };
            let drive = drive_name(case.ring(), drive);
            line(text, &format!("! drive {drive}: {state}"), "");
        }
        _ => {
            let words = words(&act.what);
            let parts = act.parts(case.drives);
            for (index, part) in parts.iter().enumerate() {
                let comment = if index == 0 { &words[..] } else { "its rest" };
                let mut comment = Some(comment);
                for bytes in packed(part) {
                    line(
                        text,
                        &format!("{}> {bytes}", side(case)),
                        comment.take().unwrap_or_default(),
                    );
                }
            }
        }
    }
}

fn line(text: &mut String, what: &str, comment: &str) {
    let _infallible = if comment.is_empty() {
        writeln!(text, "{what}")
    } else {
        writeln!(text, "{what:<COMMENT_AT$} # {comment}")
    };
}

/// Bytes as lines of a scenario hold them: long runs of one byte as `80*12`.
fn packed(bytes: &[u8]) -> Vec<String> {
    let shown = bytes.iter().map(|byte| format!("{byte:02X}"));
    pack(&shown.collect::<Vec<_>>())
}

fn pack(words: &[String]) -> Vec<String> {
    let mut runs: Vec<(usize, &String)> = Vec::new();
    for word in words {
        match runs.last_mut() {
            Some((count, last)) if *last == word => *count += 1,
            _ => runs.push((1, word)),
        }
    }
    let mut parts = Vec::new();
    for (count, word) in runs {
        match count {
            1..=3 => parts.extend(std::iter::repeat_n(word.clone(), count)),
            _ => parts.push(format!("{word}*{count}")),
        }
    }
    parts
        .chunks(BYTES_A_LINE)
        .map(|chunk| chunk.join(" "))
        .collect()
}

/// What an act is, in the manual's words.
fn words(what: &What) -> String {
    let mut words = match what {
        What::Synco(_) => "SYNCO".to_owned(),
        What::Pause(_) => "PAUSE".to_owned(),
        What::Recover => "17 zeros and the check sequence".to_owned(),
        What::Sequence => "the check sequence alone".to_owned(),
        What::Talk(talk) => of_talk(talk),
        What::Zeros(_) | What::Bytes(_) | What::Wait(_) | What::Power { .. } => String::new(),
    };
    if words.chars().count() > MOST_COMMENT {
        words = words.chars().take(MOST_COMMENT - 3).collect::<String>() + "...";
    }
    words
}

fn of_talk(talk: &Talk) -> String {
    let whom = match talk.to {
        To::Drive(drive) => format!("drive {drive}"),
        To::Same => "same drive".to_owned(),
        To::Next => "next drive".to_owned(),
        To::Nobody(_) => "nobody".to_owned(),
    };
    let mut what = Vec::new();
    if let Some(data) = talk.process_data {
        what.push(format!("process data {data:04X}"));
    }
    for order in &talk.orders {
        let wrong = match order.spoil {
            Some(spoil) if usize::from(spoil.at) >= order.command.head().len() => {
                " with a wrong checking byte"
            }
            Some(_) => " with a wrong byte",
            None => "",
        };
        what.push(format!("{}{wrong}", order.command.words()));
    }
    if what.is_empty() {
        what.push("nothing".to_owned());
    }
    format!("{whom}: {}", what.join(", "))
}

fn fault(harm: Harm) -> String {
    match harm {
        // The language's numbers have no spaces before their units.
        Harm::Delay(us) => format!("delay {us}us"),
        Harm::Break(us) => format!("break {us}us"),
        other => other.fault().to_string(),
    }
}

/// Lines with what must be received: act by act, where a byte comes for a byte.
fn answers(text: &mut String, case: &Case, expected: Expected<'_>) {
    let received = &expected.seen.received;
    let mut from = 0;
    let sent = sent(case);
    let roles = RingSize::new(u64::from(case.drives)).map(|size| roles(size, &sent));
    let roles = roles.unwrap_or_default();
    if received.len() == answered(&roles, &sent).count() {
        let mut rest = (&roles[..], &sent[..]);
        for part in case.acts.iter().flat_map(|act| act.parts(case.drives)) {
            let (own, later) = (rest.0.split_at(part.len()), rest.1.split_at(part.len()));
            let count = answered(own.0, later.0).count();
            answer(text, case, from..from + count, expected);
            from += count;
            rest = (own.1, later.1);
        }
    }
    let step = 4 * BYTES_A_LINE;
    while from < received.len() {
        let to = (from + step).min(received.len());
        answer(text, case, from..to, expected);
        from = to;
    }
}

fn answer(text: &mut String, case: &Case, range: std::ops::Range<usize>, expected: Expected<'_>) {
    let received = &expected.seen.received;
    let side = side(case);
    let word = |index: usize| match expected.any.contains(&index) {
        true => "xx".to_owned(),
        false => format!("{:02X}", received[index].1.byte),
    };
    // A byte with a time in front begins a line.
    let timed = expected.timed.filter(|timed| range.contains(timed));
    let middle = timed.unwrap_or(range.end);
    for (part, at) in [(range.start..middle, None), (middle..range.end, timed)] {
        let words: Vec<_> = part.map(word).collect();
        for (index, bytes) in pack(&words).into_iter().enumerate() {
            match at.filter(|_| index == 0) {
                None => line(text, &format!("{side}< {bytes}"), ""),
                Some(at) => {
                    let time = received[at].0.since_start().as_nanos();
                    let (us, tenth) = (time / 1_000, time / 100 % 10);
                    line(
                        text,
                        &format!("@{us}.{tenth}us {side}< {bytes}"),
                        "at this time",
                    );
                }
            }
        }
    }
}
