//! How a drive is, by its cells.

use super::bits::{flags, status};
use super::errors::{display_digits, in_words};
use alloc::string::String;

/// How a drive is (11.8, 14.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// `Status`.
    pub status: u8,
    /// `Flags`.
    pub flags: u8,
    /// `Flags2`.
    pub flags2: u8,
    /// `errorcode`.
    pub error: u16,
}

impl State {
    /// The mode in the manual's words (11.8): reset, error, block, stop or go.
    #[must_use]
    pub fn mode(&self) -> &'static str {
        if self.status & status::RESET != 0 {
            "reset"
        } else if self.status & status::ERROR != 0 {
            "error"
        } else if self.flags & flags::BLOCK != 0 {
            "block"
        } else if self.flags & flags::STOP != 0 {
            "stop"
        } else {
            "go"
        }
    }

    /// The error in words; `None` where there is none.
    #[must_use]
    pub fn error_in_words(&self) -> Option<String> {
        (self.error != 0 && display_digits(self.error).is_some()).then(|| in_words(self.error))
    }
}
