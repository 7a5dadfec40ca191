//! Commands in part: one may be cut over several telegrams (ND21 9.5).

/// The longest command without its checking byte (ND21 10.1).
const LONGEST: usize = 5;

/// A command or its answer, the checking byte left out, as far as it has been sent.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Half {
    bytes: [u8; LONGEST],
    length: u8,
}

impl Half {
    pub(super) fn sent(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    pub(super) fn with(mut self, byte: u8) -> Self {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
        self
    }
}

/// How many bytes a command has in front of its checking byte (ND21 10.1-10.5).
pub(super) const fn length(code: u8) -> Option<usize> {
    Some(match code {
        0xC8 | 0xDD => 2,
        0xC0 | 0xA4 | 0xA5 => 3,
        0xC1 | 0x82 => 4,
        0xC7 | 0x63 => 5,
        _ => return None,
    })
}
