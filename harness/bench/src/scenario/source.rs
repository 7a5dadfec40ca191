//! A scenario's text, from a file or from the binary itself.

use crate::regular;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

/// The largest text file (scenario, rig, campaign), in bytes. The longest built-in one has a fiftieth of it.
pub const MAX_SIZE: u64 = 1 << 20;

/// The longest line, in bytes: mistakes are shown with their line.
pub(crate) const MAX_LINE: usize = 10_000;

/// A text with the name under which people know it.
#[derive(Clone, Debug)]
pub struct Source {
    /// The path, or the name of a built-in scenario.
    pub name: String,
    pub text: Arc<str>,
}

/// Why a file is not a scenario.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// It cannot be read.
    #[error("failed to read {name}: {error}")]
    Unreadable { name: String, error: std::io::Error },
    /// It is a folder, a device, a FIFO or the like.
    #[error(
        "{name} is not a regular file; a text file or the pipe of a shell substitution is expected"
    )]
    NotAFile { name: String },
    /// It is too large.
    #[error("{name} has more than {} KiB; a short text is expected", MAX_SIZE >> 10)]
    TooLarge { name: String },
    /// A line is too long to be shown.
    #[error("{name}:{line}: the line has more than {MAX_LINE} characters; split it")]
    LongLine {
        name: String,
        /// Which line, counted from 1.
        line: usize,
    },
    /// It is not text.
    #[error("{name} is not a text: byte {offset} is {byte:02X}; a text file in UTF-8 is expected")]
    NotText {
        name: String,
        offset: usize,
        /// What stands there.
        byte: u8,
    },
}

/// The line of a byte of a text, counted from 1.
pub fn line_number(text: &str, at: usize) -> usize {
    let before = text.bytes().take(at);
    1 + before.filter(|byte| *byte == b'\n').count()
}

impl Source {
    /// A text that no file has.
    pub fn new(name: impl Into<String>, text: impl Into<Arc<str>>) -> Self {
        Self {
            name: name.into(),
            text: text.into(),
        }
    }

    /// Reads a scenario from a file, or from the pipe of a shell substitution.
    ///
    /// # Errors
    /// The file cannot be read, is too large or is no text.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let unreadable = |error| SourceError::Unreadable {
            name: name.clone(),
            error,
        };
        let not_a_file = |error: &std::io::Error| {
            use std::io::ErrorKind::{InvalidInput, WouldBlock};
            matches!(error.kind(), InvalidInput | WouldBlock)
        };
        let mut bytes = Vec::new();
        let opened = regular::open_input(path);
        let read = opened.and_then(|file| file.take(MAX_SIZE + 1).read_to_end(&mut bytes));
        match read {
            Ok(_) => {}
            Err(error) if not_a_file(&error) => return Err(SourceError::NotAFile { name }),
            Err(error) => return Err(unreadable(error)),
        }
        if bytes.len() as u64 > MAX_SIZE {
            return Err(SourceError::TooLarge { name });
        }
        Self::from_bytes(name, bytes)
    }

    /// Takes the bytes of a file.
    ///
    /// # Errors
    /// They are no text.
    pub fn from_bytes(name: String, bytes: Vec<u8>) -> Result<Self, SourceError> {
        let control = |byte: &u8| *byte < b' ' && !matches!(byte, b'\n' | b'\r' | b'\t');
        if let Some(offset) = bytes.iter().position(control) {
            let byte = bytes[offset];
            return Err(SourceError::NotText { name, offset, byte });
        }
        if let Some(line) = bytes
            .split(|byte| *byte == b'\n')
            .position(|line| line.len() > MAX_LINE)
        {
            let line = line + 1;
            return Err(SourceError::LongLine { name, line });
        }
        match String::from_utf8(bytes) {
            Ok(text) => Ok(Self {
                name,
                // Some editors put a byte order mark in front.
                text: text.strip_prefix('\u{FEFF}').unwrap_or(&text).into(),
            }),
            Err(error) => {
                let offset = error.utf8_error().valid_up_to();
                let byte = error.as_bytes()[offset];
                Err(SourceError::NotText { name, offset, byte })
            }
        }
    }
}
