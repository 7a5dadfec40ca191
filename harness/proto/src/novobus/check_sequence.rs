//! The check sequence, which resets the drives after an error (ND21 9.8).

/// How many zeros the master sends before the five bytes (ND21 9.8), and how many a drive sends before
/// it begins to increment (9.7).
pub const ZEROS: u8 = 17;

/// The five bytes that end the error mode (ND21 9.8).
pub const SEQUENCE: [u8; 5] = [0xFF, 0x44, 0x72, 0x4C, 0x41];

/// The whole check sequence as the master sends it: 17 zeros and the five bytes (ND21 9.8).
pub const CHECK_SEQUENCE: [u8; ZEROS as usize + SEQUENCE.len()] = {
    let mut bytes = [0; ZEROS as usize + SEQUENCE.len()];
    let mut i = 0;
    while i < SEQUENCE.len() {
        bytes[ZEROS as usize + i] = SEQUENCE[i];
        i += 1;
    }
    bytes
};

/// As many check sequences as a sound ring of this many drives needs at the most.
///
/// A check sequence brings back each drive that has noticed the one before it, and one that has not: that one hears its seventeen zeros. In a
/// silence drives time out one byte apart, and every second one may not notice the one before it (9.9).
pub fn enough(drives: u16) -> impl Iterator<Item = u8> {
    (0..drives.max(2)).flat_map(|_| CHECK_SEQUENCE)
}

/// Watches a stream of bytes for [`SEQUENCE`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SequenceWatch {
    matched: u8,
}

/// What a byte was to the [`SequenceWatch`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SequenceProgress {
    /// Not part of a sequence.
    None,
    /// The FF that starts one; it may restart a sequence that broke off.
    Started,
    /// One of the bytes between.
    Continued,
    /// The 41 that completes one.
    Complete,
}

impl SequenceWatch {
    /// One that has seen this many bytes of a sequence, 0 to 4.
    pub(super) const fn after(matched: u8) -> Self {
        Self { matched }
    }

    /// How many bytes of a sequence have come, 0 to 4.
    #[must_use]
    pub const fn matched(self) -> u8 {
        self.matched
    }

    /// Takes the next byte; `good` is false where the line status said that it was damaged.
    #[inline]
    pub fn see(&mut self, byte: u8, good: bool) -> SequenceProgress {
        if !good {
            self.matched = 0;
            return SequenceProgress::None;
        }
        if byte == SEQUENCE[usize::from(self.matched)] {
            self.matched += 1;
            if self.matched == 1 {
                return SequenceProgress::Started;
            }
            if usize::from(self.matched) == SEQUENCE.len() {
                self.matched = 0;
                return SequenceProgress::Complete;
            }
            return SequenceProgress::Continued;
        }
        // No byte of the sequence but the first is an FF, so only a fresh start can follow a break-off.
        self.matched = u8::from(byte == SEQUENCE[0]);
        if self.matched == 1 {
            SequenceProgress::Started
        } else {
            SequenceProgress::None
        }
    }
}
