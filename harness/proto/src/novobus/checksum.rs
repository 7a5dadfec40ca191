//! The checking bytes of the parameter channel (ND21 9.6).
//!
//! Only bytes of the parameter channel count: sync byte, address byte and process data do not.

/// A running sum over the bytes of one command or of one answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Checksum(u8);

impl Checksum {
    /// The sum of nothing.
    pub const EMPTY: Self = Self(0);

    /// The sum over `bytes`.
    #[must_use]
    pub fn over(bytes: &[u8]) -> Self {
        bytes.iter().fold(Self::EMPTY, |sum, &byte| sum.with(byte))
    }

    /// The sum with one more byte in it.
    #[must_use]
    pub const fn with(self, byte: u8) -> Self {
        Self(self.0.wrapping_add(byte))
    }

    /// The +checksum: the checking byte of a command.
    #[must_use]
    pub const fn plus(self) -> u8 {
        never_zero(self.0)
    }

    /// The -checksum: the checking byte of an answer.
    #[must_use]
    pub const fn minus(self) -> u8 {
        never_zero(self.0.wrapping_neg())
    }
}

/// "Instead of 0, 1 is to be sent. (H'00 is reserved for error messages)" (ND21 9.6).
const fn never_zero(sum: u8) -> u8 {
    if sum == 0 { 1 } else { sum }
}
