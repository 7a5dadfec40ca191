//! Bit rates of a PROFIBUS segment, and the times that are counted in bits (EN 1).

use crate::line::{Format, Parity};
use crate::time::Span;

/// Idle bits before every request (T_SYN).
pub const SYN_BITS: u64 = 33;
/// Bits from the end of a request to the begin of its reply, at least (min T_SDR), before Set_Prm changes it.
pub const MIN_TSDR_BITS: u64 = 11;
/// Bits of one octet: a start bit, 8 data bits, the even parity bit and a stop bit.
pub const OCTET_BITS: u64 = 11;

/// The rate of a segment: one of the six that the GSD of the NORDAC *vector* lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BusRate {
    /// 9.6 kbit/s.
    K9_6,
    /// 19.2 kbit/s.
    K19_2,
    /// 93.75 kbit/s.
    K93_75,
    /// 187.5 kbit/s.
    K187_5,
    /// 500 kbit/s.
    #[default]
    K500,
    /// 1.5 Mbit/s.
    K1500,
}

impl BusRate {
    /// Every rate, slowest first.
    pub const ALL: [Self; 6] = [
        Self::K9_6,
        Self::K19_2,
        Self::K93_75,
        Self::K187_5,
        Self::K500,
        Self::K1500,
    ];

    /// The rate in bits a second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            Self::K9_6 => 9_600,
            Self::K19_2 => 19_200,
            Self::K93_75 => 93_750,
            Self::K187_5 => 187_500,
            Self::K500 => 500_000,
            Self::K1500 => 1_500_000,
        }
    }

    /// The rate in kbit/s, as scenarios and GSD files write it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::K9_6 => "9.6",
            Self::K19_2 => "19.2",
            Self::K93_75 => "93.75",
            Self::K187_5 => "187.5",
            Self::K500 => "500",
            Self::K1500 => "1500",
        }
    }

    /// The rate with this [`name`](Self::name).
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|rate| rate.name() == name)
    }

    /// The rate with this many bits a second.
    #[must_use]
    pub fn from_bits_per_second(bits: u32) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|rate| rate.bits_per_second() == bits)
    }

    /// The line: 8E1.
    #[must_use]
    pub const fn format(self) -> Format {
        Format {
            bits_per_second: self.bits_per_second(),
            parity: Parity::Even,
            stop_bits: 1,
        }
    }

    /// How long one bit takes; exact.
    #[must_use]
    pub const fn bit_time(self) -> Span {
        Span::from_units(3_000_000_000 / self.bits_per_second() as u64)
    }

    /// How long one octet takes, start bit to stop bit; exact.
    #[must_use]
    pub fn octet_time(self) -> Span {
        self.bit_time() * OCTET_BITS
    }

    /// Bits after which a reply has begun at the latest (MaxTsdr of the GSD).
    #[must_use]
    pub const fn max_tsdr_bits(self) -> u64 {
        match self {
            Self::K9_6 | Self::K19_2 | Self::K93_75 | Self::K187_5 => 60,
            Self::K500 => 100,
            Self::K1500 => 150,
        }
    }
}

impl From<BusRate> for Format {
    fn from(rate: BusRate) -> Self {
        rate.format()
    }
}
