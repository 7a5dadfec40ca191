//! NBT, register 73: the bit timing of the bus (UNITEK 3.1).
//!
//! The five printed values are the bytes BTR1, BTR0 of a controller of the SJA1000 family at 10 MHz (our arithmetic): TSEG1 in
//! bits 3 to 0, TSEG2 in bits 6 to 4, BRP in bits 13 to 8.

use crate::can::BitRate;

/// A value of register 73.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Nbt(pub u16);

/// A rate as the manual prints it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrintedRate {
    /// The value of register 73.
    pub nbt: Nbt,
    /// The rate.
    pub rate: BitRate,
    /// The longest cable in metres.
    pub cable_m: u16,
}

/// The table of 3.1. The rates are printed in kBaud.
pub const PRINTED: [PrintedRate; 5] = [
    printed(0x4002, BitRate::M1, 20),
    printed(0x4025, BitRate::K500, 70),
    printed(0x4014, BitRate::K625, 70),
    printed(0x405C, BitRate::K250, 100),
    printed(0x4425, BitRate::K100, 500),
];

const fn printed(nbt: u16, rate: BitRate, cable_m: u16) -> PrintedRate {
    PrintedRate {
        nbt: Nbt(nbt),
        rate,
        cable_m,
    }
}

impl Nbt {
    /// 500 kbit/s: the standard of the manufacturer (4.1), and the value of the dump.
    pub const DEFAULT: Self = Self(0x4025);

    const fn tseg1(self) -> u32 {
        self.0 as u32 & 0xF
    }

    const fn tseg2(self) -> u32 {
        self.0 as u32 >> 4 & 0x7
    }

    const fn prescaler(self) -> u32 {
        (self.0 as u32 >> 8 & 0x3F) + 1
    }

    /// How many quanta a bit has: 3 to 25.
    #[must_use]
    pub const fn quanta(self) -> u32 {
        3 + self.tseg1() + self.tseg2()
    }

    /// How long a bit takes, in ns: quanta of 200 ns times the prescaler.
    #[must_use]
    pub const fn bit_nanos(self) -> u32 {
        200 * self.prescaler() * self.quanta()
    }

    /// The rate, if it is at most 1 Mbit/s and a whole number of bits a second.
    #[must_use]
    pub const fn rate(self) -> Option<BitRate> {
        let nanos = self.bit_nanos();
        if 1_000_000_000 % nanos != 0 {
            return None;
        }
        BitRate::from_bits_per_second(1_000_000_000 / nanos)
    }

    /// Where a bit is sampled, in tenths of a per cent of the bit, rounded down.
    #[must_use]
    pub const fn sample_point_permille(self) -> u32 {
        (2 + self.tseg1()) * 1000 / self.quanta()
    }

    /// The row of the manual's table with this value, if it is printed.
    #[must_use]
    pub fn printed(self) -> Option<&'static PrintedRate> {
        PRINTED.iter().find(|row| row.nbt == self)
    }

    /// The printed value for a rate.
    #[must_use]
    pub fn for_rate(rate: BitRate) -> Option<Self> {
        PRINTED
            .iter()
            .find(|row| row.rate == rate)
            .map(|row| row.nbt)
    }
}
