//! CAN frames over streams of characters: SLCAN and socketcand, both directions of each.
//!
//! [`slcan`] is the language of serial CAN adapters, [`socketcand`] that of the daemon which gives a CAN interface of Linux to the
//! network. Both are codecs without I/O: total over every input, with bounded memory. No bus is named here.

pub mod slcan;
pub mod socketcand;

use std::fmt;

/// A piece of a stream that is not a message of its protocol.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadMessage {
    received: String,
    expected: &'static str,
}

/// How much of a bad message is shown.
const SHOWN: usize = 40;

impl BadMessage {
    /// Whether the message begins with these characters.
    pub(crate) fn concerns(&self, beginning: &str) -> bool {
        self.received.starts_with(beginning)
    }

    /// The message, as far as it is shown.
    pub fn received(&self) -> &str {
        &self.received
    }

    fn new(received: &[u8], expected: &'static str) -> Self {
        let shown = received.get(..SHOWN).unwrap_or(received);
        let dots = if shown.len() < received.len() {
            "..."
        } else {
            ""
        };
        Self {
            received: format!("{}{dots}", shown.escape_ascii()),
            expected,
        }
    }
}

impl fmt::Display for BadMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "received \"{}\"; {}", self.received, self.expected)
    }
}

impl std::error::Error for BadMessage {}

/// The value of a hexadecimal digit.
fn digit(character: u8) -> Option<u32> {
    char::from(character).to_digit(16)
}

/// A number of hexadecimal digits, without a sign or blanks; `None` for none and for more than eight.
fn hexadecimal(digits: &[u8]) -> Option<u32> {
    if digits.is_empty() || digits.len() > 8 {
        return None;
    }
    digits.iter().try_fold(0, |number, &character| {
        Some(number << 4 | digit(character)?)
    })
}
