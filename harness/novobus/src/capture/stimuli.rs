//! What a capture shows of the drives: the previous contents of their cells, and the bytes that cannot be predicted.

use crate::report::meaning::{self, Observer};
use harness_proto::line::Received;
use harness_proto::nd21::cells::{CellAccess, cell_at};
use harness_proto::nd21::own::is_own;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::{SequenceProgress, SequenceWatch};
use harness_proto::novobus::role::{Role, roles};
use harness_proto::novobus::sync::PAUSE;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, Trace};
use std::collections::{BTreeMap, BTreeSet};

/// In a silence of this time a drive can be switched off and be back.
const RESTART: Span = Span::from_millis(300);

/// The section of ResetH8.
const RESET: &str = "10.5";

/// What the first and the last link of a ring show.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct CapturedFacts {
    /// What cells held before: drive and address.
    pub(crate) cells: BTreeMap<(u8, u16), u8>,
    /// Bytes received, counted from 0, that are data which changed by themselves, or their checking byte.
    pub(crate) unforeseen: BTreeSet<usize>,
    /// Bytes received that plain memory may answer with other bytes than a right drive: process data, of which its settings choose the cell
    /// (ND21 9.4), and data of cells that were written and that a drive may write itself or may have lost in a silence, without its supply
    /// (14.2), or that a reset may have changed (10.5), with their checking bytes.
    pub(crate) of_drives: BTreeSet<usize>,
    /// When the bytes of each ResetH8 were sent, and to which drive (10.5).
    pub(crate) resets: Vec<(Instant, u8)>,
}

/// Reads what was sent on the first link beside what came on the last, and what each drive itself sent, as far as that
/// was captured.
pub(crate) fn told(size: RingSize, trace: &Trace) -> CapturedFacts {
    let first = trace.channels.iter().find(|link| link.from.is_none());
    let sent: Vec<_> = first
        .iter()
        .flat_map(|link| link.octets())
        .filter_map(|byte| {
            let whole = byte.error.is_none() && byte.sent == byte.received;
            Some((byte.at, (byte.sent?, whole)))
        })
        .collect();
    let bytes: Vec<_> = sent.iter().map(|(_, byte)| *byte).collect();
    // PAUSE gets no answer (9.2).
    let asked: Vec<_> = roles(size, &bytes)
        .into_iter()
        .zip(&sent)
        .filter(|(role, (_, (byte, _)))| !(*role == Role::Idle && *byte == PAUSE))
        .map(|(role, (at, _))| SentByte { role, at: *at })
        .collect();
    let reset = |byte: &SentByte| match byte.role {
        Role::Command {
            section: RESET,
            drive,
        } => Some((byte.at, drive?)),
        _ => None,
    };
    let mut told = CapturedFacts {
        resets: asked.iter().filter_map(reset).collect(),
        ..CapturedFacts::default()
    };
    for link in trace.channels.iter().filter(|link| link.from.is_some()) {
        let told_by_link = of_link(link, &asked, size.drives());
        let last = link.to.is_none();
        for (cell, value) in told_by_link.cells {
            // A drive's own link tells of it what no later link can have damaged.
            if link.from == Some(cell.0) {
                told.cells.insert(cell, value);
            } else if last {
                told.cells.entry(cell).or_insert(value);
            }
        }
        if last {
            (told.unforeseen, told.of_drives) = (told_by_link.unforeseen, told_by_link.of_drives);
        }
    }
    told
}

/// A byte that the master has sent and that comes back.
#[derive(Clone, Copy)]
struct SentByte {
    role: Role,
    /// When its stop bit had passed.
    at: Instant,
}

/// In such a silence of the master's every byte has come back, also at the lowest rate from the largest ring.
const QUIET: Span = Span::from_millis(20);
const QUIET_A_DRIVE: Span = Span::from_micros(1_200);

/// Where the bytes after each silence of the master's begin, where fewer bytes came than were sent: those in front of it that are missing do
/// not come any more.
fn behind_silences(asked: &[SentByte], came: usize, stations: u8) -> Vec<(Instant, usize)> {
    if came >= asked.len() {
        return Vec::new();
    }
    let quiet = QUIET + QUIET_A_DRIVE * u64::from(stations);
    let pairs = asked.windows(2).enumerate();
    let behind = pairs.filter(|(_, two)| two[1].at.since(two[0].at) > quiet);
    behind.map(|(place, two)| (two[1].at, place + 1)).collect()
}

/// Where the bytes after each whole check sequence begin, with the time at which it had been sent.
fn behind_sequences(asked: &[SentByte]) -> Vec<(Instant, usize)> {
    let in_sequence =
        |byte: Option<&SentByte>| byte.is_some_and(|byte| byte.role == Role::CheckSequence);
    let ends = asked.iter().enumerate().filter(|(index, byte)| {
        in_sequence(Some(byte)) && !in_sequence(asked.get(index.saturating_add(1)))
    });
    ends.map(|(index, byte)| (byte.at, index + 1)).collect()
}

/// What was asked after a check sequence that has come back whole at `at`: `beside`, where no byte was lost and none came unasked.
fn behind(sequences: &[(Instant, usize)], beside: usize, at: Instant) -> usize {
    let known = sequences.binary_search_by_key(&beside, |(_, at)| *at);
    if known.is_ok() {
        return beside;
    }
    let sent = sequences.partition_point(|(sent, _)| *sent <= at);
    let last = sequences.get(sent.wrapping_sub(1));
    last.map_or(beside, |(_, at)| *at)
}

/// Reads a link beside what was asked. What comes back stands beside what was asked until bytes are lost or drives send zeros unasked (9.9);
/// a whole check sequence ends that (9.8), and where bytes were lost, a silence of the master's.
fn of_link(link: &Channel, asked: &[SentByte], stations: u8) -> CapturedFacts {
    let sequences = behind_sequences(asked);
    let silences = behind_silences(asked, link.octets().len(), stations);
    let mut reader = StimulusReader {
        told: CapturedFacts::default(),
        sender: link.from.filter(|_| link.to.is_some()),
        now: BTreeMap::new(),
        written: BTreeSet::new(),
        lost: BTreeSet::new(),
        last: BTreeMap::new(),
        reset: BTreeSet::new(),
        open: BTreeMap::new(),
    };
    let mut observer = Observer::new(link.from, link.to);
    let mut addressed = false;
    let bytes = link.octets().iter().filter_map(|byte| {
        let read = match link.to {
            None => byte.arrival(),
            Some(_) => byte.sent.map(Received::good),
        };
        read.map(|read| (byte.at, read))
    });
    let (mut beside, mut last, mut watch) = (0, None, SequenceWatch::default());
    for (index, (at, byte)) in bytes.enumerate() {
        let seen = observer.see(Some(byte.byte), byte.error);
        if last
            .replace(at)
            .is_some_and(|last| at.since(last) >= RESTART)
        {
            reader.maybe_restarted();
        }
        let silent = silences.partition_point(|(sent, _)| *sent < at);
        let silent = silences.get(silent.wrapping_sub(1));
        beside = silent.map_or(beside, |silence| beside.max(silence.1));
        let role = asked.get(beside).map_or(Role::Foreign, |byte| byte.role);
        beside += 1;
        if watch.see(byte.byte, byte.error.is_none()) == SequenceProgress::Complete {
            beside = behind(&sequences, beside, at);
        }
        addressed |= matches!(role, Role::Address { .. });
        // In the error mode bytes are not the answers to those of the master's. Where bytes were lost, answers do not stand
        // beside what was asked: then both seldom speak of the same drive.
        if role == Role::Foreign || seen.section() == "9.7" {
            reader.break_off();
        } else if role.drive() == seen.drive {
            let is_data = seen.role == meaning::ByteRole::Data;
            reader.read(index, byte.byte, role, is_data, seen.fits);
            // Where no address was seen yet, the capture does not show which drive is meant.
            let may_be_of_a_drive = role.drive().is_some() || !addressed;
            if matches!(role, Role::ProcessData { .. }) && may_be_of_a_drive {
                reader.told.of_drives.insert(index);
            }
        }
    }
    reader.told
}

struct StimulusReader {
    told: CapturedFacts,
    /// The drive that sends on this link, where what was sent is read, and not what arrived.
    sender: Option<u8>,
    /// What a cell holds now; `None` if it was written with an unknown result.
    now: BTreeMap<(u8, u16), Option<u8>>,
    /// Cells that the master has written.
    written: BTreeSet<(u8, u16)>,
    /// Of these, those that a drive may have lost since: its supply may have been off in a silence.
    lost: BTreeSet<(u8, u16)>,
    /// The section of the last command to each drive.
    last: BTreeMap<u8, &'static str>,
    /// Drives that were reset.
    reset: BTreeSet<u8>,
    /// Data of the answer that each drive is giving: place, cell and value.
    open: BTreeMap<u8, Vec<(usize, u16, u8)>>,
}

impl StimulusReader {
    /// In a silence the supply of drives may have been switched off and on: the RAM is lost then (14.2).
    fn maybe_restarted(&mut self) {
        self.lost.extend(&self.written);
    }

    fn read(&mut self, index: usize, byte: u8, role: Role, is_data: bool, fits: Option<bool>) {
        match role {
            Role::Data {
                drive: Some(drive),
                address,
            } if is_data => {
                let open = self.open.entry(drive).or_default();
                open.push((index, address, byte));
                // ReadLong has no checking byte (10.1). What a drive itself sent is not damaged yet, but a zero may be one of
                // the error mode.
                if open.len() == 4 || self.sender == Some(drive) && byte != 0 {
                    self.settle(drive, None);
                }
            }
            Role::Command {
                drive: Some(drive),
                section,
            } => {
                self.last.insert(drive, section);
            }
            Role::Check {
                drive: Some(drive),
                writes,
                ..
            } => {
                if fits == Some(true) {
                    self.settle(drive, Some(index));
                }
                self.open.remove(&drive);
                if self.last.remove(&drive) == Some(RESET) {
                    self.reset.insert(drive);
                    self.now.retain(|(other, _), _| *other != drive);
                    self.written.retain(|(other, _)| *other != drive);
                }
                if let Some((address, width)) = writes {
                    for offset in 0..u16::from(width) {
                        let cell = (drive, address.wrapping_add(offset));
                        self.now.insert(cell, None);
                        self.written.insert(cell);
                        self.lost.remove(&cell);
                    }
                }
            }
            _ => {}
        }
    }

    /// Takes over the data of answers that an error breaks off: the bytes in front of it are those of the cells. A zero may be one of the
    /// error mode.
    fn break_off(&mut self) {
        for (drive, mut begun) in std::mem::take(&mut self.open) {
            begun.retain(|(_, _, value)| *value != 0);
            self.open.insert(drive, begun);
            self.settle(drive, None);
        }
    }

    /// Takes over the data of an answer that is whole.
    fn settle(&mut self, drive: u8, check: Option<usize>) {
        let (mut changed, mut left_any) = (false, false);
        for (index, address, value) in self.open.remove(&drive).unwrap_or_default() {
            let left = match self.written.contains(&(drive, address)) {
                true => is_of_the_drive(address) || self.lost.contains(&(drive, address)),
                false => self.reset.contains(&drive),
            };
            if left {
                left_any = true;
                self.told.of_drives.insert(index);
            }
            match self.now.get(&(drive, address)) {
                None => {
                    self.now.insert((drive, address), Some(value));
                    if cell_exists(address) && !self.reset.contains(&drive) {
                        self.told.cells.insert((drive, address), value);
                    }
                }
                Some(None) if !measured(address) => {
                    self.now.insert((drive, address), Some(value));
                }
                Some(Some(known)) if *known == value => {}
                Some(_) => {
                    changed = true;
                    self.told.unforeseen.insert(index);
                }
            }
        }
        if changed {
            self.told.unforeseen.extend(check);
        }
        if left_any {
            self.told.of_drives.extend(check);
        }
    }
}

/// Where a drive has memory (ND21 10.1).
fn cell_exists(address: u16) -> bool {
    matches!(address, 0x2F00..=0x2FDF | 0xFD80..=0xFFFF)
}

/// Whether the drive may write a cell although a master can write it too; a reserved one is compared.
fn is_of_the_drive(address: u16) -> bool {
    is_own(address) && cell_at(address).is_none_or(|cell| cell.access != CellAccess::Reserved)
}

/// Whether the drive itself writes a cell (14.2: read only).
fn measured(address: u16) -> bool {
    cell_at(address).is_some_and(|cell| cell.access != CellAccess::Write)
}
