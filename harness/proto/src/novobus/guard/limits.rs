//! The permissions of a rig, and the permissions that an act needs.

use super::denial::Cause;
use crate::limit::LimitSetting;
use core::fmt;

/// The permissions of a rig. Reading and stopping need none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Motors may start, change their speed or their place; parameters of the regulators may be written.
    pub motion: bool,
    /// The EEPROM may be written (ND21 14.10.5).
    pub eeprom: bool,
    /// Drives may be reset (ND21 10.5). A reset ends a software block and a software stop (11.8), so it needs `motion` as well.
    pub reset: bool,
    /// Digital and analogue outputs may be changed (ND21 10.4, 14.7).
    pub outputs: bool,
    /// Time-out monitoring may be switched on (ND21 14.10.2): a pause of 10 ms stops the ring after that.
    pub monitoring: bool,
    /// The highest speed of a motor that the bus may cause, in rpm; `None` for any. A raw speed counts in the range of its
    /// drive (ND21 14.3.2, 14.5.3.1), and where that is not known in the one to 12000 rpm, in which a bit is worth most.
    pub max_speed: Option<u16>,
    /// Maximum number of bytes that may begin within a second on the link's clock; `None`: as many as the line carries. Bytes queued
    /// at one time count at that time.
    pub bytes_per_second: Option<u32>,
    /// Maximum number of bytes that may pass in total.
    pub most_bytes: u64,
}

impl Default for Limits {
    /// Permits only reading and stopping, for about 80 hours at 38400 bit/s.
    fn default() -> Self {
        Self {
            motion: false,
            eeprom: false,
            reset: false,
            outputs: false,
            monitoring: false,
            max_speed: None,
            bytes_per_second: None,
            most_bytes: 1_000_000_000,
        }
    }
}

impl Limits {
    /// Permits everything, as on a bench of simulated drives.
    #[must_use]
    pub fn unlimited() -> Self {
        Self {
            motion: true,
            eeprom: true,
            reset: true,
            outputs: true,
            monitoring: true,
            ..Self::default()
        }
    }

    /// Whether every act is allowed, with any value.
    #[must_use]
    pub const fn allow_everything(&self) -> bool {
        self.motion
            && self.eeprom
            && self.reset
            && self.outputs
            && self.monitoring
            && self.max_speed.is_none()
    }

    /// The same with one setting changed so that it denies nothing.
    #[must_use]
    pub const fn without(self, setting: LimitSetting) -> Self {
        let mut more = self;
        match setting {
            LimitSetting::Motion => more.motion = true,
            LimitSetting::Eeprom => more.eeprom = true,
            LimitSetting::Reset => more.reset = true,
            LimitSetting::Outputs => more.outputs = true,
            LimitSetting::Monitoring => more.monitoring = true,
            LimitSetting::MaxSpeed => more.max_speed = None,
            LimitSetting::BytesPerSecond => more.bytes_per_second = None,
        }
        more
    }

    /// The settings that deny something for this reason.
    pub fn denying(&self, cause: Cause) -> impl Iterator<Item = LimitSetting> {
        let limits = *self;
        let need = match cause {
            Cause::NotAllowed { missing, .. } => missing,
            // If everything is allowed, bytes that the guard cannot interpret pass.
            Cause::InDoubt
            | Cause::BehindReset
            | Cause::BehindSilence
            | Cause::NoAddress
            | Cause::CheckSequence
            | Cause::NotKnown { most: None, .. } => Need::EVERYTHING,
            Cause::TooFast { .. }
            | Cause::HalfSpeed { .. }
            | Cause::Faster { .. }
            | Cause::NotKnown { most: Some(_), .. } => Need::ANY_SPEED,
            Cause::TooMany { .. } | Cause::TooLong { .. } | Cause::Closed => Need::NONE,
        };
        let rate = matches!(cause, Cause::TooMany { .. });
        LimitSetting::ALL
            .into_iter()
            .filter(move |setting| match setting {
                LimitSetting::Motion => need.contains(Need::MOTION) && !limits.motion,
                LimitSetting::Eeprom => need.contains(Need::EEPROM) && !limits.eeprom,
                LimitSetting::Reset => need.contains(Need::RESET) && !limits.reset,
                LimitSetting::Outputs => need.contains(Need::OUTPUTS) && !limits.outputs,
                LimitSetting::Monitoring => need.contains(Need::MONITORING) && !limits.monitoring,
                LimitSetting::MaxSpeed => {
                    need.contains(Need::ANY_SPEED) && limits.max_speed.is_some()
                }
                LimitSetting::BytesPerSecond => rate,
            })
    }

    /// The part of `need` that is not permitted.
    #[must_use]
    pub const fn missing(&self, need: Need) -> Need {
        let mut has = 0;
        if self.motion {
            has |= Need::MOTION.0;
        }
        if self.eeprom {
            has |= Need::EEPROM.0;
        }
        if self.reset {
            has |= Need::RESET.0;
        }
        if self.outputs {
            has |= Need::OUTPUTS.0;
        }
        if self.monitoring {
            has |= Need::MONITORING.0;
        }
        if self.allow_everything() {
            has |= Need::EVERYTHING.0;
        }
        Need(need.0 & !has)
    }
}

/// The permissions of the rig that an act needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Need(u8);

impl Need {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// [`Limits::motion`].
    pub const MOTION: Self = Self(1);
    /// [`Limits::eeprom`].
    pub const EEPROM: Self = Self(1 << 1);
    /// [`Limits::reset`].
    pub const RESET: Self = Self(1 << 2);
    /// [`Limits::outputs`].
    pub const OUTPUTS: Self = Self(1 << 3);
    /// [`Limits::monitoring`].
    pub const MONITORING: Self = Self(1 << 5);
    /// Any speed: no [`Limits::max_speed`].
    const ANY_SPEED: Self = Self(1 << 4);
    /// All of them and no `max_speed`: the manual does not say what it does, or it changes what this guard relies on.
    pub const EVERYTHING: Self = Self(0b11_1111);

    /// Both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether it is nothing.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// Whether all of `other` is needed.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = [
            (
                Self::MOTION,
                "`allow_motion` in the rig's [limits] and --allow-motion",
            ),
            (Self::EEPROM, "`allow_eeprom` in the rig's [limits]"),
            (Self::RESET, "`allow_reset` in the rig's [limits]"),
            (Self::OUTPUTS, "`allow_outputs` in the rig's [limits]"),
            (Self::MONITORING, "`allow_monitoring` in the rig's [limits]"),
        ];
        let mut first = true;
        for (need, name) in names {
            if self.contains(need) {
                let and = if first { "" } else { ", " };
                write!(f, "{and}{name}")?;
                first = false;
            }
        }
        if self.contains(Self::ANY_SPEED) {
            let and = if first { "" } else { ", " };
            write!(
                f,
                "{and}no `max_speed`, as the manual does not say what it does"
            )?;
        }
        Ok(())
    }
}
