//! What a write to each register may do, and which permissions it needs.

use super::denial::Missing;
use crate::unitek::register::{Access, Register};
use crate::unitek::words::{MODE_EVENT, MODE_LOCK};

/// Registers that only a rig file that names them permits.
pub const NAMED: [u8; 3] = [0x03, 0x1A, 0x85];

/// What a write to a register may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Nothing that needs a permission.
    Harmless,
    /// Depends on the value and the lock: 51, 31, 90, 17, 18.
    ByValue,
    /// Moves the motor, or changes how it moves.
    Motion,
    /// Wears the EEPROM, or changes data of device and motor.
    Eeprom,
    /// Device data that changes currents or what 100 % speed is.
    EepromAndMotion,
    /// Changes how the drive is reached.
    BusSettings,
    /// Needs to be named in the rig's file.
    Named,
    /// Is not listed, or cannot be written: needs all permissions.
    Unlisted,
    /// Can make the drive unusable.
    Never,
}

/// First register, last register, class.
const CLASSES: &[(u8, u8, Class)] = {
    use Class::{BusSettings, ByValue, Eeprom, EepromAndMotion, Harmless, Motion, Named, Never};
    &[
        (0x10, 0x16, Harmless),
        (0x52, 0x52, Harmless),
        (0x17, 0x18, ByValue),
        (0x31, 0x31, ByValue),
        (0x51, 0x51, ByValue),
        (0x90, 0x90, ByValue),
        (0x1C, 0x2F, Motion),
        (0x33, 0x36, Motion),
        (0x3B, 0x3C, Motion),
        (0x3E, 0x3F, Motion),
        (0x46, 0x46, Motion),
        (0x4C, 0x4C, Motion),
        (0x50, 0x50, Motion),
        (0x53, 0x53, Motion),
        (0x58, 0x58, Motion),
        (0x5B, 0x5B, Motion),
        (0x5E, 0x5E, Motion),
        (0x60, 0x60, Motion),
        (0x6A, 0x6C, Motion),
        (0x6E, 0x6E, Motion),
        (0x71, 0x72, Motion),
        (0x75, 0x7A, Motion),
        (0x7E, 0x80, Motion),
        (0x8E, 0x8E, Motion),
        (0xBE, 0xC3, Motion),
        (0xC7, 0xC7, Motion),
        (0xC9, 0xCB, Motion),
        (0xCD, 0xCD, Motion),
        (0xCF, 0xCF, Motion),
        (0xD1, 0xD4, Motion),
        (0xDA, 0xDB, Motion),
        (0xED, 0xED, Motion),
        (0xF0, 0xF1, Motion),
        (0x05, 0x0F, Eeprom),
        (0x19, 0x19, Eeprom),
        (0x3A, 0x3A, Eeprom),
        (0x44, 0x44, Eeprom),
        (0x47, 0x47, Eeprom),
        (0x4D, 0x4F, EepromAndMotion),
        (0x59, 0x59, Eeprom),
        (0x64, 0x65, Eeprom),
        (0x7C, 0x7D, Eeprom),
        (0x83, 0x84, Eeprom),
        (0x87, 0x87, Eeprom),
        (0x8B, 0x8D, Eeprom),
        (0xA2, 0xA7, Eeprom),
        (0xB1, 0xB6, Eeprom),
        (0xBB, 0xBD, Eeprom),
        (0xC4, 0xC6, Eeprom),
        (0xC8, 0xC8, EepromAndMotion),
        (0xD7, 0xD7, Eeprom),
        (0xEE, 0xEE, Eeprom),
        (0xF8, 0xFA, Eeprom),
        (0x68, 0x69, BusSettings),
        (0x73, 0x73, BusSettings),
        (0x88, 0x89, BusSettings),
        (0xD0, 0xD0, BusSettings),
        (0xDC, 0xDC, BusSettings),
        (0x03, 0x03, Named),
        (0x1A, 0x1A, Named),
        (0x85, 0x85, Named),
        (0x04, 0x04, Never),
        (0x5A, 0x5A, Never),
        (0x62, 0x62, Never),
        (0x67, 0x67, Never),
        (0xB0, 0xB0, Never),
        (0xB7, 0xBA, Never),
    ]
};

/// The class of writes to a register.
#[must_use]
pub fn class(register: u8) -> Class {
    let listed = CLASSES
        .iter()
        .find(|(first, last, _)| (*first..=*last).contains(&register))
        .map(|(_, _, class)| *class);
    match (listed, Register::of(register).access) {
        (Some(Class::Never), _) | (_, Access::UK) => Class::Never,
        // One inside a range too.
        (_, Access::RO) => Class::Unlisted,
        (listed, _) => listed.unwrap_or(Class::Unlisted),
    }
}

/// The permissions that a write needs.
pub(super) fn need(class: Class, register: u8, value: u16, locked: bool) -> &'static [Missing] {
    use Missing::{All, BusSettings, Eeprom, Motion, WayBack};
    match (class, register) {
        (Class::Harmless | Class::Named | Class::Never, _) => &[],
        (Class::ByValue, 0x51) => {
            let known = value & !(MODE_LOCK | MODE_EVENT) == 0;
            match (known, value & MODE_LOCK != 0) {
                (true, true) => &[],
                (true, false) => &[Motion],
                (false, _) => &[All],
            }
        }
        (Class::ByValue, 0x31 | 0x90) if value == 0 && locked => &[],
        (Class::ByValue, 0x17 | 0x18) if locked => &[],
        (Class::ByValue | Class::Motion, _) => &[Motion],
        // 83 brings a stored speed command back, which moves a drive that is not locked (our choice).
        (Class::Eeprom, 0x83) if !locked => &[Eeprom, Motion],
        (Class::Eeprom, _) => &[Eeprom],
        (Class::EepromAndMotion, _) => &[Eeprom, Motion],
        (Class::BusSettings, 0x73) => &[BusSettings, Eeprom, WayBack],
        (Class::BusSettings, _) => &[BusSettings],
        (Class::Unlisted, _) => &[All],
    }
}
