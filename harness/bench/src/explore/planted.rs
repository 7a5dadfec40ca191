//! A deviation that is planted in a drive.

use serde::{Deserialize, Serialize};

/// A deviation that is planted in a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Planted {
    /// In which ring, counted from 0.
    #[serde(default, skip_serializing_if = "is_first")]
    pub ring: usize,
    /// The drive's number or address.
    #[serde(alias = "slave")]
    pub drive: u8,
    /// The name of the deviation.
    pub name: String,
}

pub const fn is_first(ring: &usize) -> bool {
    *ring == 0
}
