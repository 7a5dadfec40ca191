//! Controller Area Network: classic frames, their exact length on the wire, and bit rates (ISO 11898-1).
//!
//! A frame is a value; what the wire adds (CRC, stuff bits, delimiters) is computed and never stored.
//!
//! ```
//! use harness_proto::can::{BitRate, Frame};
//!
//! let frame: Frame = "201#3D4000".parse()?;
//! assert_eq!(frame.data(), [0x3D, 0x40, 0x00]);
//! assert_eq!(frame.to_string(), "201#3D4000");
//! // 47 bits and 8 for each byte, interframe space included, and 6 stuff bits.
//! assert_eq!(frame.wire_bits(), 77);
//! assert_eq!(BitRate::K500.time_of(frame.wire_bits()).as_nanos(), 154_000);
//! # Ok::<(), harness_proto::can::BadFrame>(())
//! ```

mod coder;

use crate::time::Span;
use coder::Coder;
use core::fmt;
use core::str::FromStr;

/// Most data bytes of a classic frame.
pub const MAX_DATA: usize = 8;

/// Bits that end a good frame: end of frame (7) and intermission (3). Nothing else is on the wire while they pass.
pub const END_BITS: u32 = 7 + 3;

/// Bits of an error frame that all stations begin together: flag (6), delimiter (8) and intermission (3).
pub const ERROR_FRAME_BITS: u32 = 6 + 8 + 3;

/// CRC delimiter, acknowledge slot and acknowledge delimiter, behind the CRC and never stuffed.
const ACKNOWLEDGE_BITS: u32 = 3;

const CRC_BITS: u32 = 15;

/// The identifier of a frame: 11 bits (base format) or 29 bits (extended format).
///
/// Identifiers of both formats with the same number differ. They are ordered by number within a format; for the order on
/// the wire see [`Frame::arbitration`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Id(u32);

impl Id {
    const EXTENDED: u32 = 1 << 31;
    /// The largest identifier of the base format.
    pub const MAX_BASE: u16 = 0x7FF;
    /// The largest identifier of the extended format.
    pub const MAX_EXTENDED: u32 = 0x1FFF_FFFF;

    /// An identifier of 11 bits; `None` above 7FF.
    #[must_use]
    pub const fn base(number: u16) -> Option<Self> {
        if number <= Self::MAX_BASE {
            Some(Self(number as u32))
        } else {
            None
        }
    }

    /// An identifier of 29 bits; `None` above 1FFF FFFF.
    #[must_use]
    pub const fn extended(number: u32) -> Option<Self> {
        if number <= Self::MAX_EXTENDED {
            Some(Self(number | Self::EXTENDED))
        } else {
            None
        }
    }

    /// The number, without the format.
    #[must_use]
    pub const fn number(self) -> u32 {
        self.0 & !Self::EXTENDED
    }

    /// Whether this is an identifier of 29 bits.
    #[must_use]
    pub const fn is_extended(self) -> bool {
        self.0 & Self::EXTENDED != 0
    }
}

impl fmt::Display for Id {
    /// Three hexadecimal digits, or eight for 29 bits, as candump writes them.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_extended() {
            write!(f, "{:08X}", self.number())
        } else {
            write!(f, "{:03X}", self.number())
        }
    }
}

impl fmt::Debug for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A classic CAN frame: a data frame with 0 to 8 bytes or a remote frame with a length of 0 to 8.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: Id,
    remote: bool,
    len: u8,
    /// Zero behind `len`, so that equal frames are equal.
    data: [u8; MAX_DATA],
}

impl Frame {
    /// A data frame.
    ///
    /// # Errors
    /// [`BadFrame::TooLong`] above 8 bytes.
    pub fn new(id: Id, data: &[u8]) -> Result<Self, BadFrame> {
        let mut bytes = [0; MAX_DATA];
        bytes
            .get_mut(..data.len())
            .ok_or(BadFrame::TooLong { len: data.len() })?
            .copy_from_slice(data);
        let len = u8::try_from(data.len()).map_err(|_| BadFrame::TooLong { len: data.len() })?;
        Ok(Self {
            id,
            remote: false,
            len,
            data: bytes,
        })
    }

    /// A data frame with an identifier of 11 bits.
    ///
    /// # Errors
    /// [`BadFrame::Identifier`] above 7FF, [`BadFrame::TooLong`] above 8 bytes.
    pub fn base(id: u16, data: &[u8]) -> Result<Self, BadFrame> {
        let id = Id::base(id).ok_or(BadFrame::Identifier { number: id.into() })?;
        Self::new(id, data)
    }

    /// A remote frame, which asks for a data frame with `len` bytes.
    ///
    /// # Errors
    /// [`BadFrame::TooLong`] above 8.
    pub fn remote(id: Id, len: usize) -> Result<Self, BadFrame> {
        let short = u8::try_from(len).ok().filter(|&len| len <= 8);
        Ok(Self {
            id,
            remote: true,
            len: short.ok_or(BadFrame::TooLong { len })?,
            data: [0; MAX_DATA],
        })
    }

    /// The identifier.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Whether this is a remote frame; it carries no data.
    #[must_use]
    pub const fn is_remote(&self) -> bool {
        self.remote
    }

    /// The data length code, 0 to 8.
    #[must_use]
    pub const fn dlc(&self) -> usize {
        self.len as usize
    }

    /// The data bytes; none in a remote frame.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        if self.remote {
            &[]
        } else {
            &self.data[..usize::from(self.len)]
        }
    }

    /// The arbitration field as a number: of two frames that begin together, the smaller one goes on.
    ///
    /// A data frame wins against a remote frame of the same identifier, and 11 bits against 29 that begin with them.
    #[must_use]
    pub const fn arbitration(&self) -> u32 {
        let number = self.id.number();
        let remote = self.remote as u32;
        if self.id.is_extended() {
            // Base identifier, SRR = 1, IDE = 1, 18 more bits, RTR.
            (number >> 18) << 21 | 0b11 << 19 | (number & 0x3_FFFF) << 1 | remote
        } else {
            // Identifier, RTR, IDE = 0.
            number << 21 | remote << 20
        }
    }

    /// How long the frame is on the wire, in bits: from the start bit to the end of the intermission, with CRC and the exact
    /// number of stuff bits.
    #[must_use]
    pub fn wire_bits(&self) -> u32 {
        let mut coded = self.coded();
        coded.push(coded.crc.into(), CRC_BITS);
        coded.bits + coded.stuffed + ACKNOWLEDGE_BITS + END_BITS
    }

    /// Bits from the start bit to the end of the acknowledge delimiter: where receivers that find a wrong CRC begin their
    /// error frame.
    #[must_use]
    pub fn bits_to_acknowledge(&self) -> u32 {
        self.wire_bits() - END_BITS
    }

    /// Bits from the start bit to the first bit that differs on the wire from another frame, that bit included; `None` for equal frames.
    ///
    /// Where two stations send different frames with equal arbitration fields, one of them finds a bit error there.
    #[must_use]
    pub fn bits_to_difference(&self, other: &Self) -> Option<u32> {
        let mut coder = Coder::default();
        for (own, its) in self.plain_bits().zip(other.plain_bits()) {
            let stuffed = coder.stuffed;
            coder.push(own, 1);
            if own != its {
                // A stuff bit behind the differing bit is not sent.
                return Some(coder.bits + stuffed);
            }
        }
        None
    }

    /// Header and data, without stuff bits and CRC. Equal headers mean equal lengths.
    fn plain_bits(&self) -> impl Iterator<Item = u32> + '_ {
        let (header, count) = self.header();
        let bits = |value: u64, count: u32| {
            (0..count)
                .rev()
                .map(move |place| (value >> place & 1) as u32)
        };
        let data = self
            .data()
            .iter()
            .flat_map(move |&byte| bits(byte.into(), 8));
        bits(header, count).chain(data)
    }

    /// The largest number of bits that a frame with these many data bytes can take on the wire, intermission included.
    #[must_use]
    pub const fn worst_wire_bits(extended: bool, data_bytes: usize) -> u32 {
        let bytes = if data_bytes < MAX_DATA {
            data_bytes as u32
        } else {
            8
        };
        let header = if extended { 39 } else { 19 };
        let stuffable = header + 8 * bytes + CRC_BITS;
        stuffable + (stuffable - 1) / 4 + ACKNOWLEDGE_BITS + END_BITS
    }

    /// The CRC of the frame, 15 bits.
    #[must_use]
    pub fn crc(&self) -> u16 {
        self.coded().crc
    }

    /// Everything in front of the CRC.
    fn coded(&self) -> Coder {
        let mut coder = Coder::default();
        let (value, count) = self.header();
        let above = count.saturating_sub(32);
        coder.push((value >> 32) as u32, above);
        coder.push(value as u32, count - above);
        for &byte in self.data() {
            coder.push(byte.into(), 8);
        }
        coder
    }

    /// Start bit, arbitration field, reserved bits and length code, and how many bits they are.
    fn header(&self) -> (u64, u32) {
        let arbitration = u64::from(self.arbitration());
        let len = u64::from(self.len);
        if self.id.is_extended() {
            (arbitration << 6 | len, 39)
        } else {
            // The field ends with IDE, its 13th bit.
            ((arbitration >> 19) << 5 | len, 19)
        }
    }
}

impl fmt::Display for Frame {
    /// As candump writes it: `201#3D4000`, a remote frame `201#R3`, one of length 0 `201#R`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#", self.id)?;
        if self.remote {
            f.write_str("R")?;
            if self.len > 0 {
                write!(f, "{}", self.len)?;
            }
            return Ok(());
        }
        self.data()
            .iter()
            .try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Frame {
    type Err = BadFrame;

    /// Reads what [`Frame`] prints; as candump also with dots between bytes and lower-case digits.
    fn from_str(text: &str) -> Result<Self, BadFrame> {
        let (id, rest) = text.split_once('#').ok_or(BadFrame::NoSeparator)?;
        let extended = match id.len() {
            3 => false,
            8 => true,
            _ => return Err(BadFrame::IdentifierDigits),
        };
        if !id.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err(BadFrame::IdentifierDigits);
        }
        let number = u32::from_str_radix(id, 16).map_err(|_| BadFrame::IdentifierDigits)?;
        let id = if extended {
            Id::extended(number)
        } else {
            u16::try_from(number).ok().and_then(Id::base)
        };
        let id = id.ok_or(BadFrame::Identifier { number })?;
        if let Some(len) = rest.strip_prefix(['R', 'r']) {
            let len = match len.as_bytes() {
                [] => 0,
                [digit @ b'0'..=b'9'] => usize::from(digit - b'0'),
                _ => return Err(BadFrame::RemoteLength),
            };
            return Self::remote(id, len);
        }
        parse_data(rest).and_then(|(data, len)| Self::new(id, &data[..len]))
    }
}

/// Pairs of hexadecimal digits, with single dots between pairs where the writer put them.
fn parse_data(text: &str) -> Result<([u8; MAX_DATA], usize), BadFrame> {
    let mut data = [0; MAX_DATA];
    let mut len = 0;
    let mut digits = text.as_bytes();
    while !digits.is_empty() {
        let [high, low, rest @ ..] = digits else {
            return Err(BadFrame::DataDigits);
        };
        let (Some(high), Some(low)) = (hex(*high), hex(*low)) else {
            return Err(BadFrame::DataDigits);
        };
        if let Some(place) = data.get_mut(len) {
            *place = high << 4 | low;
        }
        len += 1;
        digits = match rest {
            [b'.'] => return Err(BadFrame::DataDigits),
            [b'.', rest @ ..] => rest,
            rest => rest,
        };
    }
    if len > MAX_DATA {
        return Err(BadFrame::TooLong { len });
    }
    Ok((data, len))
}

fn hex(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        _ => None,
    }
}

/// Why a frame cannot be made or read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadFrame {
    /// The identifier does not fit its format.
    Identifier {
        /// The number as it was given.
        number: u32,
    },
    /// More than 8 bytes.
    TooLong {
        /// The length as it was given.
        len: usize,
    },
    /// No `#` behind the identifier.
    NoSeparator,
    /// The identifier is not written with 3 or 8 hexadecimal digits.
    IdentifierDigits,
    /// The data is not written as pairs of hexadecimal digits.
    DataDigits,
    /// The length behind `R` is not one digit.
    RemoteLength,
}

impl fmt::Display for BadFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Identifier { number } => write!(
                f,
                "identifier {number:X} is too large: at most 7FF with 3 digits (11 bits) and 1FFFFFFF with 8 digits (29 bits)"
            ),
            Self::TooLong { len } => {
                write!(f, "{len} data bytes, where a CAN frame has at most 8")
            }
            Self::NoSeparator => f.write_str("no `#`: write a frame as 201#3D4000"),
            Self::IdentifierDigits => f.write_str(
                "the identifier is not 3 hexadecimal digits (11 bits) or 8 (29 bits): write a frame as 201#3D4000",
            ),
            Self::DataDigits => {
                f.write_str("the data bytes are not pairs of hexadecimal digits: write a frame as 201#3D4000")
            }
            Self::RemoteLength => {
                f.write_str("the length of a remote frame is not one digit from 0 to 8: write it as 201#R3")
            }
        }
    }
}

impl core::error::Error for BadFrame {}

/// The rate of a bus; its bit time is a whole number of thirds of a nanosecond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BitRate {
    bits_per_second: u32,
}

impl BitRate {
    /// 1 Mbit/s, the most that classic CAN allows.
    pub const M1: Self = Self::whole(1_000_000);
    /// 625 kbit/s.
    pub const K625: Self = Self::whole(625_000);
    /// 500 kbit/s.
    pub const K500: Self = Self::whole(500_000);
    /// 250 kbit/s.
    pub const K250: Self = Self::whole(250_000);
    /// 100 kbit/s.
    pub const K100: Self = Self::whole(100_000);

    /// Units of [`Span`] in a second.
    const UNITS_PER_SECOND: u64 = 3_000_000_000;

    const fn whole(bits_per_second: u32) -> Self {
        Self { bits_per_second }
    }

    /// A rate in bits a second; `None` for 0, above 1 Mbit/s, and where a bit is not a whole number of thirds of a nanosecond.
    #[must_use]
    pub const fn from_bits_per_second(bits: u32) -> Option<Self> {
        if bits == 0 || bits > 1_000_000 || Self::UNITS_PER_SECOND % bits as u64 != 0 {
            return None;
        }
        Some(Self::whole(bits))
    }

    /// The rate in bits a second.
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        self.bits_per_second
    }

    /// How long one bit takes; exact.
    #[must_use]
    pub const fn bit_time(self) -> Span {
        Span::from_units(Self::UNITS_PER_SECOND / self.bits_per_second as u64)
    }

    /// How long `bits` bits take; exact.
    #[must_use]
    pub fn time_of(self, bits: u32) -> Span {
        self.bit_time() * u64::from(bits)
    }
}

impl fmt::Display for BitRate {
    /// In the field's unit: `500 kbit/s`, `83.333 kbit/s`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (whole, rest) = (self.bits_per_second / 1000, self.bits_per_second % 1000);
        if rest == 0 {
            write!(f, "{whole} kbit/s")
        } else {
            write!(f, "{whole}.{rest:03} kbit/s")
        }
    }
}

/// What a station hears from the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CanEvent {
    /// A frame that was acknowledged and ended well.
    Frame(Frame),
    /// Something went wrong on the bus.
    Error(CanError),
}

/// What a controller reports to be wrong with the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CanError {
    /// An error frame was on the bus; the frame in front of it is repeated by its sender.
    ErrorFrame,
    /// No other station acknowledged a frame of this one.
    NoAcknowledge,
    /// This station counted 256 transmit errors, and takes no part in the bus any more.
    BusOff,
}

impl CanError {
    /// Every error.
    pub const ALL: [Self; 3] = [Self::ErrorFrame, Self::NoAcknowledge, Self::BusOff];

    /// The word that records and scenarios use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ErrorFrame => "error-frame",
            Self::NoAcknowledge => "no-acknowledge",
            Self::BusOff => "bus-off",
        }
    }

    /// The error with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|error| error.name() == name)
    }
}

impl fmt::Display for CanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests;
