//! Registers: what the drive keeps under each number, and how a number becomes a value.

use super::table::{ALIASES, REGISTERS};
use core::fmt;

/// What a master may do with a register; the types of the dump.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Access {
    /// Read only.
    RO,
    /// A parameter: 84 stores it in the EEPROM.
    RW,
    /// Can be written, and is lost when the power is switched off.
    SP,
    /// Writing it starts a function.
    FN,
    /// Unknown.
    UK,
}

impl Access {
    /// Whether a write changes the register's contents.
    #[must_use]
    pub const fn holds_writes(self) -> bool {
        matches!(self, Self::RW | Self::SP)
    }

    /// As the dump prints it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::RO => "RO",
            Self::RW => "RW",
            Self::SP => "SP",
            Self::FN => "FN",
            Self::UK => "UK",
        }
    }
}

impl fmt::Display for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How wide a register is: as many digits as the dump prints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Width {
    /// 4 digits.
    Bits16,
    /// 8 digits.
    Bits32,
}

impl Width {
    /// 16 or 32.
    #[must_use]
    pub const fn bits(self) -> u32 {
        match self {
            Self::Bits16 => 16,
            Self::Bits32 => 32,
        }
    }
}

/// What the number in a register counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unit {
    /// Nothing that this manual names.
    Raw,
    /// Speed: 32767 is 100 %, which is \[C8\] rpm (ex 3, App 5).
    Speed,
    /// Torque: 21845 is 100 %, 32767 is 150 % (App 5).
    Torque,
    /// Revolutions a minute.
    Rpm,
    /// Milliseconds.
    Millis,
    /// Two times in ms: the lower half from 0 to 100 % speed, the upper half for the torque (ex 6, ex 11, dump).
    Ramp,
    /// Position: 65536 is one turn (6.1, App 6).
    Position,
    /// Current in units of the converter: \[D9\] is 200 % of the device current (App 7).
    Current,
    /// Tenths of an ampere (App 7).
    DeciAmpere,
    /// Bits of [`STATUS`](super::words::STATUS).
    Status,
    /// Bits of [`ERRORS`](super::words::ERRORS).
    Errors,
    /// Bits of [`IO`](super::words::IO).
    Io,
    /// Bits of [`MODE`](super::words::MODE).
    Mode,
    /// An identifier of the bus (3.1).
    Identifier,
    /// The bit timing (3.1), see [`Nbt`](super::bit_timing::Nbt).
    BitTiming,
    /// 1 is yes.
    Flag,
}

/// One row of the register table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Its number, which is byte 0 of its frames (4.1).
    pub number: u8,
    /// The internal name as the dump prints it, cut to 13 letters.
    pub name: &'static str,
    /// The label as the dump prints it.
    pub label: &'static str,
    /// The description as the dump prints it, or the label where that says more; may be empty.
    pub meaning: &'static str,
    /// What a master may do with it.
    pub access: Access,
    /// How wide it is.
    pub width: Width,
    /// Whether the top bit is a sign.
    pub signed: bool,
    /// The value in the dump.
    pub dump: u32,
    /// What the number counts.
    pub unit: Unit,
    /// The section, example, appendix item or dump that says most about it.
    pub origin: &'static str,
}

impl Register {
    /// The register with this number; every number has one.
    #[must_use]
    pub fn of(number: u8) -> &'static Self {
        &REGISTERS[usize::from(number)]
    }

    /// The register with this name, alias (E34), or number as `0x31` or `31`, in capital or small letters.
    ///
    /// # Errors
    /// [`BadName`] where no register has it, or several have it.
    pub fn named(text: &str) -> Result<&'static Self, BadName> {
        if let Some(number) = number(text) {
            return Ok(Self::of(number));
        }
        let mut with = REGISTERS
            .iter()
            .filter(|register| register.name.eq_ignore_ascii_case(text));
        match (with.next(), with.next()) {
            (Some(only), None) => Ok(only),
            (Some(first), Some(second)) => Err(BadName::Ambiguous {
                first: first.number,
                second: second.number,
                more: with.count(),
            }),
            (None, _) => ALIASES
                .iter()
                .find(|(alias, _)| alias.eq_ignore_ascii_case(text))
                .map(|(_, number)| Self::of(*number))
                .ok_or(BadName::Unknown),
        }
    }

    /// The bits that the register has.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        match self.width {
            Width::Bits16 => 0xFFFF,
            Width::Bits32 => u32::MAX,
        }
    }

    /// The number that these contents mean, with their sign.
    #[must_use]
    pub const fn number_of(&self, raw: u32) -> i64 {
        match (self.width, self.signed) {
            (Width::Bits16, true) => raw as u16 as i16 as i64,
            (Width::Bits16, false) => raw as u16 as i64,
            (Width::Bits32, true) => raw as i32 as i64,
            (Width::Bits32, false) => raw as i64,
        }
    }

    /// 16 bits on 32: by the sign of the register, or with zeros (App 1).
    #[must_use]
    pub const fn extend(&self, low: u16) -> u32 {
        if self.signed {
            low as i16 as i32 as u32
        } else {
            low as u32
        }
    }
}

/// A number as `0x31`, `0X31` or two hexadecimal digits.
fn number(text: &str) -> Option<u8> {
    let digits = text
        .strip_prefix("0x")
        .or_else(|| text.strip_prefix("0X"))
        .unwrap_or(text);
    let plain = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    plain.then(|| u8::from_str_radix(digits, 16).ok()).flatten()
}

/// Why a name means no register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadName {
    /// No register has it.
    Unknown,
    /// Several registers have it: the dump cuts names to 13 letters (E35, E36).
    Ambiguous {
        /// The first of them.
        first: u8,
        /// The second.
        second: u8,
        /// How many there are besides these two.
        more: usize,
    },
}

impl fmt::Display for BadName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => f.write_str("no register has this name: give its number as 0x31, or its name in the register table"),
            Self::Ambiguous {
                first,
                second,
                more,
            } => {
                write!(f, "several registers have this name ({first:02X}, {second:02X}")?;
                if *more > 0 {
                    write!(f, " and {more} more")?;
                }
                write!(f, "): give the number, such as 0x{first:02X}")
            }
        }
    }
}

impl core::error::Error for BadName {}
