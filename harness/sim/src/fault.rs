//! The faults that a bench can put on a wire or into a drive, in the words of the scenario language.

use harness_proto::line::LineError;
use harness_proto::time::Span;
use std::fmt;

/// Which bits of a byte on the wire are inverted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Flips {
    /// Data bits.
    pub data: u8,
    /// The parity bit.
    pub parity: bool,
    /// The stop bit.
    pub stop: bool,
    /// The start bit: the receiver takes a later bit for it, and reads on from there.
    pub start: bool,
}

impl Flips {
    /// Both, one after the other: a bit flipped twice is not flipped.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            data: self.data ^ other.data,
            parity: self.parity ^ other.parity,
            stop: self.stop ^ other.stop,
            start: self.start ^ other.start,
        }
    }

    /// What the receiver notices: a stop bit of 0, or an odd number of flips among the data bits and
    /// the parity bit. An even number goes unnoticed. Without its start bit a byte is another byte, see `uart`.
    #[must_use]
    pub fn noticed(self) -> Option<LineError> {
        let odd = (self.data.count_ones() + u32::from(self.parity)) % 2 == 1;
        if self.stop {
            Some(LineError::Framing)
        } else if odd {
            Some(LineError::Parity)
        } else {
            None
        }
    }
}

/// Something that happens to a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LinkFault {
    /// Bits of the byte are inverted.
    Flip(Flips),
    /// Another byte arrives in its place, with good parity.
    Replace(u8),
    /// The byte does not arrive.
    Drop,
    /// It arrives twice.
    Duplicate,
    /// A byte that was not sent arrives before it.
    Insert(u8),
    /// It arrives later; what follows does not overtake it.
    Delay(Span),
    /// The line is held at 0 from the byte's start on: a break is read, and what is sent meanwhile is lost.
    Break(Span),
    /// The receiver was too slow for it.
    Overrun,
    /// From here on nothing arrives.
    Cut,
    /// From here on everything arrives again.
    Join,
}

impl LinkFault {
    /// Whether it changes one byte; the others act on the line at once.
    #[must_use]
    pub const fn takes_a_byte(self) -> bool {
        !matches!(self, Self::Break(_) | Self::Cut | Self::Join)
    }
}

impl fmt::Display for LinkFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flip(flips) => {
                f.write_str("flip")?;
                if flips.start {
                    f.write_str(" b")?;
                }
                for bit in 0..8 {
                    if flips.data >> bit & 1 == 1 {
                        write!(f, " {bit}")?;
                    }
                }
                if flips.parity {
                    f.write_str(" p")?;
                }
                if flips.stop {
                    f.write_str(" s")?;
                }
                Ok(())
            }
            Self::Replace(byte) => write!(f, "replace {byte:02X}"),
            Self::Drop => f.write_str("drop"),
            Self::Duplicate => f.write_str("duplicate"),
            Self::Insert(byte) => write!(f, "insert {byte:02X}"),
            Self::Delay(span) => write!(f, "delay {span}"),
            Self::Break(span) => write!(f, "break {span}"),
            Self::Overrun => f.write_str("overrun"),
            Self::Cut => f.write_str("cut"),
            Self::Join => f.write_str("join"),
        }
    }
}

/// Something that happens to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DriveFault {
    /// It has no power: it reads nothing and sends nothing.
    Off,
    /// The power is back: everything but the EEPROM is lost.
    On,
    /// Its transmitter sends this byte in place of every other.
    Stuck(u8),
    /// Its transmitter works again.
    Unstuck,
}

impl fmt::Display for DriveFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::On => f.write_str("on"),
            Self::Stuck(byte) => write!(f, "stuck {byte:02X}"),
            Self::Unstuck => f.write_str("unstuck"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_number_of_flips_goes_unnoticed() {
        let flips = |data, parity, stop| {
            let flips = Flips {
                data,
                parity,
                stop,
                start: false,
            };
            flips.noticed()
        };
        assert_eq!(flips(0b1, false, false), Some(LineError::Parity));
        assert_eq!(flips(0b11, false, false), None);
        assert_eq!(flips(0b1, true, false), None);
        assert_eq!(flips(0, true, false), Some(LineError::Parity));
        assert_eq!(flips(0, false, true), Some(LineError::Framing));
    }
}
