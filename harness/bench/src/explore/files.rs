//! Files: whole or not at all, and read within bounds.

use super::error::ExploreError;
use crate::regular::{self, Links};
use std::path::Path;

/// The longest file that is read.
const LONGEST: u64 = 256 * 1024 * 1024;

/// Writes a file as a whole or not at all.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<(), ExploreError> {
    regular::write_text(path, text).map_err(|error| ExploreError::unwritten("write", path, &error))
}

pub fn read_text(path: &Path) -> Result<String, ExploreError> {
    let read = || {
        let bytes = regular::read(path, Links::Refuse, LONGEST)?;
        String::from_utf8(bytes).map_err(std::io::Error::other)
    };
    read().map_err(|error| ExploreError::file("read", path, &error))
}
