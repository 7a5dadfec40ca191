//! Read-only view of a bus end (ND21 9.1-9.9).

use super::{BusEnd, BusEndState, LineSilence, Net};
use crate::novobus::error_mode::ErrorMode;

/// How long the line has been silent for a drive in the error mode (ND21 9.9).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Silent {
    /// No time-out has been detected since it went into the error mode.
    No,
    /// A time-out has been detected; zeros do not go out unasked yet.
    Waiting,
    /// Zeros go out unasked.
    Sending,
}

/// What of a telegram is still to come (ND21 9.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Remaining {
    /// The net bytes still to come.
    pub net_bytes: u8,
    /// Whether process data are among them and have not begun (D, 9.2).
    pub process_data: bool,
}

impl BusEnd {
    /// Whether an address byte has passed since power-up and since the last check sequence (ND21 9.2).
    #[must_use]
    #[inline]
    pub const fn short_address_valid(&self) -> bool {
        self.short_address_valid
    }

    /// Whether a command has been received in part (ND21 9.5).
    #[must_use]
    #[inline]
    pub fn command_begun(&self) -> bool {
        self.channel.next().is_some()
    }

    /// What of the present telegram is still to come; `None` between telegrams and in the error mode.
    #[must_use]
    #[inline]
    pub const fn remaining(&self) -> Option<Remaining> {
        let (net_bytes, process_data) = match &self.state {
            BusEndState::Address(header) => (header.net_length(), header.process_data()),
            BusEndState::Passing { left } => (*left, false),
            BusEndState::Addressed { left, next } => (*left, matches!(next, Net::ProcessHigh)),
            BusEndState::Sync | BusEndState::Error(..) => return None,
        };
        Some(Remaining {
            net_bytes,
            process_data,
        })
    }

    /// The error mode, and how long the line has been silent; `None` in normal mode (ND21 9.7, 9.9).
    #[must_use]
    #[inline]
    pub const fn error_mode(&self) -> Option<(&ErrorMode, Silent)> {
        let BusEndState::Error(mode, silence) = &self.state else {
            return None;
        };
        let silent = match silence {
            LineSilence::None => Silent::No,
            LineSilence::Waiting { .. } => Silent::Waiting,
            LineSilence::Sending { .. } => Silent::Sending,
        };
        Some((mode, silent))
    }
}
