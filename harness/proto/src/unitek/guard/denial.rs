//! Why a frame is not sent.

use super::{Limits, ValueRange};
use crate::unitek::register::Register;
use core::fmt;

/// A permission that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Missing {
    /// [`Limits::motion`].
    Motion,
    /// [`Limits::eeprom`].
    Eeprom,
    /// [`Limits::bus_settings`].
    BusSettings,
    /// [`Limits::way_back`].
    WayBack,
    /// [`Limits::motion`], [`Limits::eeprom`] and [`Limits::bus_settings`].
    All,
    /// [`Limits::named`].
    Named,
}

impl Missing {
    pub(super) fn held(self, limits: &Limits) -> bool {
        match self {
            Self::Motion => limits.motion,
            Self::Eeprom => limits.eeprom,
            Self::BusSettings => limits.bus_settings,
            Self::WayBack => limits.way_back,
            Self::All => limits.all(),
            Self::Named => false,
        }
    }

    /// What the rig's file has to say.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motion => "`allow_motion` in the rig's [limits] and --allow-motion",
            Self::Eeprom => "`allow_eeprom` in the rig's [limits]",
            Self::BusSettings => "`allow_bus_settings` in the rig's [limits]",
            Self::WayBack => {
                "`bit_rate_way_back` in the rig's [limits], which says how the drive is reached again"
            }
            Self::All => {
                "`allow_motion`, `allow_eeprom` and `allow_bus_settings` in the rig's [limits], and --allow-motion"
            }
            Self::Named => "the register in `allow_registers` of the rig's [limits]",
        }
    }
}

/// Why a frame is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Denial {
    /// No drive of the rig's file receives on its identifier.
    Identifier,
    /// The rig's file does not permit it.
    NotPermitted {
        /// The register.
        register: u8,
        /// What is missing.
        missing: Missing,
    },
    /// No rig file can permit it.
    Never {
        /// The register.
        register: u8,
    },
    /// The rig's file permits other values of the register, all of its bits written.
    Range(ValueRange),
    /// 16 bits to 35 or ED: the upper half, the torque ramp, would become 0.
    HalfRamp {
        /// The register.
        register: u8,
    },
    /// The motor could turn faster than [`Limits::max_speed`].
    Speed {
        /// The register.
        register: u8,
        /// Why.
        fast: FastWrite,
    },
    /// The replies of all cycles would take more than half of the bit rate.
    Load {
        /// Thousandths of the bit rate.
        permille: u64,
    },
    /// The drive would get an identifier that another drive may use, or that it uses itself for the other direction.
    Taken {
        /// The register.
        register: u8,
        /// The identifier.
        identifier: u16,
    },
    /// 84 was written less than a minute ago.
    EepromWear,
    /// New bus settings would be stored, after which the drive may be reachable by RS232 only.
    LostDrive,
}

/// Why a write could turn a motor faster than [`Limits::max_speed`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FastWrite {
    /// The value is above the highest speed.
    Above {
        /// The highest speed as 31 counts it.
        most: u16,
    },
    /// The motor would turn as fast as 34 allows, and 34 is not known to be within the highest speed.
    LimitUnknown {
        /// The highest speed as 31 counts it.
        most: u16,
    },
    /// What 100 % is was not read.
    FullUnknown,
    /// It changes what 100 % is.
    Scale,
}

impl fmt::Display for FastWrite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Above { most } => write!(f, "the value is above `max_speed`: at most {most} of 32767 is permitted"),
            Self::LimitUnknown { most } => write!(
                f,
                "register 34 (SPEED_LIMIT) is not known to be within `max_speed`: write at most {most} of 32767 to it first"
            ),
            Self::FullUnknown => f.write_str(
                "`max_speed` is in rpm, and register C8 (SPEED_RPMMAX), which says what 100 % is, was not read",
            ),
            Self::Scale => f.write_str(
                "it changes what 100 % speed is: remove `max_speed` from the rig file",
            ),
        }
    }
}

impl fmt::Display for Denial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |register: u8| Register::of(register).name;
        match *self {
            Self::Identifier => f.write_str(
                "no drive of the rig file receives on this identifier: add the drive to the rig file, or `allow_other_identifiers` to its [limits]",
            ),
            Self::NotPermitted { register, missing } => write!(
                f,
                "a write to register {register:02X} ({}) needs {}",
                name(register),
                missing.name()
            ),
            Self::Never { register } => write!(
                f,
                "a write to register {register:02X} ({}) can make the drive unusable; no rig file permits it",
                name(register)
            ),
            Self::Range(ValueRange { register, least, most }) => write!(
                f,
                "a write to register {register:02X} ({}) is permitted from {least} to {most}, all of its bits at once, by `ranges` in the rig's [limits]",
                name(register)
            ),
            Self::HalfRamp { register } => write!(
                f,
                "16 bits for register {register:02X} ({}) also set its upper half to 0: read it first, then write all 32 bits",
                name(register)
            ),
            Self::Speed { register, fast } => {
                write!(f, "a write to register {register:02X} ({}) could turn the motor too fast: {fast}", name(register))
            }
            Self::Load { permille } => write!(
                f,
                "the cyclic replies would take {}.{} % of the bit rate, at most 50 % are permitted: stop a cycle, or ask less often",
                permille / 10,
                permille % 10
            ),
            Self::Taken { register, identifier } => write!(
                f,
                "register {register:02X} ({}) would get the identifier {identifier:03X}, which is in use or may be: each identifier has one drive and one direction (UNITEK 3.1); use another one",
                name(register)
            ),
            Self::EepromWear => {
                f.write_str("the EEPROM was written less than a minute ago: wait before the next write of 84")
            }
            Self::LostDrive => f.write_str(
                "new identifiers or a new bit rate would be stored, and the drive may then answer on RS232 only: confirm it with `store_bus_settings` in the rig file",
            ),
        }
    }
}

impl core::error::Error for Denial {}
