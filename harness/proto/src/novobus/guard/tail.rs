//! The last bytes that have passed, in which a check sequence could be hidden (ND21 9.8).

use crate::novobus::check_sequence::SEQUENCE;

/// The last four bytes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tail {
    bytes: [u8; 4],
    length: u8,
}

impl Tail {
    /// The increment that turns the last four bytes and this one into the check sequence.
    pub(super) fn shift(&self, byte: u8) -> Option<u8> {
        let [a, b, c, d] = self.bytes;
        let shift = SEQUENCE[0].wrapping_sub(a);
        let fits = [a, b, c, d, byte]
            .iter()
            .zip(SEQUENCE)
            .all(|(byte, printed)| byte.wrapping_add(shift) == printed);
        (fits && usize::from(self.length) == self.bytes.len()).then_some(shift)
    }

    pub(super) fn push(&mut self, byte: u8) {
        self.bytes.rotate_left(1);
        self.bytes[3] = byte;
        self.length = (self.length + 1).min(4);
    }
}
