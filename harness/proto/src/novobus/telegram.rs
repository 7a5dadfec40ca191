//! Telegrams: sync byte, address byte, process data, parameter channel (ND21 9.1).
//!
//! A telegram has an address byte or not, process data or not, and parameter bytes or not; one with an
//! address byte needs at least one net byte. That makes seven legal forms. [`Telegram`] can hold
//! no other form; for bytes that break the rules [`Telegram::decode`] returns the rule that they
//! break.

use super::decode::Decoded;
use super::sync::{Addressing, MAX_NET_LENGTH, SyncByte, SyncError, TelegramHeader};
use alloc::vec::Vec;
use core::fmt;

/// Which drive a telegram is meant for, with the address byte where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Address {
    /// The address byte as it stands on the line.
    Byte(u8),
    /// The drive of the last telegram.
    SameDrive,
    /// The drive with the next higher address.
    NextDrive,
}

impl Address {
    const fn addressing(self) -> Addressing {
        match self {
            Self::Byte(_) => Addressing::AddressFollows,
            Self::SameDrive => Addressing::SameDrive,
            Self::NextDrive => Addressing::NextDrive,
        }
    }
}

/// A telegram that keeps the rules of 9.1 and 9.2.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Telegram {
    address: Address,
    process_data: Option<u16>,
    parameters: Vec<u8>,
}

impl Telegram {
    /// A telegram for `address` with process data and parameter bytes as given.
    ///
    /// # Errors
    /// The rule that it would break: more than 7 net bytes, or an address byte without any.
    pub fn new(
        address: Address,
        process_data: Option<u16>,
        parameters: &[u8],
    ) -> Result<Self, TelegramError> {
        let telegram = Self {
            address,
            process_data,
            parameters: parameters.to_vec(),
        };
        telegram.header().map_err(TelegramError::Sync)?;
        Ok(telegram)
    }

    /// Which drive is meant.
    #[must_use]
    pub const fn address(&self) -> Address {
        self.address
    }

    /// The process data, if there are any; the most significant byte goes first (ND21 9.4).
    #[must_use]
    pub const fn process_data(&self) -> Option<u16> {
        self.process_data
    }

    /// The bytes for the parameter channel: parts of commands, one command or several.
    #[must_use]
    pub fn parameters(&self) -> &[u8] {
        &self.parameters
    }

    fn header(&self) -> Result<TelegramHeader, SyncError> {
        let data = if self.process_data.is_some() { 2 } else { 0 };
        let length = u8::try_from(data + self.parameters.len()).unwrap_or(u8::MAX);
        TelegramHeader::new(
            self.address.addressing(),
            self.process_data.is_some(),
            length,
        )
    }

    /// The bytes on the line.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(2 + usize::from(MAX_NET_LENGTH));
        if let Ok(header) = self.header() {
            bytes.push(SyncByte::Telegram(header).encode());
        }
        if let Address::Byte(address) = self.address {
            bytes.push(address);
        }
        if let Some(data) = self.process_data {
            bytes.extend(data.to_be_bytes());
        }
        bytes.extend(&self.parameters);
        bytes
    }

    /// Reads a telegram from the front of `bytes`. SYNCO and PAUSE are no telegrams.
    #[must_use]
    pub fn decode(bytes: &[u8]) -> Decoded<Self, TelegramError> {
        let Some(&first) = bytes.first() else {
            return Decoded::NeedMore;
        };
        let bad = |reason| Decoded::Bad { reason, offset: 0 };
        let header = match SyncByte::decode(first) {
            Ok(SyncByte::Telegram(header)) => header,
            Ok(SyncByte::Synco | SyncByte::Pause) => return bad(TelegramError::NoTelegram(first)),
            Err(error) => return bad(TelegramError::Sync(error)),
        };
        let used = header.telegram_length();
        let Some(whole) = bytes.get(..used) else {
            return Decoded::NeedMore;
        };
        let (address, net) = match (header.addressing(), &whole[1..]) {
            (Addressing::SameDrive, net) => (Address::SameDrive, net),
            (Addressing::NextDrive, net) => (Address::NextDrive, net),
            (Addressing::AddressFollows, [address, net @ ..]) => (Address::Byte(*address), net),
            (Addressing::AddressFollows, []) => return Decoded::NeedMore,
        };
        let (process_data, parameters) = match net {
            [high, low, rest @ ..] if header.process_data() => {
                (Some(u16::from_be_bytes([*high, *low])), rest)
            }
            all => (None, all),
        };
        Decoded::Value {
            value: Self {
                address,
                process_data,
                parameters: parameters.to_vec(),
            },
            used,
        }
    }
}

/// Why bytes are no telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TelegramError {
    /// The sync byte breaks a rule.
    Sync(SyncError),
    /// SYNCO or PAUSE.
    NoTelegram(u8),
}

impl fmt::Display for TelegramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sync(error) => error.fmt(f),
            Self::NoTelegram(byte) => {
                write!(
                    f,
                    "{byte:02X} stands alone and starts no telegram (ND21 9.2)"
                )
            }
        }
    }
}

impl core::error::Error for TelegramError {}
