//! The sync byte, `1 N S 0 T2 T1 T0 D` (ND21 9.2).

use core::fmt;

/// SYNCO: keeps the data flow going, is forwarded unchanged (ND21 9.2).
pub const SYNCO: u8 = 0x80;
/// PAUSE: loosens the data flow, gets no answer (ND21 9.2).
pub const PAUSE: u8 = 0x81;

/// The most net bytes that a telegram holds: process data and parameter bytes (ND21 9.1).
pub const MAX_NET_LENGTH: u8 = 7;

const N: u8 = 0x40;
const S: u8 = 0x20;
const D: u8 = 0x01;

/// Which drive a telegram is meant for (ND21 9.2).
///
/// The manual prints N = 0 for "next"; since N = 0 already is "same drive", N = 1 is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Addressing {
    /// S = 0, N = 0: an address byte follows.
    AddressFollows,
    /// S = 1, N = 0: the drive that received the last telegram.
    SameDrive,
    /// S = 1, N = 1: the drive with the next higher address.
    NextDrive,
}

/// What the sync byte of a telegram says about the bytes that follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TelegramHeader {
    addressing: Addressing,
    process_data: bool,
    net_length: u8,
}

impl TelegramHeader {
    /// A header, if the manual allows it: at most 7 net bytes, process data take two of them, and a
    /// telegram with an address byte has at least one.
    ///
    /// # Errors
    /// The rule that it breaks.
    pub fn new(
        addressing: Addressing,
        process_data: bool,
        net_length: u8,
    ) -> Result<Self, SyncError> {
        if net_length > MAX_NET_LENGTH {
            return Err(SyncError::TooLong);
        }
        if process_data && net_length < 2 {
            return Err(SyncError::NoRoomForProcessData);
        }
        if addressing == Addressing::AddressFollows && net_length == 0 {
            return Err(SyncError::AddressWithoutData);
        }
        Ok(Self {
            addressing,
            process_data,
            net_length,
        })
    }

    /// Which drive is meant.
    #[must_use]
    pub const fn addressing(self) -> Addressing {
        self.addressing
    }

    /// D: whether the first two net bytes are process data.
    #[must_use]
    pub const fn process_data(self) -> bool {
        self.process_data
    }

    /// T: how many bytes follow the sync byte and the address byte, 0 to 7.
    #[must_use]
    pub const fn net_length(self) -> u8 {
        self.net_length
    }

    /// How many bytes the whole telegram has, from the sync byte on: 1 to 9.
    #[must_use]
    pub fn telegram_length(self) -> usize {
        let address = usize::from(self.addressing == Addressing::AddressFollows);
        1 + address + usize::from(self.net_length)
    }
}

/// A sync byte that the manual allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncByte {
    /// `80`: no telegram, forwarded unchanged.
    Synco,
    /// `81`: no telegram, swallowed.
    Pause,
    /// The first byte of a telegram.
    Telegram(TelegramHeader),
}

impl SyncByte {
    /// Reads a byte that stands where a sync byte is due.
    ///
    /// # Errors
    /// The first rule of 9.2 that the byte breaks.
    pub fn decode(byte: u8) -> Result<Self, SyncError> {
        match byte {
            SYNCO => return Ok(Self::Synco),
            PAUSE => return Ok(Self::Pause),
            _ => {}
        }
        if byte & 0x80 == 0 {
            return Err(SyncError::Bit7Clear);
        }
        if byte & 0x10 != 0 {
            return Err(SyncError::Bit4Set);
        }
        let addressing = match (byte & S != 0, byte & N != 0) {
            (false, false) => Addressing::AddressFollows,
            (true, false) => Addressing::SameDrive,
            (true, true) => Addressing::NextDrive,
            (false, true) => return Err(SyncError::NextWithoutShort),
        };
        TelegramHeader::new(addressing, byte & D != 0, (byte >> 1) & MAX_NET_LENGTH)
            .map(Self::Telegram)
    }

    /// The byte on the line.
    #[must_use]
    pub const fn encode(self) -> u8 {
        match self {
            Self::Synco => SYNCO,
            Self::Pause => PAUSE,
            Self::Telegram(header) => {
                let address = match header.addressing {
                    Addressing::AddressFollows => 0,
                    Addressing::SameDrive => S,
                    Addressing::NextDrive => S | N,
                };
                0x80 | address | header.net_length << 1 | header.process_data as u8
            }
        }
    }
}

/// Why a byte is no sync byte (ND21 9.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncError {
    /// Bit 7 is not 1.
    Bit7Clear,
    /// Bit 4 is not 0.
    Bit4Set,
    /// N = 1 (next drive) without S = 1 (short address).
    NextWithoutShort,
    /// D = 1 (process data) with fewer than two net bytes.
    NoRoomForProcessData,
    /// An address byte, but no net byte (on the line this is SYNCO or PAUSE).
    AddressWithoutData,
    /// More than 7 net bytes.
    TooLong,
}

impl fmt::Display for SyncError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bit7Clear => "bit 7 of a sync byte is 1 (ND21 9.2)",
            Self::Bit4Set => "bit 4 of a sync byte is 0 (ND21 9.2)",
            Self::NextWithoutShort => "N = 1 (next drive) needs S = 1 (short address; ND21 9.2)",
            Self::NoRoomForProcessData => {
                "D = 1 (process data) needs at least 2 net bytes (ND21 9.1)"
            }
            Self::AddressWithoutData => {
                "an address byte needs at least 1 net byte after it (ND21 9.2)"
            }
            Self::TooLong => "a telegram has at most 7 net bytes (ND21 9.1)",
        })
    }
}

impl core::error::Error for SyncError {}
