//! Whether the drives of a bench are in their safe state, in no bus's words.

use std::fmt;

/// How the way to the safe state ended.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub struct Safe {
    /// Every drive reported its safe state.
    pub confirmed: bool,
    /// What the drives reported, or which of them did not, in sentences.
    pub words: String,
}

impl fmt::Display for Safe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}
