//! Why a command on a bus came to no good end, and which exit code that is.

use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::link::Trouble;
use crate::scenario::files::LibraryError;
use crate::scenario::problem::Problems;

/// Why a command ended early.
#[derive(Debug)]
pub enum Failure {
    /// Standard output cannot be written to.
    Output(std::io::Error),
    /// An error message with its exit code.
    Said(Exit, String),
    /// The error has been reported already; this is its exit code.
    Told(Exit),
    /// There is no file, or it has mistakes.
    File(LibraryError),
    /// The driver gave up: the error message with its exit code.
    Bus(Exit, String),
}

impl Failure {
    /// The request is impossible, or it needs a permission that was not given.
    pub fn refused(message: impl Into<String>) -> Self {
        Self::Said(Exit::Usage, message.into())
    }

    /// A drive is not in the requested state, or did not do what was requested.
    pub fn drive(message: impl Into<String>) -> Self {
        Self::Said(Exit::Failed, message.into())
    }

    /// Reports the error and returns its exit code.
    pub fn tell(&self, output: &mut Output) -> Exit {
        match self {
            Self::Output(error) => output.unwritable(error),
            Self::Said(exit, message) | Self::Bus(exit, message) => {
                output.complain(message);
                *exit
            }
            Self::Told(exit) => *exit,
            Self::File(error) => {
                output.library_error(error);
                Exit::Usage
            }
        }
    }
}

/// The exit code of a line in trouble.
pub const fn exit_of_trouble(trouble: &Trouble) -> Exit {
    match trouble {
        Trouble::Interrupted => Exit::Interrupted,
        Trouble::Interlock(_) => Exit::Interlock,
        Trouble::Denied(_) => Exit::Usage,
        Trouble::Lost(_) | Trouble::Garbled(_) => Exit::RigError,
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Output(error)
    }
}

impl From<Problems> for Failure {
    fn from(problems: Problems) -> Self {
        Self::File(Box::new(problems).into())
    }
}

impl From<LibraryError> for Failure {
    fn from(error: LibraryError) -> Self {
        Self::File(error)
    }
}
