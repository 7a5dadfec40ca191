//! The highest speed that a drive may be told.

use super::HighestSpeed;
use super::denial::FastWrite;
use crate::unitek::words::MODE_LOCK;

/// What is known of the speed at which a drive would turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Speed {
    /// C8: the rpm of 100 %.
    pub(super) full: Option<u16>,
    /// 34, which bounds the speed in every mode, without its sign.
    pub(super) limit: Option<u16>,
    /// 31 without its sign, where it was the last command.
    command: Option<u16>,
}

impl Speed {
    /// The highest permitted speed as 31 counts it; `None` where C8 is not known.
    fn most(self, max: HighestSpeed) -> Option<u16> {
        match max {
            HighestSpeed::Raw(raw) => Some(raw),
            HighestSpeed::Rpm(rpm) => {
                let full = u32::from(self.full?);
                // The nearest, so that a command of exactly this speed passes.
                let raw = (2 * u32::from(rpm) * 32_767 + full).checked_div(2 * full)?;
                Some(u16::try_from(raw).unwrap_or(u16::MAX))
            }
        }
    }

    /// Why a permitted write does not pass while there is a highest speed.
    pub(super) fn denies(self, max: HighestSpeed, register: u8, value: u16) -> Option<FastWrite> {
        let size = value.cast_signed().unsigned_abs();
        let bounds_itself = match register {
            // They change what 100 % is, or bring back a whole set of registers with it.
            0x83 | 0xC8 => return Some(FastWrite::Scale),
            0x51 if value & MODE_LOCK != 0 => return None,
            0x21 | 0x31 | 0x90 if value == 0 => return None,
            0x31 | 0x34 | 0x76 | 0x77 => Some(size),
            0x51 | 0x8E => self.command,
            0x21 | 0x36 | 0x6E | 0x78 | 0x85 | 0x90 => None,
            _ => return None,
        };
        let Some(most) = self.most(max) else {
            return Some(FastWrite::FullUnknown);
        };
        let within = |speed: Option<u16>| speed.is_some_and(|speed| speed <= most);
        let limited = !matches!(register, 0x34 | 0x76 | 0x77) && within(self.limit);
        match (within(bounds_itself) || limited, bounds_itself) {
            (true, _) => None,
            (false, Some(_)) => Some(FastWrite::Above { most }),
            (false, None) => Some(FastWrite::LimitUnknown { most }),
        }
    }

    pub(super) fn written(&mut self, register: u8, value: u16, sure: bool) {
        let size = sure.then(|| value.cast_signed().unsigned_abs());
        match register {
            0x31 => self.command = size,
            // No torque turns no motor.
            0x90 if value == 0 => self.command = size,
            0x6E | 0x78 | 0x90 => self.command = None,
            0x34 => self.limit = size,
            0x83 | 0xC8 => *self = Self::default(),
            _ => {}
        }
    }
}
