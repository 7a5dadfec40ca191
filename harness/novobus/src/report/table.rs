//! A trace as the manual's own table (ND21 9.7, 9.8): one column a drive with what it sent, row n the
//! n-th byte of each link, marks in front of the bytes, drives that are alike folded with `...`.
//!
//! A link on which something happened has a column of its own, headed `wire`: what its receiver read,
//! where that differs from what was sent (`--` for nothing, `~` behind a byte marked bad).

use harness_bench::shown::TablePart;
use harness_proto::novobus::error_mode::Marks;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// The legend of the marks, in the manual's words.
pub(crate) const LEGEND: &str = "\
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

/// Default number of rows shown of a table.
const ROWS: usize = 20_000;

#[must_use]
pub(crate) fn table(trace: &Trace, part: &TablePart) -> String {
    let rows = rows(trace, part);
    let mut columns = columns(trace, &rows);
    if let Some(pointed) = rows
        .iter()
        .position(|row| row.is_some() && *row == part.pointed)
    {
        bracket(&mut columns, pointed);
    }
    let mut shown = fold(&columns);
    if let Some(most) = part.columns_at_most.filter(|most| *most < shown.len()) {
        let half = most / 2;
        shown.splice(half..shown.len() - half, [None]);
    }
    let mut out = String::new();
    let mut line = |pointer: &str, number: &str, cell: &dyn Fn(&Column) -> &str| {
        let mut row = format!("{pointer:1}{number:>5}");
        for column in &shown {
            let text = match column {
                Some(column) => format!("  {:>1$}", cell(column), column.width),
                None => "  ...".to_owned(),
            };
            row.push_str(&text);
        }
        out.push_str(row.trim_end());
        out.push('\n');
    };
    line("", "byte", &|column| &column.head);
    for (place, row) in rows.iter().enumerate() {
        match row {
            None => line("", "...", &|_| "..."),
            Some(row) => {
                let pointer = if part.pointed == Some(*row) {
                    "→"
                } else {
                    ""
                };
                line(pointer, &(row + 1).to_string(), &|column| {
                    &column.cells[place].text
                });
            }
        }
    }
    out
}

/// The rows to show; `None` stands for rows left out.
fn rows(trace: &Trace, part: &TablePart) -> Vec<Option<usize>> {
    let all = trace
        .channels
        .iter()
        .map(|l| l.octets().len())
        .max()
        .unwrap_or(0);
    let wanted = part.rows.clone().unwrap_or(0..all);
    let wanted = wanted.start.min(all)..wanted.end.min(all);
    let most = part.at_most.unwrap_or(ROWS);
    if wanted.len() <= most {
        return wanted.map(Some).collect();
    }
    let half = most / 2;
    let head = wanted.start..wanted.start + half;
    let tail = wanted.end - half..wanted.end;
    head.map(Some).chain([None]).chain(tail.map(Some)).collect()
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Cell {
    text: String,
    byte: Option<u8>,
    signs: String,
}

struct Column {
    head: String,
    /// One a row that is shown.
    cells: Vec<Cell>,
    width: usize,
    /// A drive's column may be folded, the master's and a wire's may not.
    drive: bool,
}

impl Column {
    fn new(head: String, cells: Vec<Cell>, drive: bool) -> Self {
        let widest = cells.iter().map(|cell| cell.text.len()).max();
        Self {
            width: widest.unwrap_or(0).max(head.len()),
            head,
            cells,
            drive,
        }
    }
}

fn columns(trace: &Trace, rows: &[Option<usize>]) -> Vec<Column> {
    let mut columns = Vec::new();
    for link in &trace.channels {
        let cells = |cell: fn(&LineByte) -> Cell| -> Vec<Cell> {
            let byte = |row: &Option<usize>| row.and_then(|row| link.octets().get(row));
            rows.iter()
                .map(|row| byte(row).map(cell).unwrap_or_default())
                .collect()
        };
        let head = link.from.map_or("Master".to_owned(), |k| k.to_string());
        let mut sent = cells(sent);
        if let Some(drive) = link.from {
            sign(&mut sent, rows, trace, drive, link.octets());
        }
        columns.push(Column::new(head, sent, link.from.is_some()));
        if link.octets().iter().any(damaged) {
            columns.push(Column::new("wire".to_owned(), cells(arrived), false));
        }
    }
    columns
}

/// Marks what arrived at the master: in the last column, or in the one before where the wire behind it
/// left the byte alone. Nothing is marked where nothing arrived.
fn bracket(columns: &mut [Column], place: usize) {
    let wire = columns.last().is_some_and(|column| !column.drive);
    let ends = if wire { 2 } else { 1 };
    let mut last = columns.iter_mut().rev().take(ends);
    let arrived = last.find(|column| !column.cells[place].text.is_empty());
    if let Some(column) = arrived {
        let text = &mut column.cells[place].text;
        *text = format!("[{text}]");
        column.width = column.width.max(text.len());
    }
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

/// Marks as they are printed.
pub(crate) fn signs(marks: Marks) -> String {
    let signs = SIGNS.into_iter().filter(|(mark, _)| marks.contains(*mark));
    signs.map(|(_, sign)| sign).collect()
}

/// Puts a drive's marks in front of the bytes that it sent at them. A mark at which nothing went out (a
/// time-out) stands at the next byte.
fn sign(cells: &mut [Cell], rows: &[Option<usize>], trace: &Trace, drive: u8, bytes: &[LineByte]) {
    let sent: Vec<_> = (0..bytes.len())
        .filter(|i| bytes[*i].sent.is_some())
        .collect();
    for mark in trace.remarks.iter().filter(|mark| mark.station == drive) {
        let row = match mark.answered_as {
            Some(number) => usize::try_from(number - 1).ok().and_then(|i| sent.get(i)),
            None => {
                let next = sent.partition_point(|i| bytes[*i].at <= mark.at);
                sent.get(next)
            }
        };
        let Some(row) = row else { continue };
        let Some(place) = rows.iter().position(|shown| shown.as_ref() == Some(row)) else {
            continue;
        };
        for sign in signs(mark.marks()).chars() {
            if !cells[place].signs.contains(sign) {
                cells[place].signs.push(sign);
            }
        }
    }
    for cell in cells.iter_mut().filter(|cell| !cell.signs.is_empty()) {
        cell.text.insert_str(0, &cell.signs);
    }
}

/// `None` stands for drives left out: all between two that are shown differ from their neighbours in
/// the same way, byte for byte, in the rows that are shown.
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
    left.cells
        .iter()
        .zip(&right.cells)
        .map(|(l, r)| {
            let step = r.byte.unwrap_or(0).wrapping_sub(l.byte.unwrap_or(0));
            let alike = l.signs == r.signs && l.byte.is_some() == r.byte.is_some();
            (alike && step <= 1).then_some(step)
        })
        .collect()
}

/// What happened on the wires, a line each.
#[must_use]
pub(crate) fn wires(trace: &Trace, at_most: usize) -> String {
    let mut out = String::new();
    let mut more = 0usize;
    let name = |end: Option<u8>| end.map_or("master".to_owned(), |k| k.to_string());
    let mut lines = 0;
    for link in &trace.channels {
        for (index, byte) in link.octets().iter().enumerate().filter(|(_, b)| damaged(b)) {
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
