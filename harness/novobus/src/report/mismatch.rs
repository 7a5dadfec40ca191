//! A finding, shown as the manual's table with the first byte that differs, expected beside received.

use crate::report::table::{LEGEND, table};
use harness_bench::scenario::run::{ByteDifference, Mismatch};
use harness_bench::shown::{TablePart, see};
use harness_proto::line::Received;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// Rows of the table shown before and behind the one that differs.
const AROUND: usize = 6;
/// Columns of the table shown at most.
const COLUMNS: usize = 20;
/// Bytes of a line shown before and behind the one that differs.
const BYTES_AROUND: usize = 8;

/// The bytes of a finding, expected beside received, and the part of the table around them.
#[must_use]
pub(crate) fn mismatch(finding: &Mismatch, traces: &[Trace], sources: &[String]) -> String {
    let mut out = String::new();
    let Some(difference) = &finding.difference else {
        return out;
    };
    out.push_str(&beside(difference));
    let Some(trace) = traces.get(difference.ring) else {
        return out;
    };
    let row = row_of(trace, difference.byte);
    let part = TablePart {
        rows: Some(row.saturating_sub(AROUND)..row + AROUND + 1),
        pointed: Some(row),
        columns_at_most: Some(COLUMNS),
        ..TablePart::default()
    };
    // Writing to a String cannot fail.
    let _infallible = write!(out, "\n{}\n{LEGEND}", table(trace, &part));
    out + &see(sources)
}

/// The row of the master's `byte`-th received byte: bytes that were lost on the last link have rows
/// too.
fn row_of(trace: &Trace, byte: usize) -> usize {
    let Some(last) = trace.channels.last() else {
        return 0;
    };
    let arrived = (0..last.octets().len()).filter(|i| last.octets()[*i].received.is_some());
    arrived
        .skip(byte.saturating_sub(1))
        .chain(std::iter::once(last.octets().len()))
        .next()
        .unwrap_or(0)
}

/// ```text
/// expected  88 5F C0 13 88 A5
/// received  88 5F C0 13 89 A4
///                       ^^ byte 5 at the master
/// ```
fn beside(difference: &ByteDifference) -> String {
    let from = difference.index.saturating_sub(BYTES_AROUND);
    let to = difference.index + BYTES_AROUND + 1;
    let mut lines = [
        String::from("expected  "),
        String::from("received  "),
        " ".repeat(10),
    ];
    if from > 0 {
        for (line, dots) in lines.iter_mut().zip(["... ", "... ", "    "]) {
            line.push_str(dots);
        }
    }
    for index in from..to {
        let expected = difference.expected.get(index).map(|e| e.to_string());
        let received = difference.received.get(index).map(Received::to_string);
        let (expected, received) = match (expected, received) {
            (None, None) => break,
            (expected, received) => (
                expected.unwrap_or("--".to_owned()),
                received.unwrap_or("--".to_owned()),
            ),
        };
        let width = expected.len().max(received.len());
        let arrow = if index == difference.index { "^" } else { " " };
        let cells = [expected, received, arrow.repeat(width)];
        for (line, cell) in lines.iter_mut().zip(cells) {
            let _infallible = write!(line, "{cell:width$} ");
        }
    }
    let [expected, received, arrows] = lines;
    format!(
        "{}\n{}\n{} byte {} at the master\n",
        expected.trim_end(),
        received.trim_end(),
        arrows.trim_end(),
        difference.byte
    )
}
