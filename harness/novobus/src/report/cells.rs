//! The bytes of a diagram, and equal neighbours put together.

use super::csv::{remark, status};
use super::picture::MAX_ROWS;
use super::walk::{LinkReader, SenderState};
use harness_bench::shown::RowPlacing;
use harness_proto::novobus::error_mode::Marks;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::Trace;
use std::ops::Range;

/// One byte of one link.
#[derive(Clone, Debug, PartialEq, Eq)]
struct LinkCell {
    at: u64,
    state: SenderState,
    /// What was sent and what arrived.
    status: String,
    letters: String,
    words: String,
    section: &'static str,
    remark: String,
    fault: bool,
}

impl LinkCell {
    /// Whether two bytes are shown alike.
    fn like(&self, other: &Self) -> bool {
        !self.fault
            && !other.fault
            && self.remark == other.remark
            && (self.state, &self.status, &self.words) == (other.state, &other.status, &other.words)
    }
}

/// The bytes that are to be drawn, link by link.
pub(crate) struct Columns {
    /// The first row.
    first: usize,
    links: Vec<Vec<LinkCell>>,
    /// Whether rows were left out.
    pub(crate) cut: bool,
}

impl Columns {
    /// Reads the rows wanted of a trace.
    pub(crate) fn read(trace: &Trace, rows: Option<Range<usize>>) -> Self {
        let all = trace
            .channels
            .iter()
            .map(|l| l.octets().len())
            .max()
            .unwrap_or(0);
        let rows = rows.unwrap_or(0..all);
        let wanted = rows.start.min(all)..rows.end.min(all);
        let end = wanted.end.min(wanted.start + MAX_ROWS);
        let mut links = Vec::new();
        for (link, mut reader) in trace.channels.iter().zip(LinkReader::all(trace)) {
            let mut cells = Vec::new();
            for (row, byte) in link.octets().iter().enumerate().take(end) {
                let seen = reader.see(byte);
                if row < wanted.start {
                    continue;
                }
                let marked = seen.mark.map_or_else(String::new, remark);
                let detected =
                    |mark: &harness_sim::record::Remark| mark.marks().contains(Marks::DETECTED);
                cells.push(LinkCell {
                    at: byte.at.since_start().units(),
                    state: seen.state,
                    status: carried(byte),
                    letters: byte
                        .received
                        .map_or("--".to_owned(), |byte| format!("{byte:02X}")),
                    words: seen.sent.words(byte.sent),
                    section: seen.sent.section(),
                    remark: marked,
                    fault: byte.sent != byte.received
                        || byte.error.is_some()
                        || seen.mark.is_some_and(detected),
                });
            }
            links.push(cells);
        }
        Self {
            first: wanted.start,
            links,
            cut: wanted.end > end,
        }
    }
}

/// A byte, and what happened to it on its way.
fn carried(byte: &LineByte) -> String {
    let hex = |byte: Option<u8>| byte.map_or("nothing".to_owned(), |b| format!("{b:02X}"));
    if byte.sent == byte.received && byte.error.is_none() {
        return hex(byte.received);
    }
    let sent = hex(byte.sent);
    match byte.received {
        None => format!("{sent} sent, nothing received"),
        Some(_) if byte.error.is_none() => format!("{sent} sent, {} received", hex(byte.received)),
        Some(_) => {
            let error = status(byte);
            format!("{sent} sent, {} received ({error})", hex(byte.received))
        }
    }
}

/// Bytes that are drawn as one.
#[derive(Clone, Debug)]
pub(crate) struct Area {
    pub(crate) links: Range<usize>,
    pub(crate) rows: Range<usize>,
    /// When the first one and the last one had passed.
    pub(crate) from: u64,
    pub(crate) to: u64,
    pub(crate) state: SenderState,
    pub(crate) status: String,
    pub(crate) letters: String,
    pub(crate) words: String,
    pub(crate) section: &'static str,
    pub(crate) remark: String,
    pub(crate) fault: bool,
}

/// Every byte is in one area; side by side only where rows are aligned. In order of rows.
pub(crate) fn areas(columns: &Columns, scale: RowPlacing) -> Vec<Area> {
    let links = &columns.links;
    let height = links.iter().map(Vec::len).max().unwrap_or(0);
    let mut taken: Vec<Vec<bool>> = links.iter().map(|l| vec![false; l.len()]).collect();
    let mut areas = Vec::new();
    for row in 0..height {
        for link in 0..links.len() {
            let Some(cell) = links[link].get(row).filter(|_| !taken[link][row]) else {
                continue;
            };
            let free = |link: usize, row: usize| {
                links[link].get(row).is_some_and(|other| cell.like(other)) && !taken[link][row]
            };
            let mut end = link + 1;
            while scale == RowPlacing::Index && end < links.len() && free(end, row) {
                end += 1;
            }
            let mut below = row + 1;
            while (link..end).all(|link| free(link, below) && near(columns, scale, link, below)) {
                below += 1;
            }
            for column in &mut taken[link..end] {
                column[row..below].fill(true);
            }
            let last = links[end - 1]
                .get(below - 1)
                .map_or(cell.at, |last| last.at);
            areas.push(Area {
                links: link..end,
                rows: columns.first + row..columns.first + below,
                from: cell.at,
                to: last.max(links[link].get(below - 1).map_or(0, |last| last.at)),
                state: cell.state,
                status: cell.status.clone(),
                letters: cell.letters.clone(),
                words: cell.words.clone(),
                section: cell.section,
                remark: cell.remark.clone(),
                fault: cell.fault,
            });
        }
    }
    areas
}

/// By time, bytes with a gap between them are not drawn as one.
fn near(columns: &Columns, scale: RowPlacing, link: usize, row: usize) -> bool {
    const LONGEST: u64 = 2 * 11 * 312_500;
    let at = |row: usize| columns.links[link].get(row).map_or(0, |cell| cell.at);
    scale == RowPlacing::Index || at(row).saturating_sub(at(row - 1)) < LONGEST
}
