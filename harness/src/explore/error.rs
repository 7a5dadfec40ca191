//! Why exploring ends early.

use crate::rig::SessionError;
use crate::scenario::problem::Problems;

/// Why exploring ends early.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    /// The rig.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Lines that make no ring.
    #[error(transparent)]
    Mistakes(#[from] Box<Problems>),
    /// A file or a folder; the text names it and says what to do.
    #[error("{0}")]
    File(String),
    /// What was asked for cannot be; the text says what can.
    #[error("{0}")]
    Usage(String),
    /// The line is gone.
    #[error("{0}")]
    Lost(String),
}

impl ExploreError {
    /// A file that could not be used.
    pub(crate) fn file(what: &str, path: &std::path::Path, error: &dyn std::fmt::Display) -> Self {
        Self::File(format!("failed to {what} {}: {error}", path.display()))
    }
}
