//! A march over the EEPROM of each drive (ND21 14.10.5): every cell is written with the complement of what it holds, read, and written with
//! the old value again. What a cell holds is read first, so the scenarios depend on the drive. Then `ProgParam` is to copy the parameters.

use crate::language::read::RingScenario;
use crate::section::EEPROM;
use crate::twin::Conversation;
use harness_bench::scenario::source::Source;
use harness_proto::nd21::{EE_PARAMETERS, PARAMETERS, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::RangeInclusive;

/// The cells that are written, in groups that a bench's limits permit or deny together (14.2.2): the mirror of the parameters, the speeds
/// and points of the referencing run, the customer's cells, and the positions of the cycle control. Left out is what the drive itself writes
/// (serial number, hours, dates, history of errors, test byte) and what it needs to start (settings of the ASIC and of the self-test).
const GROUPS: [(&str, RangeInclusive<u8>); 4] = [
    ("parameters", 0x20..=0x3F),
    ("reference", 0x48..=0x55),
    ("customer", 0x5A..=0x5F),
    ("positions", 0x60..=0xFF),
];

/// The cells of the parameters that show whether `ProgParam` copies all of them: the ends, and the middle. No more of them are changed at a
/// time, as the power may fail meanwhile.
const COPIED: [u8; 6] = [0x20, 0x21, 0x2F, 0x30, 0x3E, 0x3F];

/// The largest ring that is marched over.
const MOST_DRIVES: u8 = 16;

const CELLS_A_LINE: usize = 8;

/// The scenarios that read all cells, one for each drive.
#[must_use]
pub(crate) fn dumps(drives: u8) -> Vec<(u8, RingScenario)> {
    let of = |drive: u8| {
        let mut text = header("read every cell that is tested later", drives);
        let cells: Vec<u8> = GROUPS.into_iter().flat_map(|(_, cells)| cells).collect();
        for line in cells.chunks(CELLS_A_LINE) {
            let jobs: Vec<_> = line
                .iter()
                .map(|cell| format!("read-eeprom {drive} {cell:02X} = xx"))
                .collect();
            // Writing to a String cannot fail.
            let _infallible = writeln!(text, "master {}", jobs.join("; "));
        }
        Some((drive, entry("read", drives, drive, text)?))
    };
    (0..drives.min(MOST_DRIVES)).filter_map(of).collect()
}

/// The scenarios that write the cells of a drive, where the played [`dumps`] have read all of them.
#[must_use]
pub(crate) fn marches(drives: u8, drive: u8, read: &[Conversation]) -> Vec<RingScenario> {
    let held = values(drives, drive, read);
    let of = |(group, cells): (&str, RangeInclusive<u8>)| {
        let mut text = header(&format!("write the {group} and read them back"), drives);
        for cell in cells.clone() {
            let old = held.get(&cell)?;
            for data in [!old, *old] {
                let _infallible = writeln!(
                    text,
                    "master write-eeprom {drive} {cell:02X} = {data:02X}\nmaster read-eeprom {drive} {cell:02X} = xx"
                );
            }
        }
        // No write may have changed another cell.
        for cell in cells {
            let _infallible = writeln!(text, "master read-eeprom {drive} {cell:02X} = xx");
        }
        entry(group, drives, drive, text)
    };
    let copied = || entry("copied", drives, drive, copy(drives, drive, &held)?);
    GROUPS.into_iter().filter_map(of).chain(copied()).collect()
}

/// `ProgParam` behind a reset (ND21 14.10.5.4), by which RAM holds what the EEPROM does (10.5): it writes what some cells of the EEPROM held
/// before they were changed.
fn copy(drives: u8, drive: u8, held: &BTreeMap<u8, u8>) -> Option<String> {
    let mut text = header("ProgParam copies the parameters", drives);
    text.push_str(&format!(
        "reset {drive}\nrecover\nuntil drive {drive} Status & 40 = 00 within 10s\n"
    ));
    let mut jobs = [String::new(), String::new(), String::new(), String::new()];
    for cell in COPIED {
        let old = held.get(&cell)?;
        let ram = u16::from(cell - EE_PARAMETERS) + PARAMETERS;
        let lines = [
            format!("write-byte {drive} {ram:04X} = {old:02X}\n"),
            format!("master write-eeprom {drive} {cell:02X} = {:02X}\n", !old),
            format!("master read-eeprom {drive} {cell:02X} = xx\n"),
            format!("master write-eeprom {drive} {cell:02X} = {old:02X}\n"),
        ];
        jobs.iter_mut()
            .zip(lines)
            .for_each(|(job, line)| job.push_str(&line));
    }
    let [write, change, read, restore] = jobs;
    let copy = format!(
        "write-byte {drive} EEPROMcontrol = 84\nuntil drive {drive} EEPROMcontrol & 10 = 10 within 33s\n"
    );
    Some(text + &write + &change + &copy + &read + &restore + &read)
}

fn header(title: &str, drives: u8) -> String {
    format!(
        "title   Thorough qualification, EEPROM: {title}\nsource  nd21 14.10.5\nring    {drives}\ndrive   0..last model nd21\nneeds   eeprom\n\n"
    )
}

fn entry(what: &str, drives: u8, drive: u8, text: String) -> Option<RingScenario> {
    let source = Source {
        name: format!("{}{what}-drive-{drive}", super::EEPROM_TRIAL),
        text: text.into(),
    };
    RingScenario::new(source, Some(drives)).ok()
}

/// What cells hold, by the answers to the master's reads.
fn values(drives: u8, drive: u8, read: &[Conversation]) -> BTreeMap<u8, u8> {
    let mut held = BTreeMap::new();
    let Ok(size) = RingSize::new(u64::from(drives)) else {
        return held;
    };
    let mut asked = None;
    for conversation in read {
        let sent = conversation.sent_in(0);
        if sent.len() != conversation.received.len() {
            continue;
        }
        for (index, role) in roles(size, &sent).into_iter().enumerate() {
            match role {
                Role::Check {
                    drive: Some(axis),
                    writes: Some((ram::EEPROM_BUFFER, width)),
                    ..
                } if axis == drive => {
                    let place = index.checked_sub(3);
                    asked = place.filter(|_| width == 1).map(|place| sent[place].0);
                }
                Role::Data {
                    drive: Some(axis),
                    address: ram::EEPROM_BUFFER,
                } if axis == drive => {
                    let (_, _, byte) = conversation.received[index];
                    held.extend(asked.take().map(|cell| (cell, byte.byte)));
                }
                Role::Check {
                    drive: Some(axis),
                    writes: Some((cell, _)),
                    ..
                } if axis == drive && EEPROM.contains(&cell) && cell != ram::EEPROM_CONTROL => {
                    asked = None;
                }
                _ => {}
            }
        }
    }
    held
}
