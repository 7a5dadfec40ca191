//! A trace as a table: a row a frame.

use super::meaning;
use crate::language::identifier;
use harness_bench::capture::Piece;
use harness_bench::capture::live::{LiveLine, LiveText};
use harness_proto::can::Frame;
use harness_sim::record::{FrameEnd, LineFrame, Trace};
use std::fmt::Write as _;
use std::ops::Range;

/// Rows and how often each of them was repeated.
struct Row<'t> {
    first: &'t LineFrame,
    last: &'t LineFrame,
    times: usize,
}

/// The table. Frames that an error ended and that were repeated at once stand in one row. Of a table longer than `at_most` the middle is
/// left out.
#[must_use]
pub(crate) fn table(trace: &Trace, wanted: Option<Range<usize>>, at_most: Option<usize>) -> String {
    let frames = trace.channels.iter().flat_map(|channel| channel.frames());
    let mut rows: Vec<Row<'_>> = Vec::new();
    for frame in frames {
        match rows.last_mut() {
            Some(row) if repeats(row.last, frame) => {
                row.last = frame;
                row.times += 1;
            }
            _ => rows.push(Row {
                first: frame,
                last: frame,
                times: 1,
            }),
        }
    }
    let wanted = wanted.unwrap_or(0..rows.len());
    let wanted = wanted.start.min(rows.len())..wanted.end.min(rows.len());
    let rows = &rows[wanted];
    let shown = at_most.unwrap_or(usize::MAX).min(rows.len());
    let (head, tail) = (shown.div_ceil(2), shown / 2);
    let mut text = format!(
        "{:>14}  {:<9} {:<9} {:<24} meaning\n",
        "time", "from", "id", "bytes"
    );
    for row in &rows[..head] {
        text.push_str(&line(row));
    }
    if shown < rows.len() {
        let _infallible = writeln!(text, "{:>14}  {} more", "...", rows.len() - shown);
    }
    for row in &rows[rows.len() - tail..] {
        text.push_str(&line(row));
    }
    text
}

/// Whether a frame is the repetition of the one before it, and ended as that did.
fn repeats(before: &LineFrame, frame: &LineFrame) -> bool {
    let alike = (before.from, before.frame, before.ended) == (frame.from, frame.frame, frame.ended);
    alike && matches!(frame.ended, FrameEnd::Error(_))
}

fn line(row: &Row<'_>) -> String {
    format!("{:>14}  {}\n", row.first.at.to_string(), text(row))
}

/// The data bytes of a frame, or the length that a remote frame asks for.
pub(crate) fn hex(frame: &Frame) -> String {
    if frame.is_remote() {
        return format!("rtr {}", frame.dlc());
    }
    let bytes: Vec<_> = frame
        .data()
        .iter()
        .map(|byte| format!("{byte:02X}"))
        .collect();
    bytes.join(" ")
}

/// A row without its time.
fn text(row: &Row<'_>) -> String {
    let LineFrame {
        from, frame, ended, ..
    } = row.first;
    let sender = from.map_or("master".to_owned(), |drive| format!("drive {drive}"));
    let bytes = hex(frame);
    let end = match (ended, row.times) {
        (FrameEnd::Good, _) => String::new(),
        (FrameEnd::Lost, _) => "  [lost]".to_owned(),
        (FrameEnd::Error(error), 1) => format!("  [{error}]"),
        (FrameEnd::Error(error), times) => {
            format!("  [{error}, {times} times up to {}]", row.last.at)
        }
    };
    let text = format!(
        "{:<9} {:<9} {:<24} {}{end}",
        sender,
        identifier(frame.id()),
        bytes,
        meaning(frame, from.is_some())
    );
    text.trim_end().to_owned()
}

/// Text of the frames of one bus, while they arrive: the rows of the table.
pub(crate) struct FrameText;

impl LiveText for FrameText {
    fn piece(&mut self, piece: &Piece) -> Vec<LiveLine> {
        let Piece::Frame(frame) = piece else {
            return Vec::new();
        };
        let row = Row {
            first: frame,
            last: frame,
            times: 1,
        };
        vec![(frame.at.since_start().as_nanos(), text(&row))]
    }
}
