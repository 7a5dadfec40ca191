//! Why a call of the crate's own interface failed.

use crate::rig::{FindError, SessionError};
use crate::scenario::files::LibraryError;
use crate::scenario::problem::Problems;
use crate::scenario::source::SourceError;
use crate::serve::ServeError;
use thiserror::Error as Derived;

/// Why a call failed. The text names the place and the remedy.
#[derive(Debug, Derived)]
#[non_exhaustive]
pub enum Error {
    /// A scenario, a rig file, a cell or a value has mistakes: one line a mistake, with its place.
    #[error("{0}")]
    Mistake(String),
    /// A file cannot be read, or there is no such scenario or rig.
    #[error("{0}")]
    NotFound(String),
    /// A rig cannot be used, or could not be given back in its safe state.
    #[error("{0}")]
    Rig(String),
    /// The bus or a drive did not do what was asked.
    #[error("{0}")]
    Drive(String),
    /// A ring cannot be served.
    #[error("{0}")]
    Serve(String),
}

impl From<Problems> for Error {
    fn from(problems: Problems) -> Self {
        Self::Mistake(problems.lines())
    }
}

impl From<Box<Problems>> for Error {
    fn from(problems: Box<Problems>) -> Self {
        Self::from(*problems)
    }
}

impl From<SourceError> for Error {
    fn from(error: SourceError) -> Self {
        Self::NotFound(error.to_string())
    }
}

impl From<LibraryError> for Error {
    fn from(error: LibraryError) -> Self {
        Self::NotFound(error.to_string())
    }
}

impl From<FindError> for Error {
    fn from(error: FindError) -> Self {
        match error {
            FindError::Mistakes(problems) => problems.into(),
            error => Self::NotFound(error.to_string()),
        }
    }
}

impl From<SessionError> for Error {
    fn from(error: SessionError) -> Self {
        Self::Rig(error.to_string())
    }
}

impl From<ServeError> for Error {
    fn from(error: ServeError) -> Self {
        Self::Serve(error.to_string())
    }
}
