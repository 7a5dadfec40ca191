//! An asynchronous serial line: how fast it is, and what a receiver reads from it.

use crate::time::Span;
use core::fmt;

/// Bits of one byte on the line: a start bit, 8 data bits, the odd parity bit and a stop bit (ND21 8.3).
pub const BITS_PER_BYTE: u64 = 11;

/// The rate of a line (ND21 8.3: 38400, with 19200 and 9600 to be set with the setup software).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Rate {
    /// 38400 bit/s: 286.458 us a byte.
    #[default]
    Baud38400,
    /// 19200 bit/s: 572.917 us a byte.
    Baud19200,
    /// 9600 bit/s: 1145.833 us a byte.
    Baud9600,
}

impl Rate {
    /// Every rate that an ND21 can be set to.
    pub const ALL: [Self; 3] = [Self::Baud38400, Self::Baud19200, Self::Baud9600];

    /// The rate in bits a second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            Self::Baud38400 => 38_400,
            Self::Baud19200 => 19_200,
            Self::Baud9600 => 9_600,
        }
    }

    /// The rate with this many bits a second, if an ND21 has it.
    #[must_use]
    pub fn from_bits_per_second(bits: u32) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|rate| rate.bits_per_second() == bits)
    }

    /// How long one bit takes; exact.
    #[must_use]
    pub const fn bit_time(self) -> Span {
        Span::from_units(3_000_000_000 / self.bits_per_second() as u64)
    }

    /// How long one byte takes, start bit to stop bit; exact.
    #[must_use]
    pub fn byte_time(self) -> Span {
        self.bit_time() * BITS_PER_BYTE
    }
}

/// The parity bit of an asynchronous line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Parity {
    /// No parity bit.
    None,
    /// The data bits and the parity bit hold an odd number of ones.
    Odd,
    /// They hold an even number of ones.
    Even,
}

/// The format of an asynchronous line with 8 data bits: its rate, parity and stop bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Format {
    /// Bits a second; 3,000,000,000 is a multiple of it where times are to be exact.
    pub bits_per_second: u32,
    /// The parity bit.
    pub parity: Parity,
    /// The number of stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl Format {
    /// How long an octet takes, start bit to last stop bit; zero for a rate of 0.
    #[must_use]
    pub fn octet_time(self) -> Span {
        let parity = u64::from(self.parity != Parity::None);
        let bits = 1 + 8 + parity + u64::from(self.stop_bits);
        let bit = 3_000_000_000u64.checked_div(self.bits_per_second.into());
        Span::from_units(bit.unwrap_or(0)) * bits
    }
}

impl From<Rate> for Format {
    /// 8O1, as the ND21 has it (ND21 8.3).
    fn from(rate: Rate) -> Self {
        Self {
            bits_per_second: rate.bits_per_second(),
            parity: Parity::Odd,
            stop_bits: 1,
        }
    }
}

/// What a receiver noticed to be wrong with a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineError {
    /// The parity bit does not fit the data bits.
    Parity,
    /// The stop bit was 0.
    Framing,
    /// The line was 0 for longer than a byte: a framing error with a 00 in it.
    Break,
    /// A byte came before the one before it had been fetched.
    Overrun,
}

impl LineError {
    /// The word that records and scenarios use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Parity => "parity",
            Self::Framing => "framing",
            Self::Break => "break",
            Self::Overrun => "overrun",
        }
    }
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A byte as its receiver reads it: the data bits and the line status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Received {
    /// The eight data bits.
    pub byte: u8,
    /// The line status; `None` for a good byte.
    pub error: Option<LineError>,
}

impl fmt::Display for Received {
    /// `88`, or `12 (parity)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02X}", self.byte)?;
        match self.error {
            Some(error) => write!(f, " ({error})"),
            None => Ok(()),
        }
    }
}

impl Received {
    /// A byte that arrived whole.
    #[must_use]
    pub const fn good(byte: u8) -> Self {
        Self { byte, error: None }
    }

    /// A byte that arrived damaged.
    #[must_use]
    pub const fn bad(byte: u8, error: LineError) -> Self {
        Self {
            byte,
            error: Some(error),
        }
    }

    /// Whether this is the byte `byte`, without a line error.
    #[must_use]
    pub fn is(self, byte: u8) -> bool {
        self.error.is_none() && self.byte == byte
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bit_times_are_exact() {
        for rate in Rate::ALL {
            assert_eq!(
                rate.bit_time().units() * u64::from(rate.bits_per_second()),
                3_000_000_000
            );
            assert_eq!(Format::from(rate).octet_time(), rate.byte_time());
        }
    }

    /// PROFIBUS DP: 8E1, 11 bits (12 Mbit/s is whole in thirds of a nanosecond).
    #[test]
    fn other_formats() {
        let even = Format {
            bits_per_second: 12_000_000,
            parity: Parity::Even,
            stop_bits: 1,
        };
        assert_eq!(even.octet_time().units(), 250 * 11);
        let none = Format {
            parity: Parity::None,
            stop_bits: 2,
            ..even
        };
        assert_eq!(none.octet_time(), even.octet_time());
        let stopped = Format {
            bits_per_second: 0,
            ..even
        };
        assert_eq!(stopped.octet_time(), Span::ZERO);
    }
}
