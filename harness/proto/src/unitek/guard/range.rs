//! Which values the rig's file permits in a register.
//!
//! The manual prints no range of a parameter, but a drive of the rig may have one.

use crate::unitek::frame::Data;
use crate::unitek::register::{Register, Width};

/// The values that may be written to a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ValueRange {
    /// The register.
    pub register: u8,
    /// The lowest value.
    pub least: i64,
    /// The highest value.
    pub most: i64,
}

impl ValueRange {
    /// All values that a register has room for.
    #[must_use]
    pub fn whole(register: &Register) -> Self {
        let bits = register.width.bits();
        let (least, most) = match register.signed {
            true => (-(1 << (bits - 1)), (1 << (bits - 1)) - 1),
            false => (0, (1 << bits) - 1),
        };
        Self {
            register: register.number,
            least,
            most,
        }
    }

    /// Whether this may be written. What a write of 16 bits leaves in a register of 32 is open (`short-write`), so that it may not.
    pub(super) fn admits(self, data: Data) -> bool {
        let register = Register::of(self.register);
        let all_bits = register.width == Width::Bits16 || matches!(data, Data::Long(_));
        all_bits && (self.least..=self.most).contains(&register.number_of(data.bits()))
    }
}
