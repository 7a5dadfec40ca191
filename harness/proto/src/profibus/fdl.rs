//! Telegrams of the data link layer, octet by octet (EN 1).
//!
//! A [`Telegram`] is well-formed by construction; a malformed one is plain octets. [`Telegram::decode`] accepts any octets.

use crate::decode::Decoded;
use core::fmt;

pub use super::buffer::Buffer;
pub use super::control::{FcFunction, FcStatus, Fcb, FrameControl, Sequence};

/// Start of a telegram without data.
pub const SD1: u8 = 0x10;
/// Start of a telegram with data of variable length.
pub const SD2: u8 = 0x68;
/// Start of a telegram with 8 octets of data.
pub const SD3: u8 = 0xA2;
/// Start of a token.
pub const SD4: u8 = 0xDC;
/// Short confirmation: a telegram of one octet.
pub const SC: u8 = 0xE5;
/// End of SD1, SD2 and SD3.
pub const ED: u8 = 0x16;

/// The address that all stations hear; no station answers it.
pub const BROADCAST: u8 = 127;
/// The highest address of a station.
pub const LAST_ADDRESS: u8 = 126;
/// Most octets behind FC, SAPs included.
pub const MAX_PAYLOAD: usize = 246;
/// Most octets of a telegram.
pub const MAX_TELEGRAM: usize = MAX_PAYLOAD + 9;
/// Bit 7 of an address: a SAP follows.
const EXTENSION: u8 = 0x80;
/// The highest SAP; bits 7 and 6 of its octet (further extension, segment) are not supported.
pub const LAST_SAP: u8 = 63;

/// The sum of octets modulo 256 (FCS).
#[must_use]
pub fn check_sum(octets: &[u8]) -> u8 {
    octets.iter().fold(0, |sum, octet| sum.wrapping_add(*octet))
}

/// Which form an acknowledged or unacknowledged telegram has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Form {
    /// SD1: nothing behind FC.
    Plain,
    /// SD2: 1 to 246 octets behind FC.
    Variable,
    /// SD3: 8 octets behind FC.
    Fixed,
}

/// A telegram with addresses and FC: SD1, SD2 or SD3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdu {
    fixed: bool,
    /// With bit 7 as on the wire.
    da: u8,
    sa: u8,
    fc: FrameControl,
    /// All octets behind FC.
    payload: Buffer,
}

impl Pdu {
    /// A telegram without SAPs: SD1 without data, SD2 with data.
    ///
    /// # Errors
    /// [`BadTelegram`] where no well-formed telegram has these values.
    pub fn new(da: u8, sa: u8, fc: FrameControl, data: &[u8]) -> Result<Self, BadTelegram> {
        Self::with_saps(da, sa, fc, None, None, data)
    }

    /// A telegram with any of the two SAPs: SD1 if nothing follows FC, SD2 if something does.
    ///
    /// # Errors
    /// [`BadTelegram`] where no well-formed telegram has these values.
    pub fn with_saps(
        da: u8,
        sa: u8,
        fc: FrameControl,
        dsap: Option<u8>,
        ssap: Option<u8>,
        data: &[u8],
    ) -> Result<Self, BadTelegram> {
        if da > BROADCAST || sa > LAST_ADDRESS {
            return Err(BadTelegram::Address);
        }
        if fc.0 & 0x80 != 0 {
            return Err(BadTelegram::Control);
        }
        let mut payload = Buffer::new();
        for sap in [dsap, ssap].into_iter().flatten() {
            if sap > LAST_SAP {
                return Err(BadTelegram::Sap);
            }
            let _fits = payload.push(sap);
        }
        if !payload.extend(data) || payload.len() > MAX_PAYLOAD {
            return Err(BadTelegram::Length);
        }
        let extension = |sap: Option<u8>| if sap.is_some() { EXTENSION } else { 0 };
        Ok(Self {
            fixed: false,
            da: da | extension(dsap),
            sa: sa | extension(ssap),
            fc,
            payload,
        })
    }

    /// The same telegram as SD3, if exactly 8 octets follow its FC, and as SD1 or SD2 if not.
    #[must_use]
    pub fn in_fixed_form(mut self) -> Self {
        self.fixed = self.payload.len() == 8;
        self
    }

    /// Which of the three forms it has.
    #[must_use]
    pub fn form(&self) -> Form {
        match (self.fixed, self.payload.is_empty()) {
            (true, _) => Form::Fixed,
            (false, true) => Form::Plain,
            (false, false) => Form::Variable,
        }
    }

    /// The station that it is for, 0 to 127.
    #[must_use]
    pub const fn da(&self) -> u8 {
        self.da & !EXTENSION
    }

    /// The station that sent it, 0 to 126.
    #[must_use]
    pub const fn sa(&self) -> u8 {
        self.sa & !EXTENSION
    }

    /// The frame control octet.
    #[must_use]
    pub const fn fc(&self) -> FrameControl {
        self.fc
    }

    /// The service access point at the destination.
    #[must_use]
    pub fn dsap(&self) -> Option<u8> {
        (self.da & EXTENSION != 0)
            .then(|| self.payload.first().copied())
            .flatten()
    }

    /// The service access point at the source.
    #[must_use]
    pub fn ssap(&self) -> Option<u8> {
        let place = usize::from(self.da & EXTENSION != 0);
        (self.sa & EXTENSION != 0)
            .then(|| self.payload.get(place).copied())
            .flatten()
    }

    /// The data behind the SAPs.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        let saps = usize::from(self.da & EXTENSION != 0) + usize::from(self.sa & EXTENSION != 0);
        self.payload.get(saps..).unwrap_or_default()
    }

    /// The octets from the start to the end.
    #[must_use]
    pub fn encode(&self) -> Buffer {
        let mut all = Buffer::new();
        let length = u8::try_from(self.payload.len() + 3).unwrap_or(u8::MAX);
        let head: &[u8] = match self.form() {
            Form::Plain => &[SD1],
            Form::Variable => &[SD2, length, length, SD2],
            Form::Fixed => &[SD3],
        };
        let begin = head.len();
        for part in [head, &[self.da, self.sa, self.fc.0], &self.payload] {
            let _fits = all.extend(part);
        }
        let sum = check_sum(&all[begin..]);
        let _fits = all.extend(&[sum, ED]);
        all
    }
}

/// Why values make no telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BadTelegram {
    /// The destination is above 127 or the source above 126.
    Address,
    /// Bit 7 of FC is 1.
    Control,
    /// A SAP is above 63.
    Sap,
    /// More than 246 octets follow FC.
    Length,
}

impl fmt::Display for BadTelegram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Address => "a destination is 0 to 127, a source 0 to 126",
            Self::Control => "bit 7 of FC is reserved and must be 0",
            Self::Sap => "a SAP is 0 to 63",
            Self::Length => "at most 246 octets follow FC, the SAPs included",
        })
    }
}

impl core::error::Error for BadTelegram {}

/// One telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(
    clippy::large_enum_variant,
    reason = "telegrams are moved rarely and kept without allocation"
)]
pub enum Telegram {
    /// SC: a short confirmation.
    Confirmation,
    /// SD4: the token goes from one master to another. Its octets are not checked.
    Token {
        /// The master that gets it.
        da: u8,
        /// The master that gives it.
        sa: u8,
    },
    /// SD1, SD2 or SD3.
    Pdu(Pdu),
}

/// Why octets are no telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Malformed {
    /// The first octet starts no telegram.
    Start,
    /// LE is below 4 or above 249.
    Length,
    /// LEr differs from LE.
    LengthRepeated,
    /// The fourth octet of SD2 is not 68.
    StartRepeated,
    /// The source is 127.
    Source,
    /// Bit 7 of FC is 1.
    Control,
    /// A SAP has bit 7 or 6 (further extension, segment).
    Sap,
    /// An address announces a SAP, and no octet is left for it.
    SapMissing,
    /// FCS is not the sum of the octets from DA on.
    CheckSum,
    /// The last octet is not 16.
    End,
}

impl Malformed {
    /// In words: completes "this is no telegram: ...".
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::Start => "no telegram starts with this octet",
            Self::Length => "LE is not 4 to 249",
            Self::LengthRepeated => "LEr differs from LE",
            Self::StartRepeated => "the fourth octet is not 68",
            Self::Source => "the source address is 127",
            Self::Control => "bit 7 of FC is 1",
            Self::Sap => "a SAP has bit 7 or 6, which are not supported",
            Self::SapMissing => "the octet of a SAP is missing",
            Self::CheckSum => "FCS is wrong",
            Self::End => "the last octet is not 16",
        }
    }
}

impl fmt::Display for Malformed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.about())
    }
}

impl Telegram {
    /// The octets from the start to the end.
    #[must_use]
    pub fn encode(&self) -> Buffer {
        let mut short = Buffer::new();
        match *self {
            Self::Pdu(ref pdu) => return pdu.encode(),
            Self::Confirmation => {
                let _fits = short.push(SC);
            }
            Self::Token { da, sa } => {
                let _fits = short.extend(&[SD4, da, sa]);
            }
        }
        short
    }

    /// The telegram at the begin of some octets. A reason is given at the first octet that settles it; octets after the telegram are not read.
    #[must_use]
    pub fn decode(octets: &[u8]) -> Decoded<Self, Malformed> {
        let bad = |reason, offset| Decoded::Bad { reason, offset };
        match *octets {
            [] => Decoded::NeedMore,
            [SC, ..] => Decoded::Value {
                value: Self::Confirmation,
                used: 1,
            },
            [SD4, da, sa, ..] => Decoded::Value {
                value: Self::Token { da, sa },
                used: 3,
            },
            [SD4, ..] => Decoded::NeedMore,
            [SD1, ref rest @ ..] => Self::decode_body(rest, 1, 0, false),
            [SD3, ref rest @ ..] => Self::decode_body(rest, 1, 8, true),
            [SD2, ref head @ ..] => {
                if let Some(length) = head.first() {
                    if !(4..=249).contains(length) {
                        return bad(Malformed::Length, 1);
                    }
                    if head.get(1).is_some_and(|again| again != length) {
                        return bad(Malformed::LengthRepeated, 2);
                    }
                    if head.get(2).is_some_and(|start| *start != SD2) {
                        return bad(Malformed::StartRepeated, 3);
                    }
                }
                match *head {
                    [length, _, _, ref rest @ ..] => {
                        Self::decode_body(rest, 4, usize::from(length) - 3, false)
                    }
                    _ => Decoded::NeedMore,
                }
            }
            _ => bad(Malformed::Start, 0),
        }
    }

    /// DA to ED, of which the first is octet `begin` of the telegram, with `length` octets behind FC.
    fn decode_body(
        body: &[u8],
        begin: usize,
        length: usize,
        fixed: bool,
    ) -> Decoded<Self, Malformed> {
        let bad = |reason, index: usize| Decoded::Bad {
            reason,
            offset: begin + index,
        };
        let extended = |index: usize| body.get(index).is_some_and(|octet| octet & EXTENSION != 0);
        // In the order of the octets, so that more octets never change the reason.
        let saps = usize::from(extended(0)) + usize::from(extended(1));
        if extended(0) && length == 0 {
            return bad(Malformed::SapMissing, 0);
        }
        if body.get(1).is_some_and(|sa| sa & !EXTENSION == BROADCAST) {
            return bad(Malformed::Source, 1);
        }
        if saps > length {
            return bad(Malformed::SapMissing, 1);
        }
        if extended(2) {
            return bad(Malformed::Control, 2);
        }
        for index in 3..3 + saps {
            if body.get(index).is_some_and(|sap| *sap > LAST_SAP) {
                return bad(Malformed::Sap, index);
            }
        }
        let end = 3 + length;
        let sum = body.get(..end).map(check_sum);
        if body.get(end).copied().is_some_and(|fcs| Some(fcs) != sum) {
            return bad(Malformed::CheckSum, end);
        }
        if body.get(end + 1).is_some_and(|last| *last != ED) {
            return bad(Malformed::End, end + 1);
        }
        if body.len() < end + 2 {
            return Decoded::NeedMore;
        }
        let pdu = Pdu {
            fixed,
            da: body[0],
            sa: body[1],
            fc: FrameControl(body[2]),
            payload: Buffer::of(&body[3..end]).unwrap_or_default(),
        };
        Decoded::Value {
            value: Self::Pdu(pdu),
            used: begin + end + 2,
        }
    }

    /// The telegram, if it has addresses and FC.
    #[must_use]
    pub const fn pdu(&self) -> Option<&Pdu> {
        match self {
            Self::Pdu(pdu) => Some(pdu),
            Self::Confirmation | Self::Token { .. } => None,
        }
    }
}
