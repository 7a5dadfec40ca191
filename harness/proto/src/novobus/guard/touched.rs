//! What commands have changed in drives that lasts: for a bench that puts it back.

use super::effect::{Change, DriveAct};
use super::known::KnownDrive;
use crate::nd21::bits::flags2;
use crate::nd21::{EE_PARAMETERS, ram};
use crate::novobus::command::PAGE;
use core::ops::RangeInclusive;

/// The parameters and the positions of the cycle control in the EEPROM (ND21 14.2.2, 13.1.9).
const PARAMETERS: RangeInclusive<u8> = EE_PARAMETERS..=0x3F;
const POSITIONS: RangeInclusive<u8> = 0x60..=0xFF;

/// Something of a drive that a command may have changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Touched {
    /// A byte of the EEPROM (ND21 14.10.5).
    Eeprom(u8),
    /// A byte of the RAM.
    Ram(u16),
    /// GPO1 or GPO2 (10.4).
    Outputs,
    /// All that is not in its EEPROM: it was reset (10.5).
    Reset,
}

impl DriveAct {
    /// Hands on what it changes in a drive of which this is known.
    pub(super) fn touches(self, known: &KnownDrive, each: &mut dyn FnMut(Touched)) {
        match self {
            Self::WriteIo(_) => each(Touched::Outputs),
            Self::Reset => each(Touched::Reset),
            _ => {}
        }
        for (address, change) in self.changes().into_iter().flatten() {
            each(Touched::Ram(address));
            let stored = match (address, change) {
                (ram::EEPROM_CONTROL, Change::Set(0x82)) => match known.eeprom.bytes()[0] {
                    Some(cell) => cell..=cell,
                    None => 0..=u8::MAX,
                },
                (ram::EEPROM_CONTROL, Change::Set(0x84)) => PARAMETERS,
                // Which position is stored is the drive's own (13.1.9.1).
                (ram::FLAGS2, Change::Set(data) | Change::Or(data))
                    if data & flags2::TEACH_IN != 0 =>
                {
                    POSITIONS
                }
                (ram::AS_COMMAND, _) => POSITIONS,
                // Process data go there from now on (14.10.3).
                (ram::DATA_IN, Change::Set(data)) => {
                    let first = PAGE | u16::from(data);
                    for cell in [first, first | 1] {
                        each(Touched::Ram(cell));
                    }
                    continue;
                }
                _ => continue,
            };
            stored.map(Touched::Eeprom).for_each(&mut *each);
        }
    }
}
