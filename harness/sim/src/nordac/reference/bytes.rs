//! A few octets in place: the model of the module makes several a telegram, and none has many.

use std::ops::Deref;

/// Most octets: those of a reply with SAPs and the data of PPO2 are 31.
const MOST: usize = 40;

/// Octets of a telegram or of its data.
#[derive(Clone, Copy, Debug)]
pub struct OctetList {
    octets: [u8; MOST],
    len: usize,
}

impl OctetList {
    /// As many zeros.
    pub(super) fn zeros(len: usize) -> Self {
        assert!(len <= MOST, "{len} octets");
        let octets = [0; MOST];
        Self { octets, len }
    }

    /// These octets, one part after the other.
    pub(super) fn of(parts: &[&[u8]]) -> Self {
        let mut all = Self::zeros(0);
        for part in parts {
            all.extend(part);
        }
        all
    }

    /// Appends octets.
    pub(super) fn extend(&mut self, octets: &[u8]) {
        let end = self.len + octets.len();
        self.octets[self.len..end].copy_from_slice(octets);
        self.len = end;
    }
}

impl Deref for OctetList {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.octets[..self.len]
    }
}
