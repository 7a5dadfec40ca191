//! From per cent, rpm, ms, turns and amperes to the numbers of a register and back (UNITEK 6.1, App 5 to 7).
//!
//! The drive computes with raw numbers only (6.1). A value becomes the nearest raw number, and half of one is rounded away from zero.

use super::register::{Register, Unit, Width};
use core::fmt;

/// A decimal number: `digits` / 10^`places`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Decimal {
    /// All digits with the sign.
    pub digits: i64,
    /// How many of them stand behind the point; at most 9.
    pub places: u8,
}

impl Decimal {
    /// Most digits behind the point.
    pub const MAX_PLACES: u8 = 9;

    /// A whole number.
    #[must_use]
    pub const fn whole(number: i64) -> Self {
        Self {
            digits: number,
            places: 0,
        }
    }
}

/// A unit in which people give a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Given {
    /// `%`: of the speed \[C8\], of the torque, of the device current.
    Percent,
    /// `rpm`.
    Rpm,
    /// `ms`.
    Millis,
    /// `turns`.
    Turns,
    /// `A`.
    Ampere,
}

impl Given {
    /// Every unit.
    pub const ALL: [Self; 5] = [
        Self::Percent,
        Self::Rpm,
        Self::Millis,
        Self::Turns,
        Self::Ampere,
    ];

    /// As it is written behind a number.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Percent => "%",
            Self::Rpm => "rpm",
            Self::Millis => "ms",
            Self::Turns => "turns",
            Self::Ampere => "A",
        }
    }

    /// The unit with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// How many decimals are shown.
    const fn places(self) -> u32 {
        match self {
            Self::Percent | Self::Ampere | Self::Rpm => 1,
            Self::Millis => 0,
            Self::Turns => 3,
        }
    }
}

/// What the scales of a drive depend on: read from it before its values are converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scaling {
    /// CE: rpm at 100 % speed.
    pub rpm_max: u16,
    /// C6: current of the device in tenths of an ampere.
    pub device_current: u16,
    /// D9: units of the converter at 200 % of the device current.
    pub units_at_200: u16,
}

impl Default for Scaling {
    /// The drive of the dump: 3600 rpm, 5.0 A, 841 units.
    fn default() -> Self {
        Self {
            rpm_max: 3600,
            device_current: 50,
            units_at_200: 841,
        }
    }
}

/// Raw numbers for one of a unit, as a fraction; `None` where the register is not counted in it.
const fn ratio(unit: Unit, given: Given, scaling: Scaling) -> Option<(i128, i128)> {
    let Scaling {
        rpm_max,
        device_current,
        units_at_200,
    } = scaling;
    let (num, den) = match (unit, given) {
        (Unit::Speed, Given::Percent) => (32_767, 100),
        (Unit::Speed, Given::Rpm) => (32_767, rpm_max as i128),
        (Unit::Torque, Given::Percent) => (32_767, 150),
        (Unit::Current, Given::Percent) => (units_at_200 as i128, 200),
        // A = 2/10 x [C6] x / [D9] (App 7).
        (Unit::Current, Given::Ampere) => (5 * units_at_200 as i128, device_current as i128),
        (Unit::DeciAmpere, Given::Ampere) => (10, 1),
        (Unit::Position, Given::Turns) => (65_536, 1),
        (Unit::Rpm, Given::Rpm) | (Unit::Millis | Unit::Ramp, Given::Millis) => (1, 1),
        _ => return None,
    };
    if num == 0 || den == 0 {
        None
    } else {
        Some((num, den))
    }
}

/// The quotient, rounded to the nearest whole number, half away from zero.
const fn nearest(num: i128, den: i128) -> i128 {
    let twice = 2 * num.abs() + den;
    let size = twice / (2 * den);
    if num < 0 { -size } else { size }
}

/// The contents of a register that come nearest to a value.
///
/// In 35 and ED a time is the lower half, and the upper half is 0: to keep it, read the register first.
///
/// # Errors
/// [`BadValue`] where the register is not counted in this unit, or the value is out of its range.
pub fn to_raw(
    register: &Register,
    value: Decimal,
    given: Given,
    scaling: Scaling,
) -> Result<u32, BadValue> {
    let (num, den) = ratio(register.unit, given, scaling).ok_or(BadValue::Unit {
        register: register.number,
        given,
    })?;
    let power = 10i128.pow(value.places.min(Decimal::MAX_PLACES).into());
    let raw = nearest(i128::from(value.digits) * num, den * power);
    let (least, most) = range(register);
    match i64::try_from(raw) {
        Ok(raw) if (least..=most).contains(&raw) => {
            Ok((raw & i64::from(u32::MAX)) as u32 & register.mask())
        }
        _ => Err(BadValue::Range {
            register: register.number,
            least,
            most,
        }),
    }
}

/// The raw numbers that a value may become. 8000 is no command (App 5).
const fn range(register: &Register) -> (i64, i64) {
    match (register.unit, register.width, register.signed) {
        (Unit::Speed | Unit::Torque, _, _) => (-32_767, 32_767),
        (Unit::Ramp, _, _) => (0, 0xFFFF),
        (_, Width::Bits16, true) => (-0x8000, 0x7FFF),
        (_, Width::Bits16, false) => (0, 0xFFFF),
        (_, Width::Bits32, true) => (-0x8000_0000, 0x7FFF_FFFF),
        (_, Width::Bits32, false) => (0, 0xFFFF_FFFF),
    }
}

/// The contents of a register in a unit, for people.
#[must_use]
pub fn shown(register: &Register, raw: u32, given: Given, scaling: Scaling) -> Option<Shown> {
    let (num, den) = ratio(register.unit, given, scaling)?;
    let raw = number(register, raw);
    let power = 10i128.pow(given.places());
    let digits = nearest(i128::from(raw) * den * power, num);
    Some(Shown {
        digits: i64::try_from(digits).ok()?,
        given,
    })
}

/// What a register counts: a ramp only its low word (App 4).
fn number(register: &Register, raw: u32) -> i64 {
    match register.unit {
        Unit::Ramp => i64::from(raw & 0xFFFF),
        _ => register.number_of(raw),
    }
}

/// A raw number in a unit, not rounded; `None` where the register is not counted in it.
#[must_use]
pub fn value(register: &Register, raw: u32, given: Given, scaling: Scaling) -> Option<f64> {
    let (num, den) = ratio(register.unit, given, scaling)?;
    Some(number(register, raw) as f64 * den as f64 / num as f64)
}

/// The unit in which a register is shown; `None` where it is a plain number or a word of bits.
#[must_use]
pub const fn usual(unit: Unit) -> Option<Given> {
    match unit {
        Unit::Speed | Unit::Torque | Unit::Current => Some(Given::Percent),
        Unit::Rpm => Some(Given::Rpm),
        Unit::Millis | Unit::Ramp => Some(Given::Millis),
        Unit::Position => Some(Given::Turns),
        Unit::DeciAmpere => Some(Given::Ampere),
        Unit::Raw
        | Unit::Status
        | Unit::Errors
        | Unit::Io
        | Unit::Mode
        | Unit::Identifier
        | Unit::BitTiming
        | Unit::Flag => None,
    }
}

/// A value with its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    digits: i64,
    given: Given,
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = self.given.places();
        let power = 10u64.pow(places);
        let size = self.digits.unsigned_abs();
        let sign = if self.digits < 0 { "-" } else { "" };
        write!(f, "{sign}{}", size / power)?;
        if places > 0 {
            write!(f, ".{:0width$}", size % power, width = places as usize)?;
        }
        let blank = if self.given == Given::Percent {
            ""
        } else {
            " "
        };
        write!(f, "{blank}{}", self.given.name())
    }
}

/// Why a value cannot be written to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadValue {
    /// The register is not counted in this unit, or the drive's scale for it is 0.
    Unit {
        /// The register.
        register: u8,
        /// The unit as it was given.
        given: Given,
    },
    /// The register does not hold it.
    Range {
        /// The register.
        register: u8,
        /// The smallest raw number.
        least: i64,
        /// The largest raw number.
        most: i64,
    },
}

impl fmt::Display for BadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Unit { register, given } => {
                let register = Register::of(register);
                write!(
                    f,
                    "register {:02X} ({}) is not counted in {}",
                    register.number,
                    register.name,
                    given.name()
                )?;
                match usual(register.unit) {
                    Some(unit) => write!(f, ": give it in {}", unit.name()),
                    None => f.write_str(": give the raw number"),
                }
            }
            Self::Range {
                register,
                least,
                most,
            } => {
                let name = Register::of(register).name;
                write!(
                    f,
                    "the value is out of range: register {register:02X} ({name}) takes raw numbers from {least} to {most}"
                )
            }
        }
    }
}

impl core::error::Error for BadValue {}
