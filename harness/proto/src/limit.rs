//! The settings in the `[limits]` of a rig's file that deny something.

use core::fmt;

/// A setting of a rig's `[limits]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LimitSetting {
    /// Motors may turn.
    Motion,
    /// EEPROMs may be written.
    Eeprom,
    /// Drives may be reset.
    Reset,
    /// Outputs may be set.
    Outputs,
    /// The monitoring of time-outs may be switched.
    Monitoring,
    /// The highest speed.
    MaxSpeed,
    /// The most bytes in a second.
    BytesPerSecond,
}

impl LimitSetting {
    /// Those that permit something.
    pub const PERMISSIONS: [Self; 5] = [
        Self::Motion,
        Self::Eeprom,
        Self::Reset,
        Self::Outputs,
        Self::Monitoring,
    ];
    /// All, in the order of a rig's file.
    pub const ALL: [Self; 7] = [
        Self::Motion,
        Self::Eeprom,
        Self::Reset,
        Self::Outputs,
        Self::Monitoring,
        Self::MaxSpeed,
        Self::BytesPerSecond,
    ];
}

/// The change of the setting that permits more.
impl fmt::Display for LimitSetting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Motion => "`allow_motion`",
            Self::Eeprom => "`allow_eeprom`",
            Self::Reset => "`allow_reset`",
            Self::Outputs => "`allow_outputs`",
            Self::Monitoring => "`allow_monitoring`",
            Self::MaxSpeed => "no `max_speed`",
            Self::BytesPerSecond => "a higher `max_bytes_per_second`",
        })
    }
}
