//! What the links of served rings have carried, as rows of a space-time picture: a column a link, a row a byte time.

use crate::link::BesideTheBus as _;
use crate::locate::{Location, MAX_ZEROS, locate};
use crate::report::table::signs;
use harness_bench::counted::counted;
use harness_bench::link::{Link, link_name};
use harness_bench::web::{LiveCell, LivePicture, LiveRow, MAX_CELLS, MAX_ROWS};
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::{SequenceProgress, SequenceWatch};
use harness_proto::novobus::error_mode::Marks;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::{LineByte, Remark};
use std::collections::BTreeMap;

/// Byte times for which rows are kept until they are fetched, at most: more than a second of them.
const MAX_SLOTS: usize = 4096;

/// How many of the bytes that the master received are kept at least, to read which drive the ring spells out.
const HEARD: usize = 4 * MAX_ZEROS;

/// What a link has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LinkCount {
    pub(super) bytes: u64,
    /// Bytes other than SYNCO.
    pub(super) busy: u64,
    /// Bytes that arrived damaged or not at all.
    pub(super) damaged: u64,
}

/// What all links have carried since a page was opened.
#[derive(Clone, Debug)]
pub(crate) struct Recorder {
    byte: Span,
    /// The drives of each ring, and its first column.
    rings: Vec<(u8, usize)>,
    /// By the number of the byte time in which a byte arrived.
    slots: BTreeMap<u64, Vec<LinkByte>>,
    counts: Vec<LinkCount>,
    /// How many of the bytes that were sent on each link have been taken, as remarks count them.
    delivered: Vec<u64>,
    /// Remarks whose byte has not been taken yet.
    remarks: Vec<(usize, Remark)>,
    masters: Vec<MasterEar>,
    notes: Vec<String>,
    left_out: u64,
}

/// A byte of a link.
#[derive(Clone, Copy, Debug)]
struct LinkByte {
    column: usize,
    byte: LineByte,
    /// What its sender remarked.
    marks: Marks,
}

/// Rows that are complete.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    pub(crate) rows: Vec<LiveRow>,
    pub(crate) left_out: u64,
    pub(crate) notes: Vec<String>,
}

/// The names of all links, in the order of the columns.
pub(crate) fn links(sizes: &[u8]) -> Vec<String> {
    let rings = sizes.iter().enumerate();
    rings
        .flat_map(|(ring, drives)| {
            (0..=usize::from(*drives)).map(move |link| link_name(ring, *drives, link))
        })
        .collect()
}

/// The picture of these links.
pub(crate) fn picture(columns: Vec<String>) -> LivePicture {
    LivePicture {
        heading: "Bytes in space and time",
        note: "A column is a link, a row is one byte time, and time goes down: a byte moves one link to the right with each row. \
               The master sends on the first link and receives from the last one. Marks in front of a byte are those of the print: ! its sender \
               detects an error, * it has seen that the drive before it is in the error mode, # this is its 17th zero, @ the first byte of the \
               check sequence, > an answer byte, + a new checking byte. Only simulated drives show them.",
        columns,
        folded: ["byte time", "byte times"],
        legend: vec![
            ('d', "a byte"),
            ('s', "SYNCO (80)"),
            ('z', "a zero: the sender may be in the error mode (9.7)"),
            (
                'x',
                "damaged: sent \u{2192} arrived; ~ marked bad, -- nothing",
            ),
            (
                'c',
                "cut open by --cut: its client hears and feeds it, which is not shown",
            ),
        ],
    }
}

impl Recorder {
    /// Records rings of these sizes, whose bytes take `byte`.
    pub(crate) fn new(sizes: &[u8], byte: Span) -> Self {
        let mut columns = 0;
        let ring = |drives: &u8| {
            let first = columns;
            columns += usize::from(*drives) + 1;
            (*drives, first)
        };
        let rings: Vec<_> = sizes.iter().map(ring).collect();
        Self {
            byte,
            counts: vec![LinkCount::default(); columns],
            delivered: vec![0; columns],
            remarks: Vec::new(),
            masters: vec![MasterEar::default(); rings.len()],
            notes: Vec::new(),
            rings,
            slots: BTreeMap::new(),
            left_out: 0,
        }
    }

    /// Counts bytes as the remarks of simulated drives do. Recording has just begun.
    pub(crate) fn count_from(&mut self, link: &(impl Link + ?Sized)) {
        for (ring, (drives, first)) in self.rings.iter().enumerate() {
            for place in 0..=usize::from(*drives) {
                let delivered = link.delivered(ring, place);
                self.delivered[first + place] = delivered.unwrap_or(0);
            }
        }
    }

    /// Takes what the drives of a ring have remarked, before the bytes at which it stands.
    pub(crate) fn remark(&mut self, ring: usize, remarks: &[Remark]) {
        let Some(&(drives, first)) = self.rings.get(ring) else {
            return;
        };
        if self.remarks.len() + remarks.len() > MAX_SLOTS {
            // Of links that carry nothing, or are not heard.
            self.remarks.clear();
        }
        for remark in remarks {
            // The link behind the drive.
            let link = usize::from(drives.saturating_sub(remark.station));
            self.remarks.push((first + link, *remark));
        }
    }

    /// What the sender of a byte remarked at it. A remark without an answer stands at the next byte.
    fn marks(&mut self, column: usize, byte: &LineByte) -> Marks {
        let Some(number) = self
            .delivered
            .get_mut(column)
            .filter(|_| byte.sent.is_some())
        else {
            return Marks::NONE;
        };
        *number += 1;
        let number = *number;
        let mut marks = Marks::NONE;
        self.remarks.retain(|(place, remark)| {
            let meant = *place == column
                && match remark.answered_as {
                    Some(answer) => answer == number,
                    None => remark.at < byte.at,
                };
            if meant {
                marks = marks.and(remark.marks());
            }
            !meant
        });
        marks
    }

    /// Takes what a link has carried.
    pub(crate) fn carry(&mut self, ring: usize, link: usize, bytes: &[LineByte]) {
        let Some(&(drives, first)) = self.rings.get(ring) else {
            return;
        };
        let column = first + link;
        for byte in bytes {
            if let Some(count) = self.counts.get_mut(column) {
                count.bytes += 1;
                count.busy += u64::from(byte.sent != Some(SYNCO));
                count.damaged += u64::from(is_damaged(byte));
            }
            let slot = byte.at.since_start().units() / self.byte.units().max(1);
            let marks = self.marks(column, byte);
            let seen = LinkByte {
                column,
                byte: *byte,
                marks,
            };
            self.slots.entry(slot).or_default().push(seen);
            if self.slots.len() > MAX_SLOTS {
                self.slots.pop_first();
                self.left_out += 1;
            }
            if link == usize::from(drives)
                && let Some(received) = byte.arrival()
                && let Some(location) = self.masters[ring].hear(received, drives)
            {
                self.notes.push(note(ring, drives, location));
            }
        }
    }

    /// What each link has carried, in the order of the columns.
    pub(super) fn counts(&self) -> &[LinkCount] {
        &self.counts
    }

    /// The rows of byte times that are over at `now`, the newest of them within the bounds of a picture. Those in which links carried SYNCO
    /// or nothing are folded.
    pub(crate) fn rows(&mut self, now: Instant) -> Rows {
        let over = now.since_start().units() / self.byte.units().max(1);
        let rest = self.slots.split_off(&over);
        let slots = std::mem::replace(&mut self.slots, rest);
        let (mut busy, mut cells) = (0, 0);
        let shown = slots.values().rev().take_while(|seen| {
            if !is_idle(seen) {
                busy += 1;
                cells += seen.len();
            }
            busy <= MAX_ROWS && cells <= MAX_CELLS
        });
        let hidden = slots.len() - shown.count();
        let mut rows: Vec<LiveRow> = Vec::new();
        for (slot, seen) in slots.iter().skip(hidden) {
            let at = (Instant::START + self.byte * (slot + 1)).to_string();
            match rows.last_mut() {
                Some(row) if is_idle(seen) && row.fold > 0 => row.fold += 1,
                _ if is_idle(seen) => rows.push(LiveRow {
                    at,
                    words: "SYNCO only".to_owned(),
                    fold: 1,
                    ..LiveRow::default()
                }),
                _ => rows.push(LiveRow {
                    at,
                    cells: seen.iter().map(cell).collect(),
                    ..LiveRow::default()
                }),
            }
        }
        Rows {
            rows,
            left_out: std::mem::take(&mut self.left_out) + hidden as u64,
            notes: std::mem::take(&mut self.notes),
        }
    }
}

/// What the master of a ring has received since the last check sequence, and the drive that it was found to spell out.
#[derive(Clone, Debug, Default)]
struct MasterEar {
    heard: Vec<Received>,
    watch: SequenceWatch,
    named: Option<u8>,
}

impl MasterEar {
    /// Takes a byte. Returns the drive that the ring spells out, once it is sure (ND21 9.7).
    fn hear(&mut self, byte: Received, drives: u8) -> Option<Location> {
        if self.watch.see(byte.byte, byte.error.is_none()) == SequenceProgress::Complete {
            self.heard.clear();
            self.named = None;
            return None;
        }
        if self.heard.len() >= 2 * HEARD {
            self.heard.drain(..HEARD);
        }
        self.heard.push(byte);
        let Some(location) = locate(&self.heard, drives) else {
            self.named = None;
            return None;
        };
        let news = location.sure && self.named != Some(location.drive);
        if location.sure {
            self.named = Some(location.drive);
        }
        news.then_some(location)
    }
}

fn note(ring: usize, drives: u8, location: Location) -> String {
    let drive = location.drive;
    let prefix = if ring == 0 { "" } else { "2:" };
    let link = link_name(ring, drives, usize::from(drives - 1 - drive));
    let zeros = location.zeros.map_or(String::new(), |zeros| {
        format!(" behind {}", counted(zeros, "zero"))
    });
    format!(
        "Address {drive:02X} has reached the master{zeros}: drive {prefix}{drive} was the first to detect an error, in what came over link \
         {link} (ND21 9.7)."
    )
}

/// Whether links carried nothing but whole SYNCO.
fn is_idle(cells: &[LinkByte]) -> bool {
    let mut cells = cells.iter();
    cells.all(|seen| {
        let plain = seen.byte.sent == Some(SYNCO) && !is_damaged(&seen.byte);
        plain && seen.marks == Marks::NONE
    })
}

fn is_damaged(byte: &LineByte) -> bool {
    byte.sent != byte.received || byte.error.is_some()
}

/// A byte as the picture shows it: its marks, what was sent, and what arrived where that differs.
fn cell(seen: &LinkByte) -> LiveCell {
    let (column, byte) = (seen.column, &seen.byte);
    let digits = |byte: Option<u8>| byte.map_or("--".to_owned(), |byte| format!("{byte:02X}"));
    let sent = signs(seen.marks) + &digits(byte.sent);
    if is_damaged(byte) {
        let mark = if byte.error.is_some() { "~" } else { "" };
        let text = format!("{sent}\u{2192}{}{mark}", digits(byte.received));
        return LiveCell(column, text, 'x');
    }
    let class = match byte.sent {
        Some(SYNCO) => 's',
        Some(0) => 'z',
        _ => 'd',
    };
    LiveCell(column, sent, class)
}
