//! A trace as comma-separated values: one row a byte, in order of time.
//!
//! | column | meaning |
//! |---|---|
//! | `ring` | 1 or 2 |
//! | `t_ns` | when the byte's stop bit had passed, in nanoseconds since the start, cut off below |
//! | `link` | `98->97` |
//! | `n` | the byte's place on its link, counted from 1 |
//! | `sent`, `received` | hexadecimal; empty for nothing |
//! | `status` | `ok`, `parity`, `framing`, `break`, `overrun` or `dropped` |
//! | `role` | what the byte is: `sync`, `address`, `data` ... |
//! | `drive` | the number of the addressed drive |
//! | `meaning` | the same in words |
//! | `section` | the section of the rule in the ND21 manual |
//! | `mark` | what the sender remarked: `detected`, with the cause, `upstream`, `seventeenth`, `sequence`, `recovered` |

use super::walk::{ByteSeen, LinkReader};
use harness_bench::report::pcapng::name;
use harness_bench::traffic::in_time;
use harness_proto::novobus::error_mode::Marks;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::{Remark, Trace};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write;

/// The first line.
pub(crate) const HEADING: &str =
    "ring,t_ns,link,n,sent,received,status,role,drive,meaning,section,mark\n";

/// Writes one or two rings of a run, one after the other.
///
/// # Errors
/// What the writer says.
pub(crate) fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    out.write_all(HEADING.as_bytes())?;
    // A row is written at once: each of its fields would be a call.
    let mut row = String::new();
    for (ring, trace) in traces.iter().enumerate() {
        let names: Vec<_> = trace.channels.iter().map(|link| name(ring, link)).collect();
        let mut readers = LinkReader::all(trace);
        for (place, index) in in_time(&trace.channels) {
            let byte = &trace.channels[place].octets()[index];
            let seen = readers[place].see(byte);
            let drive = seen.meaning.drive;
            row.clear();
            // Text is pushed, since formatting costs more than what is formatted.
            let _infallible = write!(
                row,
                "{},{},{},{},",
                ring + 1,
                byte.at.since_start().as_nanos(),
                names[place],
                index + 1
            );
            for byte in [byte.sent, byte.received] {
                let _infallible = byte.map(|byte| write!(row, "{byte:02X}"));
                row.push(',');
            }
            for word in [status(byte), seen.meaning.role.name()] {
                row.push_str(word);
                row.push(',');
            }
            let _infallible = drive.map(|drive| write!(row, "{drive}"));
            let words = words(&seen, byte);
            let mark = seen.mark.map_or_else(String::new, remark);
            for text in [&quoted(&words), seen.meaning.section(), &mark] {
                row.push(',');
                row.push_str(text);
            }
            row.push('\n');
            out.write_all(row.as_bytes())?;
        }
    }
    out.flush()
}

/// What the receiver noticed, in a word.
#[must_use]
pub(crate) fn status(byte: &LineByte) -> &'static str {
    match (byte.received, byte.error) {
        (None, _) => "dropped",
        (_, None) => "ok",
        (_, Some(error)) => error.name(),
    }
}

pub(crate) fn words(seen: &ByteSeen<'_>, byte: &LineByte) -> String {
    seen.meaning.words(byte.received)
}

/// What a drive remarked, in a word or two.
pub(crate) fn remark(mark: &Remark) -> String {
    const WORDS: [(Marks, &str); 5] = [
        (Marks::DETECTED, "detected"),
        (Marks::UPSTREAM, "upstream"),
        (Marks::SEVENTEENTH, "seventeenth"),
        (Marks::SEQUENCE, "sequence"),
        (Marks::RECOVERED, "recovered"),
    ];
    let mut text = String::new();
    for (flag, word) in WORDS {
        if mark.marks().contains(flag) {
            if !text.is_empty() {
                text.push(' ');
            }
            text.push_str(word);
            if let Some(cause) = mark.cause().filter(|_| flag == Marks::DETECTED) {
                text.push(' ');
                text.push_str(cause.name());
            }
        }
    }
    text
}

/// RFC 4180: a field with a comma is quoted.
fn quoted(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}
