//! What a command does to a machine: one table, by the cells that it writes.

use super::denial::Cause;
use super::limits::{Limits, Need};
use crate::nd21::bits::{flags2, status};
use crate::nd21::cells::cell_at;
use crate::nd21::units::{Ratio, Scale, SpeedRange, speed_from_raw};
use crate::nd21::{CONFIRM_ERROR, ram};
use crate::novobus::command::PAGE;
use crate::novobus::memory::RAM;
use crate::novobus::output::OutputChange;

/// Something that a drive would do at a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// `ReadByte`, `ReadWord`, `ReadLong` (ND21 10.1).
    Read,
    /// `WriteByte` (10.2): address and data.
    WriteByte(u16, u8),
    /// `WriteWord` (10.2): address and data.
    WriteWord(u16, u16),
    /// `And` (10.3): address and mask.
    And(u16, u8),
    /// `Or` (10.3): address and mask.
    Or(u16, u8),
    /// `WriteIO` (10.4): the code.
    WriteIo(u8),
    /// `ResetH8` (10.5).
    Reset,
    /// Process data are announced (9.4).
    ProcessDataToCome,
    /// Process data (9.4): the word, written to the cell to which `DataIn` points.
    ProcessData(u16),
    /// A command byte that the manual does not know.
    Unknown(u8),
}

/// First and last address, and what writing there needs. What is not in here needs everything. In order of addresses (ND21 14.2.1).
#[rustfmt::skip]
pub(super) const CELLS: &[(u16, u16, Need)] = &[
    (ram::POLE_JUMP, ram::POLE_JUMP + 1, Need::MOTION),
    (ram::I2, ram::I2 + 3, Need::MOTION),
    // Address and byte of the EEPROM controller; nothing happens before its command (14.10.5).
    (ram::EEPROM_BUFFER, ram::EEPROM_BUFFER + 1, Need::NONE),
    (ram::REF_V1, ram::AS_COMMAND, Need::MOTION),
    // The recording; also the way that this project gives the S-ramp's points to a simulated drive (13.5.3).
    (ram::REF_LAGE, ram::SCOPE_PUFFER + 255, Need::MOTION),
    (ram::MMAX, ram::LAGE0 + 1, Need::MOTION),
    (ram::ICRA, ram::VCO_OFFSET + 1, Need::MOTION),
    (ram::TEMP_KK, ram::TEMP_MOT, Need::MOTION),
    // The oscilloscope only looks on (14.10.6).
    (ram::SCOPE_STATUS, ram::SCOPE_DELAY, Need::NONE),
    (ram::SCOPE_TRIGGER, ram::SCOPE_SIGNAL2, Need::NONE),
    (ram::PS_STATUS, ram::PS_DELTA, Need::MOTION),
    (ram::FLAGS2, ram::CNT2, Need::MOTION),
    (ram::UP, ram::CNT_REVERS, Need::MOTION),
    // GPO2's meaning, the analogue output (14.3.3, 14.3.4).
    (ram::HW_VERSION, ram::HW_VERSION2, Need::MOTION.and(Need::OUTPUTS)),
    (ram::SW_VERSION, ram::N_MAX + 1, Need::MOTION),
    (ram::N_RAMPE_PLUS, ram::EMK0, Need::MOTION),
    // "In position" may stand at GPO2 (14.7.5).
    (ram::WINDOW, ram::WINDOW, Need::MOTION.and(Need::OUTPUTS)),
    (ram::AN_OUT, ram::AN_OUT_OFFSET, Need::OUTPUTS),
    (ram::REVERS_TAKT, ram::VCO_LIN_L, Need::MOTION),
];

fn of_cell(address: u16) -> Need {
    let row = CELLS
        .iter()
        .find(|(first, last, _)| (*first..=*last).contains(&address));
    row.map_or(Need::EVERYTHING, |row| row.2)
}

/// A byte written whole.
fn of_byte(address: u16, data: u8) -> Need {
    const BOTH: u8 = status::BLOCK | status::STOP;
    match address {
        // 14.10: block and stop together stop in every case; one alone takes the other away.
        ram::STATUS if data == BOTH => Need::NONE,
        ram::STATUS => Need::MOTION,
        // 14.10.1: a confirmed error no longer blocks.
        ram::ERRORCODE if data == CONFIRM_ERROR => Need::MOTION,
        // 14.10.5: read a byte, and the end of it; write a byte, ProgParam.
        ram::EEPROM_CONTROL => match data {
            0x81 | 0x10 => Need::NONE,
            0x82 | 0x84 => Need::EEPROM,
            _ => Need::EVERYTHING,
        },
        // 14.10.3.
        ram::DATA_IN if u16::from(data) == ram::NSOLL & 0xFF => Need::MOTION,
        ram::DATA_OUT if data < 0x7F => Need::NONE,
        // 14.4.3: teach-in stores the place in the EEPROM.
        ram::FLAGS2 if data & flags2::TEACH_IN != 0 => Need::MOTION.and(Need::EEPROM),
        _ => of_cell(address),
    }
}

fn of_or(address: u16, mask: u8) -> Need {
    match address {
        // 14.10: what blocks and what stops.
        ram::STATUS if mask & !(status::BLOCK | status::STOP) == 0 => Need::NONE,
        ram::STATUS => Need::MOTION,
        // 14.10.2: watching for silence only ever stops a drive.
        ram::FLAGS2 if mask & !flags2::MONITORING == 0 => Need::NONE,
        ram::FLAGS2 if mask & flags2::TEACH_IN != 0 => Need::MOTION.and(Need::EEPROM),
        _ => of_cell(address),
    }
}

fn of_and(address: u16, mask: u8) -> Need {
    match address {
        ram::STATUS if mask == 0xFF => Need::NONE,
        ram::STATUS => Need::MOTION,
        _ => of_cell(address),
    }
}

impl Act {
    /// What it needs.
    #[must_use]
    pub fn need(self) -> Need {
        match self {
            Self::Read => Need::NONE,
            Self::WriteByte(address, _) | Self::WriteWord(address, _)
                if !RAM.contains(&address) =>
            {
                Need::EVERYTHING
            }
            // 14.5.3.1: the nominal speed 0.
            Self::WriteWord(ram::NSOLL, 0) => Need::NONE,
            Self::WriteWord(address, data) => {
                let [high, low] = data.to_be_bytes();
                of_byte(address, high).and(of_byte(address.wrapping_add(1), low))
            }
            Self::WriteByte(address, data) => of_byte(address, data),
            Self::Or(address, mask) => of_or(address, mask),
            Self::And(address, mask) => of_and(address, mask),
            Self::WriteIo(code) if OutputChange::from_code(code).is_some() => Need::OUTPUTS,
            Self::WriteIo(_) | Self::Unknown(_) => Need::EVERYTHING,
            Self::Reset => Need::RESET.and(Need::MOTION),
            Self::ProcessDataToCome | Self::ProcessData(_) => Need::MOTION,
        }
    }

    /// The cell that it writes; `None` where it writes none.
    #[must_use]
    pub const fn address(self) -> Option<u16> {
        match self {
            Self::WriteByte(address, _)
            | Self::WriteWord(address, _)
            | Self::And(address, _)
            | Self::Or(address, _) => Some(address),
            Self::ProcessData(_) => Some(ram::NSOLL),
            _ => None,
        }
    }

    /// Whether it may be.
    pub(super) fn judge(self, limits: &Limits) -> Result<(), Cause> {
        let missing = limits.missing(self.need());
        if !missing.is_none() {
            return Err(Cause::NotAllowed { act: self, missing });
        }
        match limits.max_speed {
            Some(most) if self.too_fast(most) => Err(Cause::TooFast { act: self, most }),
            _ => Ok(()),
        }
    }

    /// Whether it writes a speed above `most`, or a part of a speed, of which nobody knows the rest.
    fn too_fast(self, most: u16) -> bool {
        let is_speed = |address| {
            cell_at(address)
                .is_some_and(|cell| matches!(cell.scale, Some(Scale::Speed | Scale::MaxSpeed)))
        };
        let above = |raw: u16, signed: bool| {
            // A word without a sign that is too large for one has no speed in the manual.
            let raw = raw.cast_signed();
            if !signed && raw < 0 {
                return true;
            }
            let rpm = speed_from_raw(raw, SpeedRange::To12000);
            rpm > Ratio::whole(most.into()) || rpm < Ratio::whole(-i32::from(most))
        };
        match self {
            Self::ProcessData(raw) => above(raw, true),
            Self::WriteWord(address, raw) => match cell_at(address) {
                Some(cell) if is_speed(address) && cell.address == address => {
                    above(raw, cell.signed)
                }
                _ => is_speed(address) || is_speed(address.wrapping_add(1)),
            },
            Self::WriteByte(address, _) | Self::And(address, _) | Self::Or(address, _) => {
                is_speed(address)
            }
            _ => false,
        }
    }

    /// The act of a complete command, its checking byte left out; `None` where it is none.
    pub(super) const fn of(command: &[u8]) -> Option<Self> {
        Some(match *command {
            [0xC0, ..] | [0xC1, ..] | [0xC7, ..] => Self::Read,
            [0x82, data, low, high] => Self::WriteByte(u16::from_be_bytes([high, low]), data),
            [0x63, lower, upper, low, high] => Self::WriteWord(
                u16::from_be_bytes([high, low]),
                u16::from_be_bytes([upper, lower]),
            ),
            [0xA4, mask, low] => Self::And(PAGE | low as u16, mask),
            [0xA5, mask, low] => Self::Or(PAGE | low as u16, mask),
            [0xC8, code] => Self::WriteIo(code),
            [0xDD, _] => Self::Reset,
            _ => return None,
        })
    }
}
