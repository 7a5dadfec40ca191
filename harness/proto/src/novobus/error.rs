//! What a drive can find wrong with its bus (ND21 9.7, 9.9; codes from 14.11.14).

use crate::line::LineError;
use crate::nd21::errors::ErrorCode;
use core::fmt;

/// The reason for which a drive goes into the error mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BusError {
    /// `SCIoverrun`: a byte was not fetched in time.
    Overrun,
    /// `SCIparity`: the parity is not odd.
    Parity,
    /// `SCIframing`: no stop bit; a break is one too.
    Framing,
    /// `NBsync`: not a sync byte where one is due (9.2).
    Sync,
    /// `NBcommand`: not one of the nine commands (chapter 10).
    Command,
    /// `NBparam`: a command's parameter cannot be accepted: an address out of range, a wrong fixed byte.
    Parameter,
    /// `NBchecksum`: the checking byte does not fit the command (9.6).
    Checksum,
    /// `NBtimeout`: nothing was received for 10 ms (9.9).
    TimeOut,
}

impl BusError {
    /// All of them, in order of their codes.
    pub const ALL: [Self; 8] = [
        Self::Overrun,
        Self::Parity,
        Self::Framing,
        Self::Sync,
        Self::Command,
        Self::Parameter,
        Self::Checksum,
        Self::TimeOut,
    ];

    /// The row of the drive's error codes (ND21 14.11.14).
    #[must_use]
    pub const fn error_code(self) -> ErrorCode {
        match self {
            Self::Overrun => ErrorCode::SciOverrun,
            Self::Parity => ErrorCode::SciParity,
            Self::Framing => ErrorCode::SciFraming,
            Self::Sync => ErrorCode::NbSync,
            Self::Command => ErrorCode::NbCommand,
            Self::Parameter => ErrorCode::NbParam,
            Self::Checksum => ErrorCode::NbChecksum,
            Self::TimeOut => ErrorCode::NbTimeout,
        }
    }

    /// The error code that the drive shows in its cell `errorcode` (ND21 14.11.14).
    #[must_use]
    pub const fn code(self) -> u16 {
        self.error_code().code()
    }

    /// The error with this code.
    #[must_use]
    pub fn from_code(code: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|error| error.code() == code)
    }

    /// The name that the manual prints (ND21 14.11.14).
    #[must_use]
    pub const fn printed_name(self) -> &'static str {
        self.error_code().printed_name()
    }

    /// The word that records use for the cause.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Overrun => "overrun",
            Self::Parity => "parity",
            Self::Framing => "framing",
            Self::Sync => "sync",
            Self::Command => "command",
            Self::Parameter => "parameter",
            Self::Checksum => "checksum",
            Self::TimeOut => "time-out",
        }
    }
}

impl From<LineError> for BusError {
    fn from(error: LineError) -> Self {
        match error {
            LineError::Parity => Self::Parity,
            LineError::Framing | LineError::Break => Self::Framing,
            LineError::Overrun => Self::Overrun,
        }
    }
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X} {}", self.code(), self.printed_name())
    }
}
