//! What the target `drive` reaches: what an ND21 does by itself, seen from its cells, its inputs and its outputs.

use crate::fuzz::{Feature, Notebook};
use crate::nd21::{Mode, Nd21Drive};
use harness_proto::nd21::bits::{flags, flags2, ps_status, set_in};
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::functions::Function;
use harness_proto::nd21::ram;

/// The cells whose bits have names: address, name as printed, section of their bits.
const BITS: [(u16, &str, &str); 5] = [
    (ram::STATUS, "Status", "14.4.1"),
    (ram::FLAGS, "Flags", "14.4.2"),
    (ram::FLAGS2, "Flags2", "14.4.3"),
    (ram::PS_STATUS, "ps_status", "13.3.1"),
    (ram::SCOPE_STATUS, "scope_status", "14.10.6.5"),
];

/// A drive at one moment.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Snapshot {
    mode: Mode,
    error: u16,
    bits: [u8; BITS.len()],
    ordered: Option<(Function, &'static str)>,
    eeprom: u8,
    ready: bool,
    display: bool,
    gpo1: bool,
    gpo2: bool,
}

impl Snapshot {
    fn of(drive: &Nd21Drive) -> Self {
        let cells = drive.program().cells();
        let shown = drive.shown();
        let mut bits = BITS.map(|(address, ..)| cells.peek(address));
        // They count the cycles.
        bits[1] &= !flags::TIMING;
        Self {
            mode: shown.mode,
            error: u16::from_be_bytes([cells.peek(ram::ERRORCODE), cells.peek(ram::ERRORCODE + 1)]),
            bits,
            ordered: drive.ordered(),
            eeprom: cells.peek(ram::EEPROM_CONTROL),
            ready: shown.ready,
            display: shown.display.is_some(),
            gpo1: shown.gpo1,
            gpo2: shown.gpo2,
        }
    }
}

/// An onlooker at a drive.
pub(super) struct DriveWatch {
    last: Snapshot,
}

impl DriveWatch {
    pub(super) fn new(drive: &Nd21Drive) -> Self {
        Self {
            last: Snapshot::of(drive),
        }
    }

    /// Something comes from outside: what, and in which mode.
    pub(super) fn comes(&self, notes: &mut Notebook<'_>, what: &'static str) {
        notes.note(|| Feature::new("11.8", format!("mode {}", mode(self.last.mode)), what));
    }

    /// What was changed from outside is no doing of the drive.
    pub(super) fn forget(&mut self, drive: &Nd21Drive) {
        self.last = Snapshot::of(drive);
    }

    /// Notes what the drive has done since it was looked at last.
    pub(super) fn look(&mut self, notes: &mut Notebook<'_>, drive: &Nd21Drive) {
        let now = Snapshot::of(drive);
        if now == self.last {
            return;
        }
        let before = std::mem::replace(&mut self.last, now);
        outside(notes, &before, &now);
        for (place, cell) in BITS.into_iter().enumerate() {
            let (was, is) = (before.bits[place], now.bits[place]);
            bits(notes, cell, was, is, "set");
            bits(notes, cell, is, was, "cleared");
        }
        steps(notes, &before, &now);
    }
}

/// What can be seen without the bus.
fn outside(notes: &mut Notebook<'_>, before: &Snapshot, now: &Snapshot) {
    if before.mode != now.mode {
        let (was, is) = (mode(before.mode), mode(now.mode));
        notes.note(|| Feature::new("11.8", format!("mode {was}"), format!("then {is}")));
    }
    if before.error != now.error && now.error != 0 {
        notes.note(|| match ErrorCode::from_code(now.error) {
            Some(error) => Feature::new(error.section(), "error raised", error.printed_name()),
            None => Feature::new("14.11", "error raised", "one that is not listed"),
        });
    }
    if let Some((function, course)) = now.ordered.filter(|_| before.ordered != now.ordered) {
        let place = format!("PLC function {}", function.printed_name());
        notes.note(|| Feature::new(function.section(), place, course));
    }
    let mut output =
        |section, name: &'static str, was: bool, is: bool, words: [&'static str; 2]| {
            if was != is {
                notes.note(|| Feature::new(section, name, words[usize::from(is)]));
            }
        };
    output(
        "5.3.7",
        "ready for operation contact",
        before.ready,
        now.ready,
        ["opens", "closes"],
    );
    output(
        "11.8",
        "display",
        before.display,
        now.display,
        ["goes out", "shows an error"],
    );
    output("5.3.5", "GPO1", before.gpo1, now.gpo1, ["falls", "rises"]);
    output("5.3.5", "GPO2", before.gpo2, now.gpo2, ["falls", "rises"]);
}

/// The bits of a cell that are in `to` and were not in `from`, with what that means.
fn bits(
    notes: &mut Notebook<'_>,
    (cell, name, section): (u16, &'static str, &'static str),
    from: u8,
    to: u8,
    means: &'static str,
) {
    let new = set_in(cell, to).filter(|bit| set_in(cell, from).all(|other| other != *bit));
    for bit in new {
        notes.note(|| Feature::new(section, name, format!("{bit} {means}")));
    }
}

/// The steps of what takes its time: referencing, positioning, the EEPROM controller.
fn steps(notes: &mut Notebook<'_>, before: &Snapshot, now: &Snapshot) {
    let (was, is) = (
        before.bits[2] & flags2::REFERENCING,
        now.bits[2] & flags2::REFERENCING,
    );
    if was != is {
        let bits = |byte: u8| format!("{:03b}", byte >> 5);
        let place = format!("referencing at {}", bits(was));
        notes.note(|| Feature::new("13.1.1", place, format!("then {}", bits(is))));
    }
    let (was, is) = (phase(before.bits[3]), phase(now.bits[3]));
    if was != is {
        notes.note(|| Feature::new("13.3", format!("positioning, {was}"), format!("then {is}")));
    }
    if before.eeprom != now.eeprom {
        let command = match before.eeprom {
            0x81 => "a byte is read",
            0x82 => "a byte is written",
            0x84 => "the parameters are programmed",
            _ => "no command",
        };
        let what = format!("then {:02X}", now.eeprom);
        notes.note(|| Feature::new("14.10.5", format!("EEPROM controller, {command}"), what));
    }
}

/// How far a positioning is, by the bit of `ps_status` that stands for the most (13.3.1).
const fn phase(status: u8) -> &'static str {
    const PHASES: [(u8, &str); 7] = [
        (ps_status::FINISHED, "finished"),
        (ps_status::TARGET_BRAKING, "target braking"),
        (ps_status::BRAKING, "braking"),
        (ps_status::CONSTANT, "acceleration and constant drive"),
        (ps_status::START, "started"),
        (ps_status::CALCULATED, "calculated"),
        (ps_status::CALCULATE, "to be calculated"),
    ];
    let mut place = 0;
    while place < PHASES.len() {
        if status & PHASES[place].0 != 0 {
            return PHASES[place].1;
        }
        place += 1;
    }
    "nothing"
}

fn mode(mode: Mode) -> &'static str {
    let name = Mode::NAMES.iter().find(|(_, one)| *one == mode);
    name.map_or("", |(name, _)| name)
}
