//! Why evidence cannot be written or read.

use super::files::RECORD;
use crate::regular;
use std::io;
use std::path::Path;

/// Why a folder cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum EvidenceError {
    /// There is something in it.
    #[error("{0} is not empty; name a new or empty folder for the evidence")]
    NotEmpty(String),
    #[error("failed to use {path}: {error}")]
    File { path: String, error: io::Error },
    /// The record is damaged.
    #[error("{RECORD}: {0}")]
    Record(#[from] RecordError),
    /// It cannot be signed, or its signature cannot be checked.
    #[error("failed to use a signature: {0}")]
    Signature(String),
    /// It is no folder of a run: which, and why not.
    #[error("{0} is not an evidence folder: {1}")]
    Foreign(String, String),
    /// A folder of an earlier run that cannot be continued.
    #[error("failed to continue an earlier run: {0}")]
    Earlier(String),
    /// Folders that are no parts of one run.
    #[error("failed to merge: {0}")]
    Merge(String),
}

impl EvidenceError {
    /// A place that cannot be used.
    pub fn file(path: &Path, error: io::Error) -> Self {
        Self::File {
            path: path.display().to_string(),
            error: regular::in_words(path, error),
        }
    }
}

/// Why bytes are no record.
#[derive(Debug, thiserror::Error)]
#[error("line {line}, column {column} (byte {offset}): {message}")]
pub struct RecordError {
    /// Which line, counted from 1.
    pub line: usize,
    /// Where in it, in bytes, counted from 1.
    pub column: usize,
    /// Where in the record, in bytes, counted from 0.
    pub offset: usize,
    pub message: String,
}
