//! A sequence diagram of the master and the drives: jobs with their answers, faults on the line, the error mode and the recovery from it
//! (ND21 9.5, 9.7, 9.8). It is made from both links of the master and from the drives' marks.

use crate::report::csv::{remark, status};
use crate::report::meaning::ByteRole;
use crate::report::walk::LinkReader;
use harness_bench::html::Html;
use harness_bench::report::pcapng::name;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::Instant;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Events shown at most.
const MOST: usize = 250;
/// Events drawn at most.
const DRAWN: usize = 60;
/// Drives with a line of their own at most.
const LIFELINES: usize = 10;
/// Faults on links shown one by one at most.
const FAULTS: usize = 12;
/// Maximum number of drives shown individually as detecting a fault: after the first one, every drive detects it.
const DETECTED: usize = 4;
/// Maximum number of bytes written for an event.
const BYTES: usize = 16;

/// The label of what the master sends to recover a ring (9.8).
const CHECK: &str = "check sequence";

/// Suffix of an answer whose checking byte is wrong (9.6).
const MISFIT: &str = " (checking byte does not fit)";

/// Room for times.
const TIMES: usize = 90;
const COLUMN: usize = 110;
/// The width of a letter, rounded up.
const LETTER: usize = 7;
const ROW: usize = 26;
const TOP: usize = 30;

/// A sender or receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Party {
    Master,
    Drive(u8),
    /// All drives, or an unknown one.
    Ring,
}

impl Party {
    fn name(self) -> String {
        match self {
            Self::Master => "master".to_owned(),
            Self::Drive(drive) => format!("drive {drive}"),
            Self::Ring => "the ring".to_owned(),
        }
    }
}

/// The class of its colour: as in the diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum EventKind {
    Job,
    Answer,
    Trouble,
    Sequence,
}

impl EventKind {
    const fn class(self) -> &'static str {
        match self {
            Self::Job => "b",
            Self::Answer => "c",
            Self::Trouble => "d",
            Self::Sequence => "f",
        }
    }
}

#[derive(Clone, Debug)]
struct Event {
    at: Instant,
    kind: EventKind,
    from: Party,
    to: Party,
    what: String,
    bytes: Vec<Option<u8>>,
    result: String,
}

/// Writes the events; false where there are none.
pub(crate) fn sequence(html: &mut Html, id: &str, trace: &Trace) -> bool {
    let events = events(trace);
    if events.is_empty() {
        return false;
    }
    picture(html, id, &events);
    table(html, &events);
    true
}

fn events(trace: &Trace) -> Vec<Event> {
    let mut events = Vec::new();
    for (link, reader) in trace.channels.iter().zip(LinkReader::all(trace)) {
        if link.from.is_none() || link.to.is_none() {
            said(link, reader, &mut events);
        }
    }
    asked(&mut events);
    faults(trace, &mut events);
    remarks(trace, &mut events);
    events.sort_by_key(|event| event.at);
    events
}

/// What one link at the master carried, put together.
fn said(link: &Channel, mut reader: LinkReader<'_>, events: &mut Vec<Event>) {
    let master = link.from.is_none();
    // By drive: a command may be cut over several telegrams.
    let mut open: BTreeMap<(Option<u8>, bool), usize> = BTreeMap::new();
    let mut before = None;
    for byte in link.octets() {
        let seen = reader.see(byte);
        let (meaning, value) = if master {
            (seen.sent, byte.sent)
        } else {
            (seen.meaning, byte.received)
        };
        let whom = meaning.drive.map_or(Party::Ring, Party::Drive);
        let begun = match meaning.role {
            ByteRole::Command
            | ByteRole::Parameter
            | ByteRole::Data
            | ByteRole::Check
            | ByteRole::ProcessData => {
                let key = (meaning.drive, meaning.role == ByteRole::ProcessData);
                let begins = meaning.role == ByteRole::Command
                    || meaning.role == ByteRole::ProcessData && before != Some(key);
                if begins {
                    open.remove(&key);
                }
                let index = *open.entry(key).or_insert_with(|| {
                    events.push(told(byte.at, master, whom, key.1));
                    events.len() - 1
                });
                before = Some(key);
                Some(index)
            }
            role => {
                before = None;
                open_run(role, master, byte.at, events)
            }
        };
        let Some(index) = begun else { continue };
        let event = &mut events[index];
        event.bytes.push(value);
        if let Some(layout) = meaning.command {
            let cell = meaning
                .cell
                .map_or_else(String::new, |cell| format!(" {cell:04X}"));
            event.what = if meaning.answer {
                format!("answer to {}{cell}", layout.printed_name)
            } else {
                format!("{}{cell}", layout.printed_name)
            };
        }
        if let (ByteRole::Data, Some(value)) = (meaning.role, value) {
            let gap = if event.result.is_empty() {
                "data "
            } else {
                " "
            };
            let _infallible = write!(event.result, "{gap}{value:02X}");
        }
        if meaning.fits == Some(false) {
            event.result.push_str(MISFIT);
        }
    }
}

/// A command or an answer that begins.
fn told(at: Instant, master: bool, whom: Party, process_data: bool) -> Event {
    let what = if process_data {
        "process data"
    } else {
        "a command"
    };
    let (kind, from, to) = if master {
        (EventKind::Job, Party::Master, whom)
    } else {
        (EventKind::Answer, whom, Party::Master)
    };
    Event {
        at,
        kind,
        from,
        to,
        what: what.to_owned(),
        bytes: Vec::new(),
        result: String::new(),
    }
}

/// Zeros, numbers and check sequences: bytes of a kind one after another are one event.
fn open_run(role: ByteRole, master: bool, at: Instant, events: &mut Vec<Event>) -> Option<usize> {
    let (kind, what) = match role {
        ByteRole::ErrorZero if master => (EventKind::Sequence, "zeros"),
        ByteRole::CheckSequence if master => (EventKind::Sequence, CHECK),
        ByteRole::CheckSequence => (EventKind::Sequence, "check sequence is back"),
        ByteRole::ErrorZero => (EventKind::Trouble, "zeros: a drive is in the error mode"),
        ByteRole::ErrorAddress => (EventKind::Trouble, "number spelled out"),
        ByteRole::Foreign => (EventKind::Trouble, "no telegram"),
        ByteRole::Lost => (EventKind::Trouble, "nothing arrived"),
        _ => return None,
    };
    let (from, to) = if master {
        (Party::Master, Party::Ring)
    } else {
        (Party::Ring, Party::Master)
    };
    let index = events.len().checked_sub(1);
    if let Some(index) =
        index.filter(|index| events[*index].what == what && events[*index].from == from)
    {
        return Some(index);
    }
    let what = what.to_owned();
    events.push(Event {
        at,
        kind,
        from,
        to,
        what,
        bytes: Vec::new(),
        result: String::new(),
    });
    Some(events.len() - 1)
}

/// Which jobs were answered: the n-th of a drive by its n-th answer. A check sequence makes every drive forget what it has
/// begun (ND21 9.8), so jobs in front of one are answered in front of it or not at all.
fn asked(events: &mut [Event]) {
    let sequence = |event: &&Event| event.from == Party::Master && event.what == CHECK;
    let sequences: Vec<_> = events
        .iter()
        .filter(sequence)
        .map(|event| event.at)
        .collect();
    let period = |at: Instant| sequences.iter().filter(|sequence| **sequence < at).count();
    let mut answers: BTreeMap<(Party, usize), Vec<usize>> = BTreeMap::new();
    for (index, event) in events.iter().enumerate() {
        if event.kind == EventKind::Answer {
            let key = (event.from, period(event.at));
            answers.entry(key).or_default().push(index);
        }
    }
    let mut next: BTreeMap<(Party, usize), usize> = BTreeMap::new();
    for index in 0..events.len() {
        let job = &events[index];
        if job.kind != EventKind::Job {
            continue;
        }
        let key = (job.to, period(job.at));
        let number = next.entry(key).or_default();
        let answer = answers.get(&key).and_then(|all| all.get(*number));
        *number += 1;
        let answer = answer.map(|answer| &events[*answer]);
        let result = match answer.filter(|answer| answer.bytes.len() == job.bytes.len()) {
            Some(answer) if answer.result.is_empty() => "answered".to_owned(),
            Some(answer) if answer.result.ends_with(MISFIT) => "no good answer".to_owned(),
            Some(answer) => format!("answered: {}", answer.result.trim_start()),
            None => "no whole answer".to_owned(),
        };
        events[index].result = result;
    }
    for event in events {
        if event.what == "number spelled out"
            && let Some(Some(number)) = event.bytes.last()
        {
            event.result = format!("drive {number} detected the error first");
        }
    }
}

fn faults(trace: &Trace, events: &mut Vec<Event>) {
    let damaged = |byte: &&LineByte| byte.sent != byte.received || byte.error.is_some();
    let mut all: Vec<_> = trace
        .channels
        .iter()
        .flat_map(|link| {
            link.octets()
                .iter()
                .filter(damaged)
                .map(move |byte| (link, byte))
        })
        .collect();
    all.sort_by_key(|(_, byte)| byte.at);
    let end = |end: Option<u8>| end.map_or(Party::Master, Party::Drive);
    let more = all.len().saturating_sub(FAULTS);
    for (number, (link, byte)) in all.into_iter().take(FAULTS).enumerate() {
        let hex = |byte: Option<u8>| byte.map_or("nothing".to_owned(), |b| format!("{b:02X}"));
        let mut result = format!("{} sent, {} received", hex(byte.sent), hex(byte.received));
        if byte.error.is_some() {
            let _infallible = write!(result, " ({})", status(byte));
        }
        if number + 1 == FAULTS && more > 0 {
            let _infallible = write!(result, "; {more} more damaged bytes");
        }
        events.push(Event {
            at: byte.at,
            kind: EventKind::Trouble,
            from: end(link.from),
            to: end(link.to),
            what: format!("fault on {}", name(0, link)),
            bytes: vec![byte.received],
            result,
        });
    }
}

/// The first drives that detected something, and when the last one was back.
fn remarks(trace: &Trace, events: &mut Vec<Event>) {
    let of = |wanted: Marks| {
        trace
            .remarks
            .iter()
            .filter(move |mark| mark.marks().contains(wanted))
    };
    let note = |at, drive, what: String, kind| Event {
        at,
        kind,
        from: Party::Drive(drive),
        to: Party::Drive(drive),
        what,
        bytes: Vec::new(),
        result: String::new(),
    };
    let more = of(Marks::DETECTED).count().saturating_sub(DETECTED);
    for (number, mark) in of(Marks::DETECTED).take(DETECTED).enumerate() {
        let mut what = format!("goes into the error mode: {}", remark(mark));
        if number + 1 == DETECTED && more > 0 {
            let _infallible = write!(what, "; and {more} times more, drives behind it");
        }
        events.push(note(mark.at, mark.station, what, EventKind::Trouble));
    }
    let back = of(Marks::RECOVERED);
    if let Some(last) = back.clone().next_back() {
        let what = format!("back in normal mode, the last of {}", back.count());
        events.push(note(last.at, last.station, what, EventKind::Sequence));
    }
}

fn hex(event: &Event) -> String {
    let mut text = String::new();
    for byte in event.bytes.iter().take(BYTES) {
        let gap = if text.is_empty() { "" } else { " " };
        let _infallible = match byte {
            Some(byte) => write!(text, "{gap}{byte:02X}"),
            None => write!(text, "{gap}--"),
        };
    }
    if event.bytes.len() > BYTES {
        let _infallible = write!(text, " ... ({} bytes)", event.bytes.len());
    }
    text
}

/// The participants with a lifeline: the master, the drives in the order of the ring, and one that stands for all others.
fn lifelines(drawn: &[Event]) -> Vec<Party> {
    let mut who: Vec<Party> = drawn
        .iter()
        .flat_map(|event| [event.from, event.to])
        .collect();
    who.sort_unstable_by_key(|who| match who {
        Party::Master => (0, 0),
        // As in a ring: the highest number stands next to the master.
        Party::Drive(drive) => (1, 255 - drive),
        Party::Ring => (2, 0),
    });
    who.dedup();
    let many = who.len() > LIFELINES;
    who.truncate(LIFELINES);
    if many || !who.contains(&Party::Ring) {
        who.retain(|one| *one != Party::Ring);
        who.push(Party::Ring);
    }
    who
}

/// Draws a lifeline for each participant and an arrow for each event.
fn picture(html: &mut Html, id: &str, events: &[Event]) {
    let drawn = &events[..events.len().min(DRAWN)];
    let who = lifelines(drawn);
    let x = |one: Party| {
        let place = who
            .iter()
            .position(|other| *other == one)
            .unwrap_or(who.len() - 1);
        TIMES + COLUMN / 2 + COLUMN * place
    };
    let words_at = TIMES + COLUMN * who.len() + 10;
    let letters = drawn.iter().map(|event| text(event).chars().count());
    let width = words_at + letters.max().unwrap_or(0) * LETTER + 10;
    let height = TOP + ROW * drawn.len() + 16;
    let words = "A line downwards for the master, for each drive that had a part, and for the ring; an arrow for each event. \
                 The table below says the same.";
    let title = "Sequence of jobs and answers";
    html.scroll("What was said, as a picture", |html| {
        html.picture(&format!("{id}-q"), (width, height), &title, words, |html| {
            for one in &who {
                let at = x(*one);
                html.line(
                    "text",
                    &[("class", &"m"), ("x", &at), ("y", &16)],
                    one.name(),
                );
                html.shape(
                    "path",
                    &[
                        ("class", &"zero"),
                        ("d", &format!("M{at} 22V{}", height - 8)),
                    ],
                );
            }
            for (row, event) in drawn.iter().enumerate() {
                arrow(
                    html,
                    event,
                    (x(event.from), x(event.to)),
                    TOP + ROW * row + 16,
                    words_at,
                );
            }
        });
    });
    if events.len() > DRAWN {
        let more = events.len() - DRAWN;
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{more} more events are not drawn."),
        );
    }
}

fn arrow(html: &mut Html, event: &Event, (from, to): (usize, usize), y: usize, words: usize) {
    let class = format!("arrow {}", event.kind.class());
    let d = if from == to {
        format!("M{} {}h10v8h-10z", from - 5, y - 4)
    } else if from < to {
        format!("M{from} {y}H{}M{to} {y}l-8 -4v8z", to - 4)
    } else {
        format!("M{from} {y}H{}M{to} {y}l8 -4v8z", to + 4)
    };
    html.shape("path", &[("class", &class), ("d", &d)]);
    for (class, x, said) in [
        ("e", TIMES - 10, event.at.to_string()),
        ("s", words, text(event)),
    ] {
        html.line(
            "text",
            &[("class", &class), ("x", &x), ("y", &(y + 4))],
            said,
        );
    }
}

/// What an event is, with its bytes.
fn text(event: &Event) -> String {
    let bytes = hex(event);
    let gap = if bytes.is_empty() { "" } else { ": " };
    format!("{}{gap}{bytes}", event.what)
}

fn table(html: &mut Html, events: &[Event]) {
    html.element("details", &[], |html| {
        html.line("summary", &[], "As a table");
        html.element("table", &[], |html| {
            html.line("caption", &[], "What was said, in order");
            html.heads(&["Time", "From", "To", "What", "Bytes", "Result"]);
            for event in events.iter().take(MOST) {
                html.element("tr", &[], |html| {
                    html.line("td", &[("class", &"n")], event.at);
                    html.line("td", &[], event.from.name());
                    html.line("td", &[], event.to.name());
                    html.line("td", &[], &event.what);
                    html.line("td", &[("class", &"n")], hex(event));
                    html.line("td", &[], event.result.trim());
                });
            }
        });
        if events.len() > MOST {
            let more = events.len() - MOST;
            html.line(
                "p",
                &[("class", &"note")],
                format_args!("{more} more events are not shown."),
            );
        }
    });
}
