//! What the manual determines of cells that a drive's own program writes: `Status` and `errorcode` after an error of the bus
//! ([`ErrorMode`]), and the data read back from cells of the EEPROM (ND21 14.10.5).

use super::error_mode::ErrorMode;
use super::known::Write;
use harness_proto::nd21::{EE_PARAMETERS, PARAMETER_COUNT, PARAMETERS, ram};
use harness_proto::time::Instant;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Commands of `EEPROMcontrol` (14.10.5.1), and its bit that says that a byte has been read.
pub(super) const READ_BYTE: u8 = 0x81;
const WRITE_BYTE: u8 = 0x82;
pub(super) const PROG_PARAM: u8 = 0x84;
pub(super) const READ: u8 = 1 << 5;

/// Its bit that says that a byte has been written, or that nothing is going on.
pub(super) const READY: u8 = 1 << 4;

/// The cells of the EEPROM that only a master changes (14.2.2): the parameters and settings, the customer's cells, and the positions of
/// the cycle control. The drive itself counts its hours, notes errors and dates, and may note its reference point.
const STEADY: [RangeInclusive<u8>; 4] = [0x20..=0x4B, 0x50..=0x57, 0x5A..=0x5F, 0x60..=0xFF];

/// What is known of one drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Program {
    errors: ErrorMode,
    /// What the master has written to the ports of the EEPROM, while it stands there.
    address: Option<u8>,
    data: Option<u8>,
    /// What the master has written to cells of the EEPROM, or read from them, or what `ProgParam` has copied there.
    eeprom: BTreeMap<u8, u8>,
    /// `ProgParam` was ordered, and the drive has not said that it is done.
    copying: bool,
    /// The cell that is read, and whether the drive has said that it is done.
    reading: Option<(u8, bool)>,
    /// Whether `EEPROMcontrol` was read since the last order that writes and showed that nothing is going on.
    ready: bool,
    /// Whether it did so before the byte that is read was ordered: then it cannot report the end of an earlier order.
    was_ready: bool,
}

impl Program {
    /// An attempt begins: what the EEPROM holds stays.
    pub(super) fn begin(&mut self) {
        if self.copying {
            self.copy(|_| None);
        }
        self.errors.begin();
        *self = Self {
            errors: std::mem::take(&mut self.errors),
            eeprom: std::mem::take(&mut self.eeprom),
            ..Self::default()
        };
    }

    /// The master has reset the drive (ND21 10.5).
    pub(super) fn reset(&mut self) {
        self.begin();
        self.errors.reset();
    }

    /// `ProgParam` copies the parameters from RAM into the EEPROM (ND21 14.10.5.4), as far as it is known what they hold.
    pub(super) fn copy(&mut self, held: impl Fn(u16) -> Option<u8>) {
        let cells = PARAMETERS..PARAMETERS + PARAMETER_COUNT;
        for (address, cell) in (EE_PARAMETERS..).zip(cells) {
            match held(cell) {
                Some(held) => self.eeprom.insert(address, held),
                None => self.eeprom.remove(&address),
            };
        }
        self.copying = true;
    }

    /// The master has written to a cell.
    pub(super) fn write(&mut self, cell: u16, write: Write, now: Instant) {
        let parameter = cell.checked_sub(PARAMETERS).filter(|_| self.copying);
        if let Some(parameter) = parameter.filter(|parameter| *parameter < PARAMETER_COUNT) {
            // It may have been copied before, or not.
            let address = u16::from(EE_PARAMETERS) + parameter;
            self.eeprom.retain(|cell, _| u16::from(*cell) != address);
        }
        let Write::Set(data) = write else { return };
        self.errors.write(cell, data, now);
        match cell {
            ram::EEPROM_BUFFER => {
                self.address = Some(data);
                self.reading = None;
            }
            _ if cell == ram::EEPROM_BUFFER + 1 => self.data = Some(data),
            ram::EEPROM_CONTROL => self.order(data),
            _ => {}
        }
    }

    /// A command to the controller of the EEPROM: it overwrites its ports.
    fn order(&mut self, command: u8) {
        let (address, data) = (self.address.take(), self.data.take());
        self.reading = None;
        self.was_ready = self.ready;
        self.ready &= command <= READ_BYTE;
        match (command, address, data) {
            (READ_BYTE, Some(address), _) => self.reading = Some((address, false)),
            (WRITE_BYTE, Some(address), Some(data)) => {
                if is_steady(address) {
                    self.eeprom.insert(address, data);
                }
            }
            // The master confirms that it has seen the end of the last order.
            (0..READ_BYTE | PROG_PARAM, ..) => {}
            // It is unknown which cell such a command writes.
            _ => self.eeprom.clear(),
        }
    }

    /// As [`ErrorMode::read`], of all these cells.
    pub(super) fn read(
        &mut self,
        cell: u16,
        wanted: u8,
        value: u8,
        now: Option<Instant>,
    ) -> Option<bool> {
        let of_the_error = self.errors.read(cell, wanted, value, now);
        match cell {
            ram::EEPROM_CONTROL => {
                let shown = value & (READ | READY);
                self.ready |= shown != 0;
                self.copying &= shown & READY == 0;
                let (_, done) = self.reading.as_mut()?;
                *done |= shown & READ != 0;
                // Reading a byte does not end with the report that one was written.
                (shown == READY && self.was_ready).then_some(false)
            }
            ram::EEPROM_BUFFER => {
                let (address, _) = self.reading.filter(|(_, done)| *done)?;
                match self.eeprom.get(&address) {
                    Some(held) => Some(*held == value),
                    None => {
                        // A drive that refuses the rest of the command sends 00, too (9.7).
                        if is_steady(address) && value != 0 {
                            self.eeprom.insert(address, value);
                        }
                        None
                    }
                }
            }
            _ => of_the_error,
        }
    }
}

fn is_steady(address: u8) -> bool {
    STEADY.iter().any(|cells| cells.contains(&address))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Instant = Instant::START;

    /// Reads a cell of the EEPROM in which `value` is found.
    fn read(drive: &mut Program, address: u8, value: u8) -> Option<bool> {
        drive.write(ram::EEPROM_BUFFER, Write::Set(address), NOW);
        drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE), NOW);
        drive.read(ram::EEPROM_CONTROL, 0x01, READ, Some(NOW));
        drive.read(ram::EEPROM_BUFFER, address, value, Some(NOW))
    }

    /// ND21 14.2.2, 14.10.5: a cell that only a master changes holds what was read before, whatever was written to other cells.
    #[test]
    fn the_eeprom_holds_what_was_read() {
        let mut drive = Program::default();
        assert_eq!(read(&mut drive, 0xDC, 0x77), None);
        drive.write(ram::EEPROM_CONTROL, Write::Set(0x10), NOW);
        assert_eq!(read(&mut drive, 0x05, 0x01), None);
        drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C), NOW);
        drive.write(ram::EEPROM_BUFFER + 1, Write::Set(0xA5), NOW);
        drive.write(ram::EEPROM_CONTROL, Write::Set(WRITE_BYTE), NOW);
        assert_eq!(read(&mut drive, 0xDC, 0xA5), Some(false));
        assert_eq!(read(&mut drive, 0xDC, 0x77), Some(true));
        // The operating hours, which the drive counts.
        assert_eq!(read(&mut drive, 0x05, 0x02), None);
        // The cycle control may write into it (13.1.9.1).
        drive.write(ram::EEPROM_CONTROL, Write::Set(0x88), NOW);
        assert_eq!(read(&mut drive, 0xDC, 0x78), None);
    }

    /// ND21 14.10.5.4: `ProgParam` copies FF60 to FF7F into the cells 20 to 3F of the EEPROM, and nothing else.
    #[test]
    fn the_eeprom_holds_what_was_copied() {
        let mut drive = Program::default();
        for address in [0x1F, 0x20, 0x3F, 0x40] {
            drive.write(ram::EEPROM_BUFFER, Write::Set(address), NOW);
            drive.write(ram::EEPROM_BUFFER + 1, Write::Set(0xA5), NOW);
            drive.write(ram::EEPROM_CONTROL, Write::Set(WRITE_BYTE), NOW);
        }
        let order = |drive: &mut Program| {
            drive.write(ram::EEPROM_CONTROL, Write::Set(PROG_PARAM), NOW);
            drive.copy(|cell| (cell != 0xFF61).then_some(0x33));
        };
        order(&mut drive);
        drive.read(ram::EEPROM_CONTROL, READY, READY, Some(NOW));
        drive.write(0xFF7F, Write::Set(0x44), NOW);
        for (address, held) in [(0x20, 0x33), (0x3F, 0x33), (0x40, 0xA5)] {
            assert_eq!(read(&mut drive, address, held), Some(true), "{address:02X}");
            assert_eq!(read(&mut drive, address, !held), Some(false));
        }
        assert_eq!(read(&mut drive, 0x21, 0xA5), None);
        // A parameter that is written meanwhile may be copied or not.
        order(&mut drive);
        drive.write(0xFF7F, Write::And(0x44), NOW);
        assert_eq!(read(&mut drive, 0x3F, 0x33), None);
        // Nor is it known what was copied where an attempt ends before it is done.
        order(&mut drive);
        drive.begin();
        assert_eq!(read(&mut drive, 0x20, 0x34), None);
    }

    /// ND21 14.10.5.2, 14.10.5.3: bit 4 of `EEPROMcontrol` does not report that a byte was read, unless an earlier order may still have been
    /// going on.
    #[test]
    fn a_read_does_not_end_as_a_write() {
        let control = ram::EEPROM_CONTROL;
        let mut drive = Program::default();
        let order = |drive: &mut Program, command| {
            drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C), NOW);
            drive.write(ram::EEPROM_BUFFER + 1, Write::Set(0xA5), NOW);
            drive.write(control, Write::Set(command), NOW);
        };
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READY, Some(NOW)), None);
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READ_BYTE, Some(NOW)), None);
        assert_eq!(drive.read(control, READ, READY, Some(NOW)), Some(false));
        assert_eq!(drive.read(control, READ, READ, Some(NOW)), None);
        order(&mut drive, WRITE_BYTE);
        assert_eq!(drive.read(control, READ, WRITE_BYTE, Some(NOW)), None);
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READY, Some(NOW)), None);
    }

    /// ND21 14.10.5: what was written to a cell of the customer's is read back, once the drive says that it has read.
    #[test]
    fn the_eeprom_holds_what_was_written() {
        let mut drive = Program::default();
        let ports = |drive: &mut Program, address, data| {
            drive.write(ram::EEPROM_BUFFER, Write::Set(address), NOW);
            drive.write(ram::EEPROM_BUFFER + 1, Write::Set(data), NOW);
        };
        ports(&mut drive, 0x5C, 0xA5);
        drive.write(ram::EEPROM_CONTROL, Write::Set(WRITE_BYTE), NOW);
        drive.begin();
        drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C), NOW);
        drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE), NOW);
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0x5C, 0x5C, Some(NOW)), None);
        assert_eq!(drive.read(ram::EEPROM_CONTROL, 0x01, READ, Some(NOW)), None);
        assert_eq!(
            drive.read(ram::EEPROM_BUFFER, 0x5C, 0xA5, Some(NOW)),
            Some(true)
        );
        assert_eq!(
            drive.read(ram::EEPROM_BUFFER, 0xA5, 0xA4, Some(NOW)),
            Some(false)
        );
        // A second order takes the byte that was read for an address.
        drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE), NOW);
        drive.read(ram::EEPROM_CONTROL, READ, READ, Some(NOW));
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0xA5, 0x00, Some(NOW)), None);
    }
}
