//! What other programs use of a bus: drives by their axis numbers, and rings that are served to a controller.

use crate::rig::{End, FindError, Rig, SessionError};
use crate::scenario::files::LibraryError;
use crate::scenario::problem::Problems;
use crate::scenario::source::SourceError;
use crate::serve::{ServeError, ServedThread};
use harness_proto::nd21::State;
use std::fmt::{self, Debug};
use std::time::Duration;
use thiserror::Error as Derived;

/// Drives, or why there are none.
type OpenedDrives = Result<Box<dyn AxisDrives>, Error>;

/// What a bus lends to other programs.
pub struct Embedding {
    /// A simulated ring of this many drives with these header lines; empty for drives that are released and started by their inputs.
    pub simulated: fn(u8, &str) -> OpenedDrives,
    /// The drives of a rig, locked for other programs; whether motion is allowed.
    pub open: fn(&Rig, bool) -> OpenedDrives,
    /// A simulated ring of this many drives with these header lines, served at this address.
    pub served: fn(u8, &str, &str) -> Result<ServedThread, Error>,
}

/// Drives by their axis numbers (ND21 12.2). A call blocks until the drive has answered.
pub trait AxisDrives: Debug + Send {
    /// The axis numbers of all drives.
    fn axes(&self) -> Vec<u16>;

    /// Reads a cell by its name or address.
    ///
    /// # Errors
    /// There is no such cell or drive, or the drive does not answer.
    fn read(&self, axis: u16, cell: &str) -> Result<Reading, Error>;

    /// Writes a cell: `nsoll=1500rpm`.
    ///
    /// # Errors
    /// The cell cannot be written or cannot hold the value, the rig's file denies it, or the drive does not answer.
    fn write(&self, axis: u16, value: &str) -> Result<(), Error>;

    /// Reads the mode and the error of a drive.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    fn state(&self, axis: u16) -> Result<State, Error>;

    /// Commands a drive.
    ///
    /// # Errors
    /// There is no such drive, the rig's file denies it, or the drive does not answer.
    fn command(&self, axis: u16, command: AxisCommand) -> Result<(), Error>;

    /// Lets time pass while the bus stays at work.
    fn wait(&self, time: Duration);

    /// Gives the drives back; how a rig ended. After that there are none.
    fn close(&mut self) -> Option<End>;
}

/// A command to a drive (ND21 12.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisCommand {
    DeleteError,
    Go,
    Stop,
    Block,
}

/// What was read from a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    bytes: Vec<u8>,
    number: Option<f64>,
    unit: &'static str,
    text: String,
}

impl Reading {
    /// Bytes, the value in a unit where the cell holds a number, and all of it for people.
    #[doc(hidden)]
    #[must_use]
    pub fn new(bytes: Vec<u8>, (number, unit): (Option<f64>, &'static str), text: String) -> Self {
        Self {
            bytes,
            number,
            unit,
            text,
        }
    }

    /// The bytes, the highest first.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The value in its [unit](Self::unit); `None` for a cell that holds no number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        self.number
    }

    /// The unit of the value, such as `rpm`; empty if there is none.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.unit
    }
}

impl fmt::Display for Reading {
    /// Bytes with value or bits: `0652 (428.44 rpm)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

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
