//! What the manual determines of cells that a drive's own program writes: the code of an error provoked by a telegram (ND21 14.11.14), and
//! the data read back from cells of the EEPROM (14.10.5).

use super::known::Write;
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The high byte of the codes of the bus.
pub(super) const OF_THE_BUS: u8 = 0x05;

/// Commands of `EEPROMcontrol` (14.10.5.1), and its bit that says that a byte has been read.
pub(super) const READ_BYTE: u8 = 0x81;
const WRITE_BYTE: u8 = 0x82;
pub(super) const READ: u8 = 1 << 5;

/// Its bit that says that a byte has been written, or that nothing is going on.
pub(super) const READY: u8 = 1 << 4;

/// The cells of the EEPROM that only a master changes (14.2.2): the parameters and settings, the customer's cells, and the positions of
/// the cycle control. The drive itself counts its hours, notes errors and dates, and may note its reference point.
const STEADY: [RangeInclusive<u8>; 4] = [0x20..=0x4B, 0x50..=0x57, 0x5A..=0x5F, 0x60..=0xFF];

/// A byte of `errorcode`: bits of [`Program::zeros`].
const HIGH: u8 = 1;
const LOW: u8 = 2;

/// What is known of one drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Program {
    /// The master has confirmed all errors.
    confirmed: bool,
    /// The master has reset the drive since the attempt began.
    reset: bool,
    /// Which bytes of `errorcode` were read as 0 since the errors were confirmed.
    zeros: u8,
    /// Whether the last byte read was the high one of `errorcode`, and right.
    high_is_right: bool,
    /// What the master has written to the ports of the EEPROM, while it stands there.
    address: Option<u8>,
    data: Option<u8>,
    /// What the master has written to cells of the EEPROM, or read from them.
    eeprom: BTreeMap<u8, u8>,
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
        *self = Self {
            eeprom: std::mem::take(&mut self.eeprom),
            ..Self::default()
        };
    }

    /// The master has reset the drive (ND21 10.5).
    pub(super) fn reset(&mut self) {
        self.begin();
        self.reset = true;
    }

    /// The master has written to a cell.
    pub(super) fn write(&mut self, cell: u16, write: Write) {
        let Write::Set(data) = write else { return };
        self.high_is_right = false;
        match cell {
            ram::ERRORCODE => {
                self.confirmed = data == CONFIRM_ERROR;
                self.zeros = 0;
            }
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
            (0..READ_BYTE, ..) => {}
            // It is unknown which cell such a command writes.
            _ => self.eeprom.clear(),
        }
    }

    /// Whether a byte that was read is right, where the model holds `wanted`; `None` where it is the drive's choice.
    pub(super) fn read(&mut self, cell: u16, wanted: u8, value: u8) -> Option<bool> {
        let high_is_right = std::mem::take(&mut self.high_is_right);
        let is_zero = self.confirmed && (wanted, value) == (0, 0);
        match cell {
            ram::ERRORCODE => {
                // There is no error in the drive, and one of the bus in its model.
                if self.confirmed && (wanted, value) == (OF_THE_BUS, 0) {
                    return Some(false);
                }
                // An error of the bus is over with a check sequence, which is one in the model too; what was before the reset is lost (10.5).
                if self.reset && (wanted, value) == (0, OF_THE_BUS) {
                    return Some(false);
                }
                self.zeros |= if is_zero { HIGH } else { 0 };
                if self.zeros != HIGH | LOW {
                    return None;
                }
                if ![0, OF_THE_BUS].contains(&value) {
                    // The drive has an error of its own.
                    self.confirmed = false;
                    self.zeros = 0;
                    return None;
                }
                self.high_is_right = value == wanted;
                Some(value == wanted)
            }
            _ if cell == ram::ERRORCODE + 1 => {
                self.zeros |= if is_zero { LOW } else { 0 };
                (high_is_right && self.zeros == HIGH | LOW).then_some(value == wanted)
            }
            ram::EEPROM_CONTROL => {
                let shown = value & (READ | READY);
                self.ready |= shown != 0;
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
            _ => None,
        }
    }
}

fn is_steady(address: u8) -> bool {
    STEADY.iter().any(|cells| cells.contains(&address))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 14.2.2, 14.10.5: a cell that only a master changes holds what was read before, whatever was written to other cells.
    #[test]
    fn the_eeprom_holds_what_was_read() {
        let mut drive = Program::default();
        let read = |drive: &mut Program, address, value| {
            drive.write(ram::EEPROM_BUFFER, Write::Set(address));
            drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE));
            drive.read(ram::EEPROM_CONTROL, 0x01, READ);
            drive.read(ram::EEPROM_BUFFER, address, value)
        };
        assert_eq!(read(&mut drive, 0xDC, 0x77), None);
        drive.write(ram::EEPROM_CONTROL, Write::Set(0x10));
        assert_eq!(read(&mut drive, 0x05, 0x01), None);
        drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C));
        drive.write(ram::EEPROM_BUFFER + 1, Write::Set(0xA5));
        drive.write(ram::EEPROM_CONTROL, Write::Set(WRITE_BYTE));
        assert_eq!(read(&mut drive, 0xDC, 0xA5), Some(false));
        assert_eq!(read(&mut drive, 0xDC, 0x77), Some(true));
        // The operating hours, which the drive counts.
        assert_eq!(read(&mut drive, 0x05, 0x02), None);
        // The parameters are copied into it.
        drive.write(ram::EEPROM_CONTROL, Write::Set(0x84));
        assert_eq!(read(&mut drive, 0xDC, 0x78), None);
    }

    /// ND21 14.10.5.2, 14.10.5.3: bit 4 of `EEPROMcontrol` does not report that a byte was read, unless an earlier order may still have been
    /// going on.
    #[test]
    fn a_read_does_not_end_as_a_write() {
        let control = ram::EEPROM_CONTROL;
        let mut drive = Program::default();
        let order = |drive: &mut Program, command| {
            drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C));
            drive.write(ram::EEPROM_BUFFER + 1, Write::Set(0xA5));
            drive.write(control, Write::Set(command));
        };
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READY), None);
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READ_BYTE), None);
        assert_eq!(drive.read(control, READ, READY), Some(false));
        assert_eq!(drive.read(control, READ, READ), None);
        order(&mut drive, WRITE_BYTE);
        assert_eq!(drive.read(control, READ, WRITE_BYTE), None);
        order(&mut drive, READ_BYTE);
        assert_eq!(drive.read(control, READ, READY), None);
    }

    /// ND21 14.10.1, 14.11.14: behind a confirmed error the code of the bus's next one is decided, and no other code.
    #[test]
    fn codes_are_judged_behind_a_confirmation() {
        let mut drive = Program::default();
        let low = ram::ERRORCODE + 1;
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), None);
        drive.write(ram::ERRORCODE, Write::Set(CONFIRM_ERROR));
        // A drive that does not delete its error is none that has deleted it.
        assert_eq!(drive.clone().read(ram::ERRORCODE, 0x05, 0x00), Some(false));
        assert_eq!(drive.read(low, 0, 0), None);
        assert_eq!(drive.read(ram::ERRORCODE, 0, 0), Some(true));
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x05), Some(true));
        assert_eq!(drive.read(low, 0x07, 0x06), Some(false));
        // After other bytes it is unknown whether this is still the same code.
        assert_eq!(drive.read(low, 0x07, 0x06), None);
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), Some(false));
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x02), None);
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), None);
    }

    /// ND21 10.5: what is not in the EEPROM is lost with a reset, and so is the code of an error of the bus. A drive may find an error of its own.
    #[test]
    fn no_code_of_the_bus_outlives_a_reset() {
        let mut drive = Program::default();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), None);
        drive.reset();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), Some(false));
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x02), None);
        // An error of the bus behind the reset.
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x05), None);
        drive.begin();
        assert_eq!(drive.read(ram::ERRORCODE, 0x00, 0x05), None);
    }

    /// ND21 14.10.5: what was written to a cell of the customer's is read back, once the drive says that it has read.
    #[test]
    fn the_eeprom_holds_what_was_written() {
        let mut drive = Program::default();
        let ports = |drive: &mut Program, address, data| {
            drive.write(ram::EEPROM_BUFFER, Write::Set(address));
            drive.write(ram::EEPROM_BUFFER + 1, Write::Set(data));
        };
        ports(&mut drive, 0x5C, 0xA5);
        drive.write(ram::EEPROM_CONTROL, Write::Set(WRITE_BYTE));
        drive.begin();
        drive.write(ram::EEPROM_BUFFER, Write::Set(0x5C));
        drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE));
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0x5C, 0x5C), None);
        assert_eq!(drive.read(ram::EEPROM_CONTROL, 0x01, READ), None);
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0x5C, 0xA5), Some(true));
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0xA5, 0xA4), Some(false));
        // A second order takes the byte that was read for an address.
        drive.write(ram::EEPROM_CONTROL, Write::Set(READ_BYTE));
        drive.read(ram::EEPROM_CONTROL, READ, READ);
        assert_eq!(drive.read(ram::EEPROM_BUFFER, 0xA5, 0x00), None);
    }
}
