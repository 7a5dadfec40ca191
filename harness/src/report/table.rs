//! A trace as the manual's own table (ND21 9.7, 9.8): one column a drive with what it sent, row n the
//! n-th byte of each link, marks in front of the bytes, drives that are alike folded with `...`.
//!
//! A link on which something happened has a column of its own, headed `wire`: what its receiver read,
//! where that differs from what was sent (`--` for nothing, `~` behind a byte marked bad).

use harness_proto::novobus::error_mode::Marks;
use harness_sim::link::LineByte;
use harness_sim::trace::Trace;
use std::fmt::Write as _;
use std::ops::Range;

/// The legend of the marks, in the manual's words.
pub const LEGEND: &str = "\
>: answer byte (contents of the memory cell)   +: new check sum   !: the drive detects an error
*: it detects that the preceding drive is in error mode   #: the 17th sent zero byte
@: the first byte of the check sequence   wire: what arrived where it differs (-- nothing, ~ marked bad)
";

/// Marks in the order in which they are printed.
const SIGNS: [(Marks, char); 6] = [
    (Marks::DETECTED, '!'),
    (Marks::UPSTREAM, '*'),
    (Marks::SEVENTEENTH, '#'),
    (Marks::SEQUENCE, '@'),
    (Marks::ANSWER, '>'),
    (Marks::CHECKSUM, '+'),
];

/// A run of drives shorter than this is not folded.
const FOLD: usize = 4;

/// What part of a table is wanted.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// The rows, counted from 0; all where `None`.
    pub rows: Option<Range<usize>>,
    /// A row that is pointed at, counted from 0.
    pub pointed: Option<usize>,
    /// Rows shown at most; of a longer table the middle is left out.
    pub at_most: Option<usize>,
    /// Columns shown at most; of a wider table the middle is left out.
    pub columns_at_most: Option<usize>,
}

/// A trace as a table.
#[must_use]
pub fn table(trace: &Trace, part: &Part) -> String {
    let columns = columns(trace);
    let mut shown = fold(&columns);
    if let Some(most) = part.columns_at_most.filter(|most| *most < shown.len()) {
        let half = most / 2;
        shown.splice(half..shown.len() - half, [None]);
    }
    let all = columns.iter().map(|c| c.cells.len()).max().unwrap_or(0);
    let rows = part.rows.clone().unwrap_or(0..all);
    let rows = rows.start.min(all)..rows.end.min(all);
    let width = |column: &Column| {
        let cells = column.cells.get(rows.clone()).unwrap_or(&column.cells);
        let widest = cells.iter().map(|cell| cell.text.len()).max();
        widest.unwrap_or(0).max(column.head.len())
    };
    let mut out = String::new();
    let mut line = |number: &str, pointer: &str, cell: &dyn Fn(&Column) -> String| {
        let mut row = format!("{pointer:1}{number:>5}");
        for shown in &shown {
            let text = match shown {
                Some(column) => format!("  {:>1$}", cell(column), width(column)),
                None => "  ...".to_owned(),
            };
            row.push_str(&text);
        }
        out.push_str(row.trim_end());
        out.push('\n');
    };
    line("byte", "", &|column| column.head.clone());
    let half = part.at_most.map_or(usize::MAX, |most| most / 2);
    let skipped = if rows.len() / 2 > half {
        rows.start + half..rows.end - half
    } else {
        0..0
    };
    for row in rows.clone() {
        if row == skipped.start && !skipped.is_empty() {
            line("...", "", &|_| "...".to_owned());
        }
        if skipped.contains(&row) {
            continue;
        }
        let pointer = if part.pointed == Some(row) { ">" } else { "" };
        line(&(row + 1).to_string(), pointer, &|column| {
            column
                .cells
                .get(row)
                .map(|cell| cell.text.clone())
                .unwrap_or_default()
        });
    }
    out
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Cell {
    text: String,
    byte: Option<u8>,
    signs: String,
}

struct Column {
    head: String,
    cells: Vec<Cell>,
    /// A drive's column may be folded, the master's and a wire's may not.
    drive: bool,
}

fn columns(trace: &Trace) -> Vec<Column> {
    let mut columns = Vec::new();
    for link in &trace.links {
        let head = link.from.map_or("Master".to_owned(), |k| k.to_string());
        let mut cells: Vec<_> = link.bytes.iter().map(sent).collect();
        if let Some(drive) = link.from {
            sign(&mut cells, trace, drive, &link.bytes);
        }
        columns.push(Column {
            head,
            cells,
            drive: link.from.is_some(),
        });
        if link.bytes.iter().any(damaged) {
            columns.push(Column {
                head: "wire".to_owned(),
                cells: link.bytes.iter().map(arrived).collect(),
                drive: false,
            });
        }
    }
    columns
}

fn sent(byte: &LineByte) -> Cell {
    Cell {
        text: byte.sent.map(|b| format!("{b:02X}")).unwrap_or_default(),
        byte: byte.sent,
        signs: String::new(),
    }
}

fn damaged(byte: &LineByte) -> bool {
    byte.sent != byte.received || byte.error.is_some()
}

fn arrived(byte: &LineByte) -> Cell {
    let text = match byte.received {
        _ if !damaged(byte) => String::new(),
        None => "--".to_owned(),
        Some(received) if byte.error.is_some() => format!("{received:02X}~"),
        Some(received) => format!("{received:02X}"),
    };
    Cell {
        text,
        ..Cell::default()
    }
}

/// Puts a drive's marks in front of the bytes that it sent at them. A mark at which nothing went out (a
/// time-out) stands at the next byte.
fn sign(cells: &mut [Cell], trace: &Trace, drive: u8, bytes: &[LineByte]) {
    let sent: Vec<_> = (0..bytes.len())
        .filter(|i| bytes[*i].sent.is_some())
        .collect();
    for mark in trace.marks.iter().filter(|mark| mark.drive == drive) {
        let place = match mark.answered_as {
            Some(number) => usize::try_from(number - 1).ok().and_then(|i| sent.get(i)),
            None => sent.iter().find(|i| bytes[**i].at > mark.at),
        };
        let Some(cell) = place.and_then(|i| cells.get_mut(*i)) else {
            continue;
        };
        for (marks, sign) in SIGNS {
            if mark.marks.contains(marks) && !cell.signs.contains(sign) {
                cell.signs.push(sign);
            }
        }
    }
    for cell in cells.iter_mut().filter(|cell| !cell.signs.is_empty()) {
        cell.text.insert_str(0, &cell.signs);
    }
}

/// `None` stands for drives left out: all between two that are shown differ from their neighbours in
/// the same way, byte for byte.
fn fold(columns: &[Column]) -> Vec<Option<&Column>> {
    let mut shown = Vec::new();
    let mut at = 0;
    while at < columns.len() {
        let mut end = at + 1;
        if columns[at].drive && at + 1 < columns.len() && columns[at + 1].drive {
            let step = difference(&columns[at], &columns[at + 1]);
            while let Some(step) = &step
                && end < columns.len()
                && columns[end].drive
                && difference(&columns[end - 1], &columns[end]).as_ref() == Some(step)
            {
                end += 1;
            }
        }
        shown.push(Some(&columns[at]));
        if end - at >= FOLD {
            shown.push(None);
            // The last of the run is the first to be looked at again.
            at = end - 1;
        } else {
            at += 1;
        }
    }
    shown
}

/// By how much each byte of two neighbours differs: 0 or 1, as addresses do; `None` where they are not
/// alike.
fn difference(left: &Column, right: &Column) -> Option<Vec<u8>> {
    if left.cells.len() != right.cells.len() {
        return None;
    }
    left.cells
        .iter()
        .zip(&right.cells)
        .map(|(l, r)| {
            let step = r.byte.unwrap_or(0).wrapping_sub(l.byte.unwrap_or(0));
            (l.signs == r.signs && step <= 1).then_some(step)
        })
        .collect()
}

/// What happened on the wires, a line each.
#[must_use]
pub fn wires(trace: &Trace, at_most: usize) -> String {
    let mut out = String::new();
    let mut more = 0usize;
    let name = |end: Option<u8>| end.map_or("master".to_owned(), |k| k.to_string());
    let mut lines = 0;
    for link in &trace.links {
        for (index, byte) in link.bytes.iter().enumerate().filter(|(_, b)| damaged(b)) {
            lines += 1;
            if lines > at_most {
                more += 1;
                continue;
            }
            let hex = |b: Option<u8>| b.map_or("nothing".to_owned(), |b| format!("{b:02X}"));
            let error = byte.error.map(|e| format!(" ({e})")).unwrap_or_default();
            // Writing to a String cannot fail.
            let _infallible = writeln!(
                out,
                "{}->{} byte {}: {} sent, {}{error} received",
                name(link.from),
                name(link.to),
                index + 1,
                hex(byte.sent),
                hex(byte.received),
            );
        }
    }
    if more > 0 {
        let _infallible = writeln!(out, "and {more} more");
    }
    out
}
