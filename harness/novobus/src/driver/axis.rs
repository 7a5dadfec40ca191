//! Axis numbers (ND21 12.2): loop 1 has 0x0000-0x00f9, loop 2 0x0100-0x01f9.

use core::fmt;
use harness_proto::novobus::address::MAX_DRIVES;

/// The number of a drive on a bus of one or two rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Axis(u16);

impl Axis {
    /// Drive `drive` of ring 0 or 1; `None` beyond drive 249 or ring 1.
    #[must_use]
    pub fn new(ring: usize, drive: u8) -> Option<Self> {
        if u64::from(drive) >= u64::from(MAX_DRIVES) {
            return None;
        }
        match ring {
            0 => Some(Self(u16::from(drive))),
            1 => Some(Self(0x0100 | u16::from(drive))),
            _ => None,
        }
    }

    /// The axis of this number of the manual.
    #[must_use]
    pub fn from_number(number: u16) -> Option<Self> {
        let [ring, drive] = number.to_be_bytes();
        Self::new(usize::from(ring), drive)
    }

    /// The number of the manual.
    #[must_use]
    pub const fn number(self) -> u16 {
        self.0
    }

    /// The ring, counted from 0.
    #[must_use]
    pub const fn ring(self) -> usize {
        (self.0 >> 8) as usize
    }

    /// The drive in its ring.
    #[must_use]
    pub const fn drive(self) -> u8 {
        self.0.to_le_bytes()[0]
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.ring() > 0 {
            write!(f, "{}:", self.ring() + 1)?;
        }
        write!(f, "{}", self.drive())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 12.2.
    #[test]
    fn numbers_of_12_2() {
        for (number, ring, drive) in [
            (0x0000, 0, 0),
            (0x00F9, 0, 249),
            (0x0100, 1, 0),
            (0x01F9, 1, 249),
        ] {
            let axis = Axis::from_number(number).unwrap();
            assert_eq!(
                (axis.ring(), axis.drive(), axis.number()),
                (ring, drive, number)
            );
        }
        for number in [0x00FA, 0x01FA, 0x0200, 0xFFFF] {
            assert_eq!(Axis::from_number(number), None);
        }
        assert_eq!(Axis::new(1, 3).unwrap().to_string(), "2:3");
    }
}
