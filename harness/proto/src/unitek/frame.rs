//! What travels: requests of the master (3 or 5 bytes) and replies of a drive (4 or 6 bytes), App 1 and 2.
//!
//! Nothing distinguishes the reply to a request from a cyclic frame or an event frame, and a write is never answered.

use super::properties::{Dlc4, Properties, ShortWrite};
use super::register::{Register, Width};
use crate::can::{BadFrame, Frame};
use core::fmt;

/// The register to which a request for sending is written (5.2).
pub const READ: u8 = 0x3D;
/// Identifier of frames to the drive, as delivered (3.1).
pub const DEFAULT_RX: u16 = 0x201;
/// Identifier of frames from the drive, as delivered (3.1).
pub const DEFAULT_TX: u16 = 0x181;
/// Interval byte that ends a cycle (5.2, App 8).
pub const STOP: u8 = 0xFF;
/// Most registers with a cycle (ex 9, App 8).
pub const CYCLES: usize = 8;

/// The drive that sends a frame where identifiers are those of 3.1: 180 + n is drive n. `None` for other frames.
#[must_use]
pub fn sender_of(frame: &Frame) -> Option<u8> {
    let number = frame.id().number();
    let of_drive =
        (0x181..=0x1FF).contains(&number) && !frame.id().is_extended() && !frame.is_remote();
    u8::try_from(number & 0x7F).ok().filter(|_| of_drive)
}

/// What a drive reads out of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Request {
    /// A value for a register; never answered.
    Write {
        /// The register.
        register: u8,
        /// The value as it came.
        data: Data,
    },
    /// One reply (5.2 item 1): interval 00.
    Read {
        /// The register.
        register: u8,
    },
    /// A reply every `every` ms (5.2 item 2): interval 01 to FE.
    Cycle {
        /// The register.
        register: u8,
        /// 1 to 254 ms.
        every: u8,
    },
    /// The end of a cycle: interval FF.
    Stop {
        /// The register.
        register: u8,
    },
}

/// The data of a frame: 16 bits (3 or 4 bytes) or 32 bits (5 or 6 bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Data {
    /// 16 bits.
    Short(u16),
    /// 32 bits.
    Long(u32),
}

impl Data {
    /// The value `raw` with the width of `register`; bits above it are dropped.
    #[must_use]
    pub fn of(register: &Register, raw: u32) -> Self {
        match register.width {
            Width::Bits16 => Self::Short(low(raw)),
            Width::Bits32 => Self::Long(raw),
        }
    }

    /// The bits, with zeros above 16.
    #[must_use]
    pub const fn bits(self) -> u32 {
        match self {
            Self::Short(value) => value as u32,
            Self::Long(value) => value,
        }
    }

    /// What `register` holds after this is written to it, if it held `held` before (App 1).
    #[must_use]
    pub fn written_to(self, register: &Register, held: u32, short_write: ShortWrite) -> u32 {
        match (register.width, self, short_write) {
            (Width::Bits16, data, _) => data.bits() & 0xFFFF,
            (Width::Bits32, Self::Long(value), _) => value,
            (Width::Bits32, Self::Short(value), ShortWrite::Extend) => register.extend(value),
            (Width::Bits32, Self::Short(value), ShortWrite::KeepHigh) => {
                held & 0xFFFF_0000 | u32::from(value)
            }
        }
    }

    fn bytes(self) -> ([u8; 4], usize) {
        match self {
            Self::Short(value) => {
                let [a, b] = value.to_le_bytes();
                ([a, b, 0, 0], 2)
            }
            Self::Long(value) => (value.to_le_bytes(), 4),
        }
    }
}

/// The lower half.
pub(super) const fn low(raw: u32) -> u16 {
    (raw & 0xFFFF) as u16
}

/// Why a drive does nothing with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Ignored {
    /// An identifier of 29 bits.
    Extended,
    /// Another identifier than that of register 68.
    OtherIdentifier,
    /// A remote frame (4.4, App 1).
    Remote,
    /// Fewer than 3 bytes.
    TooShort,
    /// 4 bytes, and the drive takes none (`dlc4` = `ignore`).
    FourBytes,
    /// The drive uses another bit rate than the bus (73).
    OtherRate,
}

impl Ignored {
    /// In words: completes "the drive ignores it: ...".
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::Extended => "its identifier has 29 bits",
            Self::OtherIdentifier => "it has another identifier than the drive receives",
            Self::Remote => "it is a remote frame (4.4)",
            Self::TooShort => "it has fewer than 3 data bytes",
            Self::FourBytes => "it has 4 data bytes",
            Self::OtherRate => "the drive uses another bit rate",
        }
    }
}

impl fmt::Display for Ignored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.about())
    }
}

impl Request {
    /// What a drive that receives on identifier `rx` reads out of a frame.
    ///
    /// 3 and 4 bytes are 16 bits, 5 to 8 bytes are 32 (4.1, 5.1, App 1).
    ///
    /// # Errors
    /// [`Ignored`] where the drive does nothing with it.
    pub fn decode(frame: &Frame, rx: u16, dlc4: Dlc4) -> Result<Self, Ignored> {
        if frame.id().is_extended() {
            return Err(Ignored::Extended);
        }
        if frame.id().number() != u32::from(rx) {
            return Err(Ignored::OtherIdentifier);
        }
        if frame.is_remote() {
            return Err(Ignored::Remote);
        }
        let (register, data) = match *frame.data() {
            [] | [_] | [_, _] => return Err(Ignored::TooShort),
            [_, _, _, _] if dlc4 == Dlc4::Ignore => return Err(Ignored::FourBytes),
            [register, a, b] | [register, a, b, _] => {
                (register, Data::Short(u16::from_le_bytes([a, b])))
            }
            [register, a, b, c, d, ..] => (register, Data::Long(u32::from_le_bytes([a, b, c, d]))),
        };
        if register != READ {
            return Ok(Self::Write { register, data });
        }
        let [register, interval] = low(data.bits()).to_le_bytes();
        Ok(match interval {
            0 => Self::Read { register },
            STOP => Self::Stop { register },
            every => Self::Cycle { register, every },
        })
    }

    /// The frame as a master sends it: 3 bytes, or 5 for 32 bits. A [`Cycle`](Self::Cycle) of 0 or 255 ms has no frame of its own: it
    /// becomes what these intervals mean.
    ///
    /// # Errors
    /// [`BadFrame::Identifier`] above 7FF.
    pub fn encode(self, rx: u16) -> Result<Frame, BadFrame> {
        let (number, data) = match self {
            Self::Write { register, data } => (register, data),
            Self::Read { register } => (READ, interval(register, 0)),
            Self::Cycle { register, every } => (READ, interval(register, every)),
            Self::Stop { register } => (READ, interval(register, STOP)),
        };
        let (bytes, len) = data.bytes();
        let mut whole = [number; 5];
        whole[1..].copy_from_slice(&bytes);
        Frame::base(rx, &whole[..=len])
    }

    /// The register that is meant.
    #[must_use]
    pub const fn register(self) -> u8 {
        match self {
            Self::Write { register, .. }
            | Self::Read { register }
            | Self::Cycle { register, .. }
            | Self::Stop { register } => register,
        }
    }
}

fn interval(register: u8, interval: u8) -> Data {
    Data::Short(u16::from_le_bytes([register, interval]))
}

/// A frame from a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Reply {
    /// The register.
    pub register: u8,
    /// Its contents; how wide they are does not depend on the request.
    pub data: Data,
    /// The last byte, which means nothing.
    pub stuff: u8,
}

/// Why a frame is no reply of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum NoReply {
    /// An identifier of 29 bits, or another one than that of register 69.
    OtherIdentifier,
    /// A remote frame.
    Remote,
    /// Not 4 and not 6 data bytes.
    Length {
        /// The number of bytes.
        dlc: u8,
    },
}

impl fmt::Display for NoReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherIdentifier => f.write_str("it has another identifier than the drive sends"),
            Self::Remote => f.write_str("it is a remote frame, and a drive sends none (4.4)"),
            Self::Length { dlc } => {
                write!(f, "it has {dlc} data bytes, and a reply has 4 or 6 (4.5)")
            }
        }
    }
}

impl Reply {
    /// Reads a frame of a drive that sends on identifier `tx`.
    ///
    /// # Errors
    /// [`NoReply`] where it is none.
    pub fn decode(frame: &Frame, tx: u16) -> Result<Self, NoReply> {
        if frame.id().is_extended() || frame.id().number() != u32::from(tx) {
            return Err(NoReply::OtherIdentifier);
        }
        if frame.is_remote() {
            return Err(NoReply::Remote);
        }
        let (register, data, stuff) = match *frame.data() {
            [register, a, b, stuff] => (register, Data::Short(u16::from_le_bytes([a, b])), stuff),
            [register, a, b, c, d, stuff] => {
                let long = u32::from_le_bytes([a, b, c, d]);
                (register, Data::Long(long), stuff)
            }
            _ => {
                return Err(NoReply::Length {
                    dlc: u8::try_from(frame.dlc()).unwrap_or(u8::MAX),
                });
            }
        };
        Ok(Self {
            register,
            data,
            stuff,
        })
    }

    /// The frame: 4 bytes, or 6 for 32 bits.
    ///
    /// # Errors
    /// [`BadFrame::Identifier`] above 7FF.
    pub fn encode(self, tx: u16) -> Result<Frame, BadFrame> {
        let (bytes, len) = self.data.bytes();
        let mut whole = [self.stuff; 6];
        whole[0] = self.register;
        whole[1..=len].copy_from_slice(&bytes[..len]);
        Frame::base(tx, &whole[..len + 2])
    }

    /// The number that the contents mean, with the sign of the register; whichever width they came with.
    #[must_use]
    pub fn number(&self) -> i64 {
        let register = Register::of(self.register);
        match (self.data, register.width) {
            (Data::Short(value), Width::Bits32) if !register.signed => i64::from(value),
            (Data::Short(value), _) if register.signed => i64::from(value.cast_signed()),
            (data, _) => register.number_of(data.bits()),
        }
    }
}

/// Why a reply has the width that it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Occasion {
    /// A request for one reply, or a cycle.
    Asked,
    /// A change of STATUS (5.2 item 3).
    Event,
}

/// How a drive sends the contents of a register.
///
/// `wide` is bit 8 of DC: all replies have 6 bytes (App 3). 16 bits are then extended by the sign of the register or by zeros
/// (`wide-replies`); 40 and 8F under `map-reply short` by zeros (our choice).
#[must_use]
pub fn reply_data(
    register: &Register,
    raw: u32,
    occasion: Occasion,
    wide: bool,
    properties: &Properties,
) -> Data {
    use super::properties::{EventReply, MapReply, WideReplies};
    let short_map = match (occasion, properties.event_reply) {
        (Occasion::Event, EventReply::Native) => false,
        _ => properties.map_reply == MapReply::Short && matches!(register.number, 0x40 | 0x8F),
    };
    match (register.width, short_map, wide) {
        (Width::Bits32, false, _) => Data::Long(raw),
        (Width::Bits32, true, true) => Data::Long(raw & 0xFFFF),
        (Width::Bits32, true, false) | (Width::Bits16, _, false) => Data::Short(low(raw)),
        (Width::Bits16, _, true) => Data::Long(match properties.wide_replies {
            WideReplies::Sign => register.extend(low(raw)),
            WideReplies::Zero => low(raw).into(),
        }),
    }
}
