//! What a command does to a machine: judged by the cells that it writes ([`table`](super::table)).

use super::denial::Cause;
use super::known::{Facts, KnownDrive, within};
use super::limits::{Limits, Need};
use super::table::{Pace, of_cell, of_stored};
use crate::nd21::bits::{flags2, ps_status, selftest, status};
use crate::nd21::cells::cell_at;
use crate::nd21::units::SpeedRange;
use crate::nd21::{CONFIRM_ERROR, ee, ram};
use crate::novobus::command::PAGE;
use crate::novobus::memory::RAM;
use crate::novobus::output::OutputChange;

/// Something that a drive would do at a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveAct {
    /// `ReadByte`, `ReadWord`, `ReadLong` (ND21 10.1): the address.
    Read(u16),
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

/// What becomes of a byte of a cell.
#[derive(Clone, Copy)]
pub(super) enum Change {
    /// It is written whole.
    Set(u8),
    /// It keeps the bits of a mask.
    And(u8),
    /// It gets the bits of a mask.
    Or(u8),
}

impl Change {
    /// The byte, where it is written whole.
    const fn whole(self) -> Option<u8> {
        match self {
            Self::Set(byte) => Some(byte),
            Self::And(_) | Self::Or(_) => None,
        }
    }
}

/// What a change needs of the rig, and what it does to the speed of a motor.
#[derive(Clone, Copy)]
struct Effect {
    need: Need,
    pace: Pace,
}

const fn effect(need: Need, pace: Pace) -> Effect {
    Effect { need, pace }
}

/// The effect of a changed byte; cells whose meaning depends on the data come first, the table has the others.
fn of_byte(address: u16, change: Change, known: &KnownDrive) -> Effect {
    match address {
        ram::STATUS => of_status(change),
        ram::FLAGS2 => of_flags2(change),
        ram::PS_STATUS => of_ps_status(change),
        // 14.10.1: a confirmed error no longer blocks.
        ram::ERRORCODE if matches!(change, Change::Set(CONFIRM_ERROR)) => {
            effect(Need::MOTION, Pace::Knowing(Facts::RELEASE))
        }
        ram::EEPROM_CONTROL => match change {
            Change::Set(command) => of_eeprom(command, known),
            _ => effect(Need::EVERYTHING, Pace::Same),
        },
        // 14.10.3.
        ram::DATA_IN => match change {
            Change::Set(NSOLL_LOW) => effect(Need::MOTION, Pace::Same),
            Change::Set(data) => {
                let need = of_process_data(PAGE | u16::from(data));
                effect(
                    need,
                    Pace::Faster("14.10.3", "process data would not be a speed"),
                )
            }
            _ => effect(Need::EVERYTHING, Pace::Same),
        },
        ram::DATA_OUT => match change {
            Change::Set(data) if data < 0x7F => effect(Need::NONE, Pace::Same),
            _ => effect(Need::EVERYTHING, Pace::Same),
        },
        _ => {
            let (need, pace) = of_cell(address);
            effect(need, pace)
        }
    }
}

/// The byte of `DataIn` that points at `nsoll` (14.10.3).
const NSOLL_LOW: u8 = (ram::NSOLL & 0xFF) as u8;

/// What process data need that are written to the word at this address: as much as any word that could be written there (14.10.3).
fn of_process_data(address: u16) -> Need {
    let any_byte = |address: u16| {
        let values =
            (0..=u8::MAX).map(|data| of_byte(address, Change::Set(data), &KnownDrive::default()));
        values.fold(Need::MOTION, |need, effect| need.and(effect.need))
    };
    match [address, address.wrapping_add(1)] {
        // They would say by themselves where the next ones are written.
        cells if cells.contains(&ram::DATA_IN) => Need::EVERYTHING,
        [first, second] => any_byte(first).and(any_byte(second)),
    }
}

/// `Status` (14.10): block and stop together stop in every case; one written alone takes the other away.
fn of_status(change: Change) -> Effect {
    const BOTH: u8 = status::BLOCK | status::STOP;
    match change {
        Change::Set(BOTH) | Change::And(0xFF) => effect(Need::NONE, Pace::Same),
        Change::Or(mask) if mask & !BOTH == 0 => effect(Need::NONE, Pace::Same),
        _ => effect(Need::MOTION, Pace::Knowing(Facts::RELEASE)),
    }
}

/// `Flags2` (14.4.3).
fn of_flags2(change: Change) -> Effect {
    let (set, mut facts) = match change {
        Change::Set(data) | Change::Or(data) => (data, Facts::NONE),
        // A mask that leaves bit 7 and takes bit 6 or 5 away makes 100 of the step of a run (13.1.1).
        Change::And(mask) => {
            let run = mask & flags2::REFERENCING;
            let starts = run & flags2::START_REFERENCING != 0 && run != flags2::REFERENCING;
            (
                0,
                if starts {
                    Facts::REFERENCING
                } else {
                    Facts::NONE
                },
            )
        }
    };
    if set & flags2::REFERENCING != 0 {
        facts = facts.and(Facts::REFERENCING);
    }
    // 13.2.2: the speed of the positioning is worked out now.
    if set & flags2::CALCULATE != 0 {
        facts = facts.and(Facts::POSITIONING);
    }
    let mut need = match change {
        // 14.10.2: nothing but the watch over silences.
        Change::Or(mask) if mask & !flags2::MONITORING == 0 => Need::NONE,
        _ => Need::MOTION,
    };
    if set & flags2::MONITORING != 0 {
        need = need.and(Need::MONITORING);
    }
    // 14.4.3: teach-in stores the place in the EEPROM.
    if set & flags2::TEACH_IN != 0 {
        need = need.and(Need::EEPROM);
    }
    effect(need, Pace::Knowing(facts))
}

/// `ps_status` (13.3.1).
fn of_ps_status(change: Change) -> Effect {
    const ORDERS: u8 = ps_status::CALCULATE | ps_status::START;
    const MAY_BE_WRITTEN: u8 = ORDERS | ps_status::NEGATIVE | ps_status::FINISHED;
    let pace = match change {
        Change::Set(data) | Change::Or(data) if data & !MAY_BE_WRITTEN != 0 => Pace::Faster(
            "13.3.1",
            "these bits are the drive's own: they say in which phase a positioning is",
        ),
        Change::Set(data) | Change::Or(data) if data & ORDERS != 0 => {
            Pace::Knowing(Facts::POSITIONING)
        }
        _ => Pace::Same,
    };
    effect(Need::MOTION, pace)
}

/// What makes the EEPROM controller read a byte (14.10.5.1).
const EEPROM_READ: u8 = 0x81;

/// A command to the EEPROM controller (14.10.5).
fn of_eeprom(command: u8, known: &KnownDrive) -> Effect {
    match command {
        // Read a byte, and the end of it.
        EEPROM_READ | 0x10 => effect(Need::NONE, Pace::Same),
        // ProgParam stores what the drive works with.
        0x84 => effect(
            Need::EEPROM,
            Pace::Knowing(Facts::SOURCE.and(Facts::NO_SWITCHES)),
        ),
        0x82 => {
            let [address, data] = known.eeprom.bytes();
            let monitors = address.is_none_or(|address| address == ee::SELFTEST)
                && data.is_none_or(|data| data & selftest::MONITORING != 0);
            let need = match monitors {
                true => Need::EEPROM.and(Need::MONITORING),
                false => Need::EEPROM,
            };
            effect(need, of_stored(address))
        }
        _ => effect(Need::EVERYTHING, Pace::Same),
    }
}

/// What is known of a drive behind a changed byte.
fn note_byte(address: u16, change: Change, known: &mut KnownDrive) {
    match (address, change) {
        // It has passed, so that process data may be written there.
        (ram::DATA_IN, Change::Set(_)) => known.note(Facts::DATA_IN),
        (ram::PS_STATUS, Change::Set(0 | ps_status::FINISHED)) => known.note(Facts::PS_IDLE),
        (ram::FLAGS2, Change::And(mask) | Change::Set(mask)) if mask & flags2::ORDERS == 0 => {
            known.note(Facts::FLAGS2_IDLE);
        }
        (ram::EEPROM_BUFFER, change) => known.eeprom.write(0, change.whole()),
        (address, change) if address == ram::EEPROM_BUFFER + 1 => {
            known.eeprom.write(1, change.whole());
        }
        (ram::EEPROM_CONTROL, Change::Set(EEPROM_READ)) => known.eeprom.read(),
        _ => {}
    }
}

impl DriveAct {
    /// What it needs of a rig, where nothing is known of the drives.
    #[must_use]
    pub fn need(self) -> Need {
        self.effects(&KnownDrive::default())
            .iter()
            .flatten()
            .fold(self.own_need(), |need, effect| need.and(effect.need))
    }

    /// Whether these limits let it pass, where nothing is known of the drives.
    #[must_use]
    pub fn passes(self, limits: &Limits) -> bool {
        self.judge(limits, &KnownDrive::default()).is_ok()
    }

    /// What it needs beside what the cells need that it writes.
    fn own_need(self) -> Need {
        match self {
            Self::WriteByte(address, _) | Self::WriteWord(address, _)
                if !RAM.contains(&address) =>
            {
                Need::EVERYTHING
            }
            Self::WriteIo(code) if OutputChange::from_code(code).is_some() => Need::OUTPUTS,
            Self::WriteIo(_) | Self::Unknown(_) => Need::EVERYTHING,
            Self::Reset => Need::RESET.and(Need::MOTION),
            Self::ProcessDataToCome | Self::ProcessData(_) => Need::MOTION,
            _ => Need::NONE,
        }
    }

    /// The bytes of cells that it changes.
    pub(super) fn changes(self) -> [Option<(u16, Change)>; 2] {
        match self {
            Self::WriteByte(address, data) => [Some((address, Change::Set(data))), None],
            Self::WriteWord(address, data) => {
                let [high, low] = data.to_be_bytes();
                [
                    Some((address, Change::Set(high))),
                    Some((address.wrapping_add(1), Change::Set(low))),
                ]
            }
            Self::And(address, mask) => [Some((address, Change::And(mask))), None],
            Self::Or(address, mask) => [Some((address, Change::Or(mask))), None],
            _ => [None, None],
        }
    }

    /// The effect of each byte that it changes.
    fn effects(self, known: &KnownDrive) -> [Option<Effect>; 2] {
        match self {
            // 14.5.3.1: the nominal speed 0.
            Self::WriteWord(ram::NSOLL, 0) => [None, None],
            _ => {
                // The bytes of a word are written in the order of their addresses.
                let mut known = *known;
                self.changes().map(|change| {
                    let (address, change) = change?;
                    let effect = of_byte(address, change, &known);
                    note_byte(address, change, &mut known);
                    Some(effect)
                })
            }
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

    /// Whether a drive of which this is known may be given it.
    pub(super) fn judge(self, limits: &Limits, known: &KnownDrive) -> Result<(), Cause> {
        let effects = self.effects(known);
        let need = effects.iter().flatten();
        let need = need.fold(self.own_need(), |need, effect| need.and(effect.need));
        let missing = limits.missing(need);
        if !missing.is_none() {
            return Err(Cause::NotAllowed { act: self, missing });
        }
        let act = self;
        let Some(most) = limits.max_speed else {
            // 14.10.3: the drive holds where they are written.
            let missing = match self {
                Self::ProcessData(_) if !limits.allow_everything() => known.knows(Facts::DATA_IN),
                _ => Facts::NONE,
            };
            let most = None;
            return match missing.is_none() {
                true => Ok(()),
                false => Err(Cause::NotKnown { act, most, missing }),
            };
        };
        if let Some(raw) = self.speed() {
            let range = known.range();
            if !within(raw, range.unwrap_or(SpeedRange::To12000), most) {
                return Err(Cause::TooFast { act, most, range });
            }
        }
        let mut facts = match self {
            Self::ProcessData(_) => Facts::DATA_IN,
            Self::Reset => Facts::AFTER_RESET,
            _ => Facts::NONE,
        };
        for effect in effects.iter().flatten() {
            match effect.pace {
                Pace::Same => {}
                Pace::Knowing(needed) => facts = facts.and(needed),
                Pace::Speed if self.speed().is_some() => {}
                Pace::Speed => return Err(Cause::HalfSpeed { act, most }),
                Pace::Faster(section, why) => {
                    return Err(Cause::Faster {
                        act,
                        most,
                        section,
                        why,
                    });
                }
            }
        }
        let missing = known.knows(facts);
        if missing.is_none() {
            Ok(())
        } else {
            let most = Some(most);
            Err(Cause::NotKnown { act, most, missing })
        }
    }

    /// The raw speed that it writes whole; a number without a sign that is too large for one has no speed in the manual and
    /// counts as the highest (14.5.3.2).
    fn speed(self) -> Option<u16> {
        match self {
            Self::ProcessData(raw) => Some(raw),
            Self::WriteWord(address, raw) => {
                let cell = cell_at(address).filter(|cell| cell.address == address)?;
                let (_, Pace::Speed) = of_cell(address) else {
                    return None;
                };
                Some(if cell.signed || raw < 0x8000 {
                    raw
                } else {
                    0x7FFF
                })
            }
            _ => None,
        }
    }

    /// What is known of a drive behind it.
    pub(super) fn note(self, known: &mut KnownDrive) {
        if let (Self::WriteWord(address, _), Some(_)) = (self, self.speed()) {
            known.note(match address {
                ram::NSOLL => Facts::NSOLL,
                ram::PS_V0 => Facts::PS_V0,
                ram::REF_V1 => Facts::REF_V1,
                ram::REF_V2 => Facts::REF_V2,
                _ => Facts::NONE,
            });
        }
        for (address, change) in self.changes().into_iter().flatten() {
            note_byte(address, change, known);
        }
        if self == Self::Reset {
            known.reset();
        }
    }

    /// The act of a complete command, its checking byte left out; `None` where it is none.
    pub(super) const fn of(command: &[u8]) -> Option<Self> {
        Some(match *command {
            [0xC0 | 0xC1 | 0xC7, low, high, ..] => Self::Read(u16::from_be_bytes([high, low])),
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
