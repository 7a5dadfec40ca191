//! What the manual determines of cells that a drive's own program writes: the code of an error provoked by a telegram (ND21 14.11.14), and
//! the data read back from cells of the EEPROM (14.10.5).

use super::known::Write;
use harness_proto::nd21::ram;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// What clears the code of an error (ND21 14.10.1).
const CONFIRM: u8 = 0xAF;

/// The high byte of the codes of the bus.
const OF_THE_BUS: u8 = 0x05;

/// Commands of `EEPROMcontrol` (14.10.5.1), and its bit that says that a byte has been read.
const READ_BYTE: u8 = 0x81;
const WRITE_BYTE: u8 = 0x82;
const READ: u8 = 1 << 5;

/// The cells of the EEPROM that no function of the drive uses (14.10.5.3).
const CUSTOMERS: RangeInclusive<u8> = 0x5C..=0x5F;

/// A byte of `errorcode`: bits of [`Program::zeros`].
const HIGH: u8 = 1;
const LOW: u8 = 2;

/// What is known of one drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Program {
    /// The master has confirmed all errors.
    confirmed: bool,
    /// Which bytes of `errorcode` were read as 0 since then.
    zeros: u8,
    /// Whether the last byte read was the high one of `errorcode`, and right.
    high_is_right: bool,
    /// What the master has written to the ports of the EEPROM, while it stands there.
    address: Option<u8>,
    data: Option<u8>,
    /// What the master has written to cells of the EEPROM.
    eeprom: BTreeMap<u8, u8>,
    /// The cell that is read, and whether the drive has said that it is done.
    reading: Option<(u8, bool)>,
}

impl Program {
    /// An attempt begins, or the drive was reset: what the EEPROM holds stays.
    pub(super) fn begin(&mut self) {
        *self = Self {
            eeprom: std::mem::take(&mut self.eeprom),
            ..Self::default()
        };
    }

    /// The master has written to a cell.
    pub(super) fn write(&mut self, cell: u16, write: Write) {
        let Write::Set(data) = write else { return };
        self.high_is_right = false;
        match cell {
            ram::ERRORCODE => {
                self.confirmed = data == CONFIRM;
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
        match (command, address, data) {
            (READ_BYTE, Some(address), _) => self.reading = Some((address, false)),
            (WRITE_BYTE, Some(address), Some(data)) if CUSTOMERS.contains(&address) => {
                self.eeprom.insert(address, data);
            }
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
                if let Some((_, done)) = &mut self.reading {
                    *done |= value & READ != 0;
                }
                None
            }
            ram::EEPROM_BUFFER => {
                let (address, _) = self.reading.filter(|(_, done)| *done)?;
                self.eeprom.get(&address).map(|held| *held == value)
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 14.10.1, 14.11.14: behind a confirmed error the code of the bus's next one is decided, and no other code.
    #[test]
    fn codes_are_judged_behind_a_confirmation() {
        let mut drive = Program::default();
        let low = ram::ERRORCODE + 1;
        assert_eq!(drive.read(ram::ERRORCODE, 0x05, 0x00), None);
        drive.write(ram::ERRORCODE, Write::Set(CONFIRM));
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
