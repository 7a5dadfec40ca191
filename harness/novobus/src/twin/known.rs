//! What is known of the cells of real drives: what the master wrote, and what it read.
//!
//! A bit that the master has written since the last reset holds what was written, unless the manual lets the drive change it
//! ([`own::kept`]). A value that was read is learned where the master has not written, and never replaces what the master wrote.

use super::error_mode::OF_THE_BUS;
use super::program::{PROG_PARAM, Program, READ, READ_BYTE, READY};
use harness_proto::nd21::bits::{flags2, ps_status, status};
use harness_proto::nd21::io::{GPO1, GPO2, OUTPUTS};
use harness_proto::nd21::own::{self, Worker};
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use harness_proto::novobus::command::{Command, PAGE};
use harness_proto::novobus::output::Output;
use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, BTreeSet};

/// Number of different values that must survive as many resets before a cell counts as not cleared: the drive may load or set one value itself.
const SURVIVALS: usize = 3;

/// A byte of a drive: its ring, counted from 0, the drive, and the address.
pub(crate) type CellByte = (usize, u8, u16);

/// What the master does to a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Write {
    /// Writes all bits.
    Set(u8),
    /// Clears the bits that are 0 here.
    And(u8),
    /// Sets the bits that are 1 here.
    Or(u8),
}

impl Write {
    /// The bits whose value it decides.
    const fn bits(self) -> u8 {
        match self {
            Self::Set(_) => 0xFF,
            Self::And(mask) => !mask,
            Self::Or(mask) => mask,
        }
    }

    /// The byte after it.
    const fn apply(self, byte: u8) -> u8 {
        match self {
            Self::Set(data) => data,
            Self::And(mask) => byte & mask,
            Self::Or(mask) => byte | mask,
        }
    }

    /// Whether it may set one of these bits that were not set.
    const fn sets(self, bits: u8) -> bool {
        match self {
            Self::Set(data) | Self::Or(data) => data & bits != 0,
            Self::And(_) => false,
        }
    }
}

/// The bytes that a command writes (ND21 10.2 to 10.4).
pub(crate) fn writes(command: &Command) -> Vec<(u16, Write)> {
    match *command {
        Command::WriteByte { address, data } => vec![(address, Write::Set(data))],
        Command::WriteWord { address, data } => {
            let [high, low] = data.to_be_bytes();
            vec![
                (address, Write::Set(high)),
                (address.wrapping_add(1), Write::Set(low)),
            ]
        }
        Command::And { address_low, data } => {
            vec![(PAGE | u16::from(address_low), Write::And(data))]
        }
        Command::Or { address_low, data } => {
            vec![(PAGE | u16::from(address_low), Write::Or(data))]
        }
        Command::WriteIo(change) => {
            let bit = match change.output {
                Output::Gpo1 => GPO1,
                Output::Gpo2 => GPO2,
            };
            let write = if change.set {
                Write::Or(bit)
            } else {
                Write::And(!bit)
            };
            vec![(OUTPUTS, write)]
        }
        _ => Vec::new(),
    }
}

/// What is known of a byte.
#[derive(Clone, Copy, Debug, Default)]
struct KnownByte {
    /// The bits that the master has written.
    written: u8,
    /// The bits that it has written in the present attempt.
    now: u8,
    /// Whether the other bits have been read.
    learned: bool,
    value: u8,
    /// Whether it was read as 00, which may have been sent in place of its data (9.7).
    zero: bool,
}

/// The judgement on a byte that was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteRead {
    /// The value is right.
    Right,
    /// The value is wrong.
    Wrong,
    /// The value is the drive's choice, and it was read for the first time.
    Learned,
    /// The value is the drive's choice at any time.
    Own,
}

/// Whether a reset must replace what a master wrote to a cell: "every data which has not been saved on the EEPROM will be lost" (ND21
/// 10.5). What stands there after it is the drive's choice.
fn is_lost(address: u16) -> bool {
    let kept = own::kept(address, 0).bits == 0xFF;
    kept && (ram::POLE_JUMP..=ram::VCO_LIN_L).contains(&address)
}

/// How long an order to the controller of the EEPROM may take. The manual gives no time; the copy of the 32 parameters takes the model 320 ms.
const LONGEST_ORDER: Span = Span::from_millis(4_000);

/// Longest time between the confirmation of an error and its deletion. The manual gives none; a cycle of the cycle control is 432 us (4.1).
pub(super) const LONGEST_CONFIRMATION: Span = Span::from_millis(500);

/// The knowledge about the cells of all drives.
#[derive(Clone, Debug, Default)]
pub(crate) struct Knowledge {
    cells: BTreeMap<CellByte, KnownByte>,
    /// Parts of drives that the master has started: from then on they write their cells until the next reset.
    started: BTreeSet<(usize, u8, Worker)>,
    /// For each drive, what the manual decides of the cells of its program.
    programs: BTreeMap<(usize, u8), Program>,
    /// Drives that have shown since the attempt began that their reset is over.
    working: BTreeSet<(usize, u8)>,
    /// Whether the present conversation has faults: a drive may have been switched off and on.
    disturbed: bool,
    /// What cells held before the last reset, if the master wrote all of it in the present attempt.
    before_reset: BTreeMap<CellByte, u8>,
    /// The values with which cells came out of resets, as long as they came out of each with the value that was written before it.
    survived: BTreeMap<CellByte, BTreeSet<u8>>,
    /// The values with which cells of the model came out of resets although the drive had lost them: they were written before.
    not_lost: BTreeMap<CellByte, BTreeSet<u8>>,
    /// Drives whose EEPROM may have been written in the present attempt.
    saved: BTreeSet<(usize, u8)>,
    /// When the present byte is due.
    now: Instant,
    /// When cells were given an order whose end the drive has not shown in the present conversation: one to the controller of the EEPROM in
    /// `EEPROMcontrol`, the confirmation of an error in `errorcode`.
    ordered: BTreeMap<CellByte, Instant>,
    /// Drives that are known not to monitor time-outs (14.10.2): their `Flags2` says so, and nothing was written to it since.
    trusting: BTreeSet<(usize, u8)>,
}

impl Knowledge {
    pub(crate) fn begin(&mut self) {
        self.cells.values_mut().for_each(|byte| byte.now = 0);
        self.programs.values_mut().for_each(Program::begin);
        self.before_reset.clear();
        self.survived.clear();
        self.not_lost.clear();
        self.saved.clear();
        self.working.clear();
    }

    /// Begins a conversation, with or without faults.
    pub(crate) fn converse(&mut self, faults: bool) {
        self.ordered.clear();
        if faults || self.disturbed {
            self.working.clear();
            self.trusting.clear();
        }
        self.disturbed = faults;
    }

    /// Sets the time to that of the next byte.
    pub(crate) const fn proceed_to(&mut self, due: Instant) {
        self.now = due;
    }

    /// Notes that a drive was reset (ND21 10.5): its cells are loaded from its EEPROM, which it takes any time to write (14.10.5).
    pub(crate) fn reset(&mut self, ring: usize, drive: u8) {
        let of_it = |place: &CellByte| (place.0, place.1) == (ring, drive);
        // The bits of a cell that are lost, all of them written in the present attempt.
        let lost = |place: &CellByte, byte: &KnownByte| {
            match place.2 {
                OUTPUTS => Some(self.outputs_of_the_bus(ring, drive)),
                address => is_lost(address).then_some(0xFF),
            }
            .filter(|bits| *bits != 0 && byte.now & bits == *bits)
            .map(|bits| byte.value & bits)
        };
        let cells = self.cells.iter().filter(|(place, _)| of_it(place));
        let lost: Vec<_> = cells
            .filter_map(|(place, byte)| Some((*place, lost(place, byte)?)))
            .collect();
        self.before_reset.retain(|place, _| !of_it(place));
        if !self.saved.contains(&(ring, drive)) {
            self.before_reset.extend(lost);
        }
        self.cells
            .retain(|cell, _| (cell.0, cell.1) != (ring, drive));
        self.started
            .retain(|(at, of, _)| (*at, *of) != (ring, drive));
        self.programs.entry((ring, drive)).or_default().reset();
        self.working.remove(&(ring, drive));
        self.ordered.retain(|place, _| !of_it(place));
        self.trusting.remove(&(ring, drive));
    }

    /// Whether a drive monitors time-outs, where that is known.
    pub(crate) fn monitors(&self, ring: usize, drive: u8) -> Option<bool> {
        if self.trusting.contains(&(ring, drive)) {
            return Some(false);
        }
        let byte = self.cells.get(&(ring, drive, ram::FLAGS2))?;
        let written = byte.written & flags2::MONITORING != 0;
        written.then_some(byte.value & flags2::MONITORING != 0)
    }

    /// Notes that the master has written to a byte.
    pub(crate) fn write(&mut self, place: CellByte, write: Write) {
        let (ring, drive, address) = place;
        let started = match address {
            ram::FLAGS2 => write.sets(flags2::ORDERS | flags2::TEACH_IN),
            ram::PS_STATUS => write.sets(ps_status::CALCULATE | ps_status::START),
            _ => false,
        };
        // The cycle control may do anything (ND21 13.1.9.1, 14.3.1).
        let ordered = (ram::PZ..=ram::AS_COMMAND).contains(&address) || address == ram::SW_VERSION;
        let workers = [
            (started || ordered, Worker::Positioning),
            (address == ram::EEPROM_CONTROL || ordered, Worker::Eeprom),
            (address == ram::SCOPE_STATUS, Worker::Scope),
        ];
        let workers = workers.into_iter().filter(|(starts, _)| *starts);
        self.started
            .extend(workers.map(|(_, worker)| (ring, drive, worker)));
        // A teach-in writes positions into the EEPROM (13.1.7.3), and so may the cycle control.
        if started || ordered {
            self.programs.remove(&(ring, drive));
        }
        if started || ordered || address == ram::EEPROM_CONTROL {
            self.saved.insert((ring, drive));
        }
        let is_order = match (address, write) {
            (ram::EEPROM_CONTROL, Write::Set(order)) => order >= READ_BYTE,
            (ram::ERRORCODE, Write::Set(data)) => data == CONFIRM_ERROR,
            _ => false,
        };
        if is_order {
            self.ordered.insert(place, self.now);
        } else {
            self.ordered.remove(&place);
        }
        if ordered || address == ram::FLAGS2 && write.sets(flags2::MONITORING) {
            self.trusting.remove(&(ring, drive));
        }
        let program = self.programs.entry((ring, drive)).or_default();
        program.write(address, write, self.now);
        if (address, write) == (ram::EEPROM_CONTROL, Write::Set(PROG_PARAM)) {
            let cells = &self.cells;
            program.copy(|parameter| {
                let byte = cells.get(&(ring, drive, parameter))?;
                let steady = own::kept(parameter, 0).bits == 0xFF;
                (steady && (byte.learned || byte.written == 0xFF)).then_some(byte.value)
            });
        }
        let byte = self.cells.entry(place).or_default();
        byte.written |= write.bits();
        byte.now |= write.bits();
        byte.value = write.apply(byte.value);
        byte.zero = false;
    }

    /// Notes process data of the master (ND21 9.4, 14.10.3), which a drive writes where its `DataIn` says.
    pub(crate) fn take_process_data(&mut self, ring: usize, drive: u8, data: [u8; 2]) {
        match self.target(ring, drive, ram::DATA_IN) {
            Some(target) => {
                let [high, low] = data;
                self.write((ring, drive, target), Write::Set(high));
                self.write((ring, drive, target.wrapping_add(1)), Write::Set(low));
            }
            // Any cell of page FF, those that start something among them.
            None => {
                self.cells
                    .retain(|cell, _| (cell.0, cell.1) != (ring, drive) || cell.2 < PAGE);
                self.trusting.remove(&(ring, drive));
                let all = [Worker::Positioning, Worker::Eeprom, Worker::Scope];
                self.started.extend(all.map(|worker| (ring, drive, worker)));
            }
        }
    }

    /// As [`Self::write`], if it is not known whether the drive took it.
    pub(crate) fn may_write(&mut self, place: CellByte, write: Write) {
        self.write(place, write);
        self.cells.remove(&place);
        self.programs.remove(&(place.0, place.1));
        let of_it = |other: &CellByte| (other.0, other.1) == (place.0, place.1);
        self.ordered.retain(|other, _| !of_it(other));
    }

    /// The cell that `DataIn` or `DataOut` of a drive points at (ND21 14.10.3), where that is known.
    pub(crate) fn target(&self, ring: usize, drive: u8, pointer: u16) -> Option<u16> {
        let known = self.cells.get(&(ring, drive, pointer))?;
        let whole = known.learned || known.written == 0xFF;
        whole.then_some(PAGE | u16::from(known.value))
    }

    /// The bits of a byte that the drive does not change by itself now; `value` is what was read.
    fn kept(&self, place: CellByte, value: u8) -> u8 {
        let (ring, drive, address) = place;
        let kept = own::kept(address, value);
        match kept.unless {
            Some(worker) if self.started.contains(&(ring, drive, worker)) => 0,
            _ if address == OUTPUTS => kept.bits & self.outputs_of_the_bus(ring, drive),
            _ => kept.bits,
        }
    }

    /// The outputs that only `WriteIO` sets; none where the master has not read since the last reset what they are configured for.
    fn outputs_of_the_bus(&self, ring: usize, drive: u8) -> u8 {
        let read = |address| {
            let byte = self.cells.get(&(ring, drive, address))?;
            (byte.learned && byte.written == 0).then_some(byte.value)
        };
        match (read(ram::HW_VERSION), read(ram::HW_VERSION2)) {
            (Some(hardware), Some(hardware2)) => own::outputs_of_the_bus(hardware, hardware2),
            _ => 0,
        }
    }

    /// Whether a `Status` that was read says that a drive is in its reset although the master has not reset it since its last reset was
    /// over (ND21 10.5, 11.8, 14.4.1).
    fn is_in_reset_by_itself(&mut self, drive: (usize, u8), wanted: u8, value: u8) -> bool {
        if value & status::RESET == 0 {
            self.working.insert(drive);
            return false;
        }
        wanted & status::RESET == 0 && !self.disturbed && self.working.contains(&drive)
    }

    /// What a byte must hold, as far as it was written or read.
    pub(crate) fn held(&self, place: CellByte) -> Option<u8> {
        self.cells.get(&place).map(|byte| byte.value)
    }

    /// The bits of a byte that hold what the master has written in the present attempt.
    pub(crate) fn written_now(&self, place: CellByte, value: u8) -> u8 {
        let written = self.cells.get(&place).map_or(0, |byte| byte.now);
        written & self.kept(place, value)
    }

    /// Whether a cell should long have shown the end of an order: `EEPROMcontrol` that a byte was read or written (ND21 14.10.5.2, 14.10.5.3),
    /// `errorcode` that the error is deleted (14.10.1). There the AF of the confirmation or the code of a bus error stays.
    fn is_overdue(&mut self, place: CellByte, wanted: u8, value: u8) -> bool {
        let (ended, longest): (fn(u8) -> bool, _) = match place.2 {
            ram::EEPROM_CONTROL => (|shown| shown & (READ | READY) != 0, LONGEST_ORDER),
            ram::ERRORCODE => (
                |shown| ![CONFIRM_ERROR, OF_THE_BUS].contains(&shown),
                LONGEST_CONFIRMATION,
            ),
            _ => return false,
        };
        if ended(value) {
            self.ordered.remove(&place);
        }
        let since = self.ordered.get(&place);
        let late = since.is_some_and(|since| self.now.since(*since) > longest);
        late && ended(wanted) && !self.disturbed
    }

    /// Whether these bits of a cell, which was read for the first time since a reset, have come out of several resets with what was written
    /// before each (ND21 10.5), in the drive or in a model that deviates, and not in both.
    fn outlives_resets(&mut self, place: CellByte, kept: u8, wanted: u8, value: u8) -> bool {
        let byte = self.cells.get(&place).copied().unwrap_or_default();
        if kept == 0 || byte.written & kept != 0 || byte.learned {
            return false;
        }
        let Some(before) = self.before_reset.remove(&place) else {
            return false;
        };
        let survived = self.survived.entry(place).or_default();
        if before == value & kept {
            survived.insert(before);
            return survived.len() >= SURVIVALS;
        }
        survived.clear();
        let not_lost = self.not_lost.entry(place).or_default();
        if before == wanted & kept {
            not_lost.insert(before);
        }
        // One value may be what the model loads.
        not_lost.len() > 1
    }

    /// Notes that the checking byte after a byte was right: if that byte was 00, the cell holds 00.
    pub(crate) fn confirm_zero(&mut self, place: CellByte) {
        if let Some(byte) = self.cells.get_mut(&place).filter(|byte| byte.zero) {
            *byte = KnownByte {
                learned: true,
                value: byte.value & byte.written,
                zero: false,
                ..*byte
            };
        }
    }

    /// Judges a byte that was read, where the model holds `wanted`.
    pub(crate) fn read(&mut self, place: CellByte, wanted: u8, value: u8) -> ByteRead {
        if place.2 == ram::FLAGS2 {
            match value & flags2::MONITORING {
                0 => self.trusting.insert((place.0, place.1)),
                _ => self.trusting.remove(&(place.0, place.1)),
            };
        }
        let program = self.programs.entry((place.0, place.1)).or_default();
        let now = (!self.disturbed).then_some(self.now);
        match program.read(place.2, wanted, value, now) {
            Some(true) => return ByteRead::Right,
            Some(false) => return ByteRead::Wrong,
            None => {}
        }
        if self.is_overdue(place, wanted, value) {
            return ByteRead::Wrong;
        }
        if place.2 == ram::STATUS && self.is_in_reset_by_itself((place.0, place.1), wanted, value) {
            return ByteRead::Wrong;
        }
        let kept = self.kept(place, value);
        if self.outlives_resets(place, kept, wanted, value) {
            return ByteRead::Wrong;
        }
        let byte = self.cells.entry(place).or_default();
        let written = byte.written & kept;
        // Process data went where the drive's own DataIn says, which the model's may not. The model's outputs may serve another purpose.
        let unlike_model = if place.2 == OUTPUTS {
            0xFF
        } else {
            value ^ wanted
        };
        let mut differ = unlike_model & (value ^ byte.value) & written;
        if kept != 0xFF || own::is_own(place.2) && !own::is_of_the_scope(place.2) {
            return match (differ, written) {
                (0, 0xFF) => ByteRead::Right,
                (0, _) => ByteRead::Own,
                _ => ByteRead::Wrong,
            };
        }
        if byte.learned {
            differ |= (value ^ byte.value) & !written;
        }
        if differ != 0 {
            return ByteRead::Wrong;
        }
        if byte.learned || written == 0xFF {
            return ByteRead::Right;
        }
        // In the place of data a drive that refuses the rest of the command sends 00 (9.7): only the checking byte shows that it was none.
        if (wanted, value) == (0, 0) {
            byte.zero = true;
            return ByteRead::Right;
        }
        byte.learned = true;
        byte.value = value;
        ByteRead::Learned
    }
}

#[cfg(test)]
#[path = "known_tests.rs"]
mod tests;
