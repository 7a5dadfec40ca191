//! A drive that only passes bytes on (ND21 9.2, 9.3) or adds 1 to them in the error mode (9.7): its state follows from the bytes and
//! its place.

use super::{BusEnd, BusEndState, LineSilence, Reaction};
use crate::line::Received;
use crate::novobus::address::passed_on;
use crate::novobus::error_mode::{Climb, ErrorMode};
use crate::novobus::memory::Memory;
use crate::novobus::properties::{BrokenSequence, EmptyShortTelegram, ShortAddress};
use crate::novobus::sync::{Addressing, SyncByte, TelegramHeader};
use crate::time::Instant;

/// What a drive keeps of the bytes that it passes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relay {
    /// In normal mode.
    Passing(Passing),
    /// In the error mode.
    Climbing(Climb),
}

impl Relay {
    /// The same of the drive `places` behind.
    #[must_use]
    #[inline]
    pub fn behind(self, places: u8) -> Self {
        match self {
            Self::Passing(passing) => Self::Passing(passing.behind(places)),
            Self::Climbing(climb) => Self::Climbing(climb.behind(places)),
        }
    }

    /// The same of the drive `places` ahead.
    #[must_use]
    #[inline]
    pub fn ahead(self, places: u8) -> Self {
        match self {
            Self::Passing(passing) => Self::Passing(passing.behind(places.wrapping_neg())),
            Self::Climbing(climb) => Self::Climbing(climb.ahead(places)),
        }
    }

    /// Takes a byte as a drive that is not addressed; `None` for a byte that a drive does not simply pass on ([`Passing::receive`],
    /// [`Climb::receive`]).
    #[must_use]
    pub fn receive(self, byte: u8) -> Option<Self> {
        match self {
            Self::Passing(passing) => passing.receive(byte).map(Self::Passing),
            Self::Climbing(climb) => climb.receive(byte).map(Self::Climbing),
        }
    }

    /// The same of a row that begins one drive ahead, with a drive that keeps `leader`; `None` where that drive is none of the row.
    #[must_use]
    pub fn led_by(self, leader: Self) -> Option<Self> {
        match (self, leader) {
            (Self::Passing(row), Self::Passing(leader)) => {
                (leader.behind(1) == row).then_some(Self::Passing(leader))
            }
            (Self::Climbing(row), Self::Climbing(leader)) => row.led_by(leader).map(Self::Climbing),
            _ => None,
        }
    }
}

/// What a drive in normal mode keeps of the bytes that it passes on.
///
/// Drives in a row that pass the same bytes on differ in the sum alone, by 1 from drive to drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Passing {
    awaits: Awaits,
    /// The address sum (`BusAddr`), once an address byte has passed.
    sum: Option<u8>,
}

/// The next byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaits {
    Sync,
    Address(TelegramHeader),
    Net(u8),
}

impl Passing {
    /// Whether the next byte is an address byte, to which each drive adds 1.
    #[must_use]
    #[inline]
    pub const fn awaits_address(self) -> bool {
        matches!(self.awaits, Awaits::Address(_))
    }

    /// Takes a byte as a drive that is not addressed; `None` for a byte that a drive does not simply pass on: PAUSE, a bad sync
    /// byte, and a short address before the first address byte.
    #[must_use]
    #[inline]
    pub fn receive(self, byte: u8) -> Option<Self> {
        let net = |left| {
            if left == 0 {
                Awaits::Sync
            } else {
                Awaits::Net(left)
            }
        };
        let (awaits, sum) = match self.awaits {
            Awaits::Net(left) => (net(left - 1), self.sum),
            Awaits::Address(header) => (net(header.net_length()), Some(passed_on(byte))),
            Awaits::Sync => match SyncByte::decode(byte).ok()? {
                SyncByte::Synco => (Awaits::Sync, self.sum),
                SyncByte::Pause => return None,
                SyncByte::Telegram(header) => match header.addressing() {
                    Addressing::AddressFollows => (Awaits::Address(header), self.sum),
                    Addressing::SameDrive => (net(header.net_length()), Some(self.sum?)),
                    Addressing::NextDrive => (net(header.net_length()), Some(passed_on(self.sum?))),
                },
            },
        };
        Some(Self { awaits, sum })
    }

    /// The same of the drive `places` behind.
    #[must_use]
    #[inline]
    pub fn behind(self, places: u8) -> Self {
        Self {
            sum: self.sum.map(|sum| sum.wrapping_add(places)),
            ..self
        }
    }

    /// The address sum, once an address byte has passed since power-up and the last check sequence.
    #[must_use]
    pub const fn sum(self) -> Option<u8> {
        self.sum
    }

    /// The sum that decides who is addressed, while net bytes are to come.
    #[must_use]
    #[inline]
    pub fn addressing(self) -> Option<u8> {
        self.sum.filter(|_| matches!(self.awaits, Awaits::Net(_)))
    }
}

impl BusEnd {
    /// What a drive with this `BusAddr` keeps of the bytes that it has passed on; `None` in the error mode until it increments (ND21 9.7),
    /// after a time-out, and for properties under which a drive looks at more.
    #[must_use]
    pub fn relay(&self, bus_addr: u8) -> Option<Relay> {
        let awaits = match &self.state {
            BusEndState::Sync => Awaits::Sync,
            BusEndState::Address(header) => Awaits::Address(*header),
            BusEndState::Passing { left } | BusEndState::Addressed { left, .. } => {
                Awaits::Net(*left)
            }
            BusEndState::Error(mode, LineSilence::None) => {
                return self.climb(mode).map(Relay::Climbing);
            }
            BusEndState::Error(..) => return None,
        };
        let properties = &self.properties;
        let kept =
            self.short_address_valid || properties.short_address == ShortAddress::NotAddressed;
        let accepted = properties.empty_short_telegram == EmptyShortTelegram::Accepted;
        let sum = self.short_address_valid.then_some(bus_addr);
        (kept && accepted).then_some(Relay::Passing(Passing { awaits, sum }))
    }

    #[cold]
    fn climb(&self, mode: &ErrorMode) -> Option<Climb> {
        let answered = self.properties.broken_sequence == BrokenSequence::Answered;
        mode.climb().filter(|_| answered)
    }

    /// Takes an undamaged byte that is for this drive, as [`Self::receive`] does. [`Self::relay`] must not be `None`.
    ///
    /// With a second caller, the compiler would no longer inline [`Self::receive`], which costs 10 % of the time of a ring in the error mode.
    pub fn answer<M: Memory>(&mut self, now: Instant, byte: u8, memory: &mut M) -> Reaction {
        self.last_received = Some(now);
        self.normal(byte, memory)
            .unwrap_or_else(|error| self.detect(error, Received::good(byte), memory))
    }

    /// Makes up for bytes that were passed on without it, the last of them at `at`. The caller writes `BusAddr`.
    pub fn has_relayed(&mut self, at: Instant, relay: Relay) {
        self.last_received = Some(at);
        match relay {
            Relay::Passing(Passing { awaits, sum }) => {
                self.short_address_valid = sum.is_some();
                self.state = match awaits {
                    Awaits::Sync => BusEndState::Sync,
                    Awaits::Address(header) => BusEndState::Address(header),
                    Awaits::Net(left) => BusEndState::Passing { left },
                };
            }
            Relay::Climbing(climb) => {
                if let BusEndState::Error(mode, _) = &mut self.state {
                    mode.has_climbed(climb);
                }
            }
        }
    }
}
