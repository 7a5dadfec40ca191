//! Why a telegram is not completed.

use super::limits::Limits;
use crate::counted::counted;
use crate::profibus::dp::Service;
use core::fmt;

/// A permission that is missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Missing {
    /// [`Limits::motion`].
    Motion,
    /// [`Limits::eeprom`].
    Eeprom,
    /// [`Limits::motor_data`].
    MotorData,
    /// [`Limits::bus_settings`].
    BusSettings,
    /// All four of them.
    Everything,
}

impl Missing {
    pub(super) const fn held(self, limits: &Limits) -> bool {
        match self {
            Self::Motion => limits.motion,
            Self::Eeprom => limits.eeprom,
            Self::MotorData => limits.motor_data,
            Self::BusSettings => limits.bus_settings,
            Self::Everything => limits.all(),
        }
    }

    /// What the rig's file has to say.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motion => "`allow_motion` in the rig's [limits] and --allow-motion",
            Self::Eeprom => "`allow_eeprom` in the rig's [limits]",
            Self::MotorData => "`allow_motor_data` in the rig's [limits]",
            Self::BusSettings => "`allow_bus_settings` in the rig's [limits]",
            Self::Everything => {
                "`allow_motion`, `allow_eeprom`, `allow_motor_data` and `allow_bus_settings` in the rig's [limits], and --allow-motion"
            }
        }
    }
}

/// What a telegram would do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Act {
    /// The control word has bits 10 and 3 to 0: it enables the motor, or a later word completes it.
    Enable {
        /// The control word.
        stw: u16,
    },
    /// The control word has bit 10 and selects parameter set 2, 3 or 4: other ramps, another maximum frequency.
    Set {
        /// The control word.
        stw: u16,
    },
    /// The control word has bits 10 and 7: it may acknowledge a fault, and terminals may then start the motor.
    Acknowledge {
        /// The control word.
        stw: u16,
    },
    /// A setpoint is not 0.
    Setpoint,
    /// A task of the parameter channel.
    Task {
        /// AK.
        ak: u8,
        /// PNU.
        number: u16,
    },
    /// Sync or Unsync: stored words become effective.
    Sync,
    /// Clear_Data: it does not stop a motor.
    Clear,
    /// A command to all slaves.
    Broadcast,
    /// Set_Prm with Unlock.
    Unlock,
    /// A service that changes something, or that is not listed.
    Service(Option<Service>),
}

impl fmt::Display for Act {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Enable { stw } => {
                write!(f, "control word {stw:04X}, which can enable the motor,")
            }
            Self::Set { stw } => write!(
                f,
                "control word {stw:04X}, which selects another parameter set,"
            ),
            Self::Acknowledge { stw } => {
                write!(f, "control word {stw:04X}, which acknowledges a fault,")
            }
            Self::Setpoint => f.write_str("a setpoint other than 0"),
            Self::Task { ak, number } => write!(f, "task {ak} on parameter {number}"),
            Self::Sync => f.write_str("Sync or Unsync"),
            Self::Clear => f.write_str("Clear_Data"),
            Self::Broadcast => f.write_str("a command to all slaves"),
            Self::Unlock => f.write_str("Set_Prm with Unlock"),
            Self::Service(Some(service)) => f.write_str(service.name()),
            Self::Service(None) => f.write_str("a request for a service that is not listed"),
        }
    }
}

/// Why the FCS of a telegram is kept back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FcsDenial {
    /// The rig's file does not permit it.
    NotPermitted {
        /// The station.
        station: u8,
        /// What the telegram would do.
        act: Act,
        /// What is missing.
        missing: Missing,
    },
    /// No rig file can permit it.
    Never {
        /// The station.
        station: u8,
        /// What the telegram would do.
        act: Act,
    },
    /// The rig's file lists no slave with this address.
    OtherStation {
        /// The station.
        station: u8,
    },
    /// The setpoint is above [`Limits::highest`], or cannot be compared with it.
    Speed {
        /// The station.
        station: u8,
        /// Why.
        fast: Fast,
    },
    /// The motor would be enabled with nothing to stop it if the bench fails.
    Unsupervised {
        /// The station.
        station: u8,
        /// What is not known to be on.
        watch: Supervision,
    },
    /// The exchange would end while the motor may be enabled: it would go on running.
    StillEnabled {
        /// The station.
        station: u8,
    },
    /// As many parameters were written as [`Limits::most_writes`] permits.
    Wear {
        /// How many.
        most: u32,
    },
}

/// Why a motor could turn faster than [`Limits::highest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fast {
    /// HSW is too large.
    Above {
        /// The largest HSW.
        most: u16,
    },
    /// 1205 of the set was not read.
    MaximumUnknown {
        /// 0 to 3 for sets 1 to 4.
        set: u8,
    },
    /// The second setpoint adds to the first, up to the maximum frequency.
    Second,
    /// The new value of 1205 is above the highest frequency.
    Maximum,
}

/// What stops a motor if the bench fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Supervision {
    /// The bus time-out 1625 of the inverter.
    Timeout,
    /// The watchdog of the slave.
    Watchdog,
}

impl fmt::Display for Fast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Above { most } => write!(f, "HSW is at most {most:04X} with the rig's `max_setpoint` or `max_frequency`"),
            Self::MaximumUnknown { set } => write!(
                f,
                "`max_frequency` is in Hz, and the maximum frequency (1205.{}) was not read",
                set + 1
            ),
            Self::Second => f.write_str("PZD4 adds to the setpoint: send 0 there, or remove `max_setpoint` or `max_frequency` from the rig file"),
            Self::Maximum => f.write_str("the new maximum frequency is above the rig's `max_frequency`"),
        }
    }
}

impl fmt::Display for FcsDenial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPermitted {
                station,
                act,
                missing,
            } => write!(f, "{act} to station {station} needs {}", missing.name()),
            Self::Never { station, act } => write!(
                f,
                "{act} to station {station} could start a motor that no guard stops; no rig file permits it"
            ),
            Self::OtherStation { station } => write!(
                f,
                "the rig file lists no slave {station}: add it, or `allow_other_stations` to [limits]"
            ),
            Self::Speed { station, fast } => {
                write!(
                    f,
                    "the motor of station {station} could turn too fast: {fast}"
                )
            }
            Self::Unsupervised {
                station,
                watch: Supervision::Timeout,
            } => write!(
                f,
                "the motor of station {station} would not stop if the bench fails: set its bus time-out (1625) above 0 and read it"
            ),
            Self::Unsupervised {
                station,
                watch: Supervision::Watchdog,
            } => write!(
                f,
                "the motor of station {station} would not stop if the bench fails: send Set_Prm with a watchdog first"
            ),
            Self::StillEnabled { station } => write!(
                f,
                "the motor of station {station} may be enabled and would go on running: send control word 047D first"
            ),
            Self::Wear { most } => write!(
                f,
                "{} written, as many as `max_eeprom_writes` of the rig file permits",
                counted(*most, "parameter")
            ),
        }
    }
}

impl core::error::Error for FcsDenial {}
