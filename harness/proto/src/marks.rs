//! In-band marks: how a stream of bytes carries line errors.
//!
//! The coding is that of `PARMRK` (POSIX termios, with `INPCK`, without `IGNPAR` and `ISTRIP`), which a kernel gives
//! for a serial port: a good FF is sent as FF FF, a byte x with a line error as FF 00 x, every other byte as it
//! is. A stream that has no line of its own, a pseudo terminal or a socket, is given the same coding by both
//! its ends.
//!
//! FF 00 00 is a break or a 00 with an error: the coding does not tell them, nor parity from framing errors.

use crate::line::{LineError, Received};
use core::fmt;

/// What stands in front of a mark.
const MARK: u8 = 0xFF;

/// A byte as it is written into a marked stream: one byte to three.
#[must_use]
pub const fn mark(received: Received) -> Marked {
    match (received.error, received.byte) {
        (Some(LineError::Break), _) => Marked::new([MARK, 0, 0], 3),
        // An overrun loses a byte, and the one that came is good.
        (None | Some(LineError::Overrun), MARK) => Marked::new([MARK, MARK, 0], 2),
        (None | Some(LineError::Overrun), byte) => Marked::new([byte, 0, 0], 1),
        (Some(LineError::Parity | LineError::Framing), byte) => Marked::new([MARK, 0, byte], 3),
    }
}

/// One byte to three.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Marked {
    bytes: [u8; 3],
    length: u8,
}

impl Marked {
    const fn new(bytes: [u8; 3], length: u8) -> Self {
        Self { bytes, length }
    }

    /// The bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }
}

/// A byte that cannot stand after an FF: the other end does not mark, or bytes were lost in between.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadMark {
    /// The byte.
    pub byte: u8,
}

impl fmt::Display for BadMark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "FF {:02X} in a stream with in-band marks, where FF FF or FF 00 is expected: does the other end mark?",
            self.byte
        )
    }
}

impl core::error::Error for BadMark {}

/// Reads a marked stream byte by byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unmark {
    state: MarkState,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum MarkState {
    #[default]
    Plain,
    /// Behind an FF.
    Marked,
    /// Behind FF 00.
    Damaged,
}

impl Unmark {
    /// Takes a byte of the stream; `None` in the middle of a mark.
    ///
    /// # Errors
    /// [`BadMark`]; the byte is dropped, and the decoder restarts at the next one.
    pub fn push(&mut self, byte: u8) -> Option<Result<Received, BadMark>> {
        let (state, read) = match (self.state, byte) {
            (MarkState::Plain, MARK) => (MarkState::Marked, None),
            (MarkState::Plain, byte) => (MarkState::Plain, Some(Ok(Received::good(byte)))),
            (MarkState::Marked, MARK) => (MarkState::Plain, Some(Ok(Received::good(MARK)))),
            (MarkState::Marked, 0) => (MarkState::Damaged, None),
            (MarkState::Marked, byte) => (MarkState::Plain, Some(Err(BadMark { byte }))),
            (MarkState::Damaged, 0) => (
                MarkState::Plain,
                Some(Ok(Received::bad(0, LineError::Break))),
            ),
            (MarkState::Damaged, byte) => (
                MarkState::Plain,
                Some(Ok(Received::bad(byte, LineError::Parity))),
            ),
        };
        self.state = state;
        read
    }

    /// Whether the stream may end here: not in the middle of a mark.
    #[must_use]
    pub fn at_boundary(self) -> bool {
        self.state == MarkState::Plain
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn all() -> impl Iterator<Item = Received> {
        let errors = [None, Some(LineError::Parity), Some(LineError::Framing)];
        let byte = move |byte| errors.map(|error| Received { byte, error });
        (0..=255).flat_map(byte)
    }

    /// termios(3): PARMRK.
    #[test]
    fn as_termios_prints_it() {
        let marked = |received| mark(received).as_bytes().to_vec();
        assert_eq!(marked(Received::good(0x41)), [0x41]);
        assert_eq!(marked(Received::good(0xFF)), [0xFF, 0xFF]);
        assert_eq!(
            marked(Received::bad(0xFF, LineError::Parity)),
            [0xFF, 0, 0xFF]
        );
        assert_eq!(marked(Received::bad(0, LineError::Break)), [0xFF, 0, 0]);
    }

    /// Every pair of bytes comes back, with an error where one was; no byte of the next is taken.
    #[test]
    fn round_trip() {
        for first in all() {
            for second in all() {
                let mut unmark = Unmark::default();
                let stream = [mark(first), mark(second)];
                let read: Vec<_> = stream
                    .iter()
                    .flat_map(|marked| marked.as_bytes().to_vec())
                    .filter_map(|byte| unmark.push(byte))
                    .collect();
                let shown = |r: Received| (r.byte, r.error.is_some());
                let read: Vec<_> = read.into_iter().map(|r| r.map(shown)).collect();
                assert_eq!(read, [Ok(shown(first)), Ok(shown(second))]);
                assert!(unmark.at_boundary());
            }
        }
    }

    /// Every stream is read to its end, and a foreign one is noticed.
    #[test]
    fn what_is_no_mark() {
        for byte in 1..=0xFE {
            let mut unmark = Unmark::default();
            assert_eq!(unmark.push(0xFF), None);
            assert_eq!(unmark.push(byte), Some(Err(BadMark { byte })));
            assert_eq!(unmark.push(0x41), Some(Ok(Received::good(0x41))));
        }
    }
}
