//! Why exploring ends early.

use crate::regular::is_wrong_path;
use crate::rig::SessionError;
use crate::scenario::problem::Problems;

/// Why exploring ends early.
#[derive(Debug, thiserror::Error)]
pub enum ExploreError {
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Lines that make no ring.
    #[error(transparent)]
    Mistakes(#[from] Box<Problems>),
    /// A file or a folder; the text names it and says what to do.
    #[error("{0}")]
    File(String),
    /// A file that cannot be written although its path is right: the disk is full or broken.
    #[error("{0}")]
    Unwritable(String),
    /// The request cannot be met; the text says what is possible.
    #[error("{0}")]
    Usage(String),
    /// The line is lost.
    #[error("{0}")]
    Lost(String),
}

impl ExploreError {
    /// A file that could not be used.
    pub fn file(what: &str, path: &std::path::Path, error: &dyn std::fmt::Display) -> Self {
        Self::File(format!("failed to {what} {}: {error}", path.display()))
    }

    /// A file that could not be written.
    pub fn unwritten(what: &str, path: &std::path::Path, error: &std::io::Error) -> Self {
        let text = format!("failed to {what} {}: {error}", path.display());
        match is_wrong_path(error) {
            true => Self::File(text),
            false => Self::Unwritable(text),
        }
    }
}
