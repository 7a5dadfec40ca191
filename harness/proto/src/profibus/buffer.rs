//! Buffer in place, without allocation.

use super::fdl::MAX_TELEGRAM;
use core::fmt;
use core::ops::Deref;

/// Buffer in place: up to a whole telegram.
#[derive(Clone, Copy)]
pub struct Buffer {
    bytes: [u8; MAX_TELEGRAM],
    len: u8,
}

impl Buffer {
    /// No octets.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [0; MAX_TELEGRAM],
            len: 0,
        }
    }

    /// These octets; `None` if there are more than [`MAX_TELEGRAM`].
    #[must_use]
    #[inline]
    pub fn of(octets: &[u8]) -> Option<Self> {
        let mut all = Self::new();
        all.extend(octets).then_some(all)
    }

    /// Appends an octet; `false`, and nothing is changed, if there is no room.
    #[must_use]
    pub fn push(&mut self, octet: u8) -> bool {
        self.extend(&[octet])
    }

    /// Appends octets; `false`, and nothing is changed, if there is not room for all.
    #[must_use]
    #[inline]
    pub fn extend(&mut self, octets: &[u8]) -> bool {
        let begin = usize::from(self.len);
        let end = begin + octets.len();
        let (Some(place), Ok(len)) = (self.bytes.get_mut(begin..end), u8::try_from(end)) else {
            return false;
        };
        place.copy_from_slice(octets);
        self.len = len;
        true
    }

    /// Removes all octets.
    pub fn clear(&mut self) {
        self.len = 0;
    }
}

impl Default for Buffer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deref for Buffer {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.bytes[..usize::from(self.len)]
    }
}

impl PartialEq for Buffer {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl Eq for Buffer {}

/// Two hexadecimal digits an octet, with blanks between.
impl fmt::Display for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, octet) in self.iter().enumerate() {
            let blank = if index == 0 { "" } else { " " };
            write!(f, "{blank}{octet:02X}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{self}]")
    }
}
