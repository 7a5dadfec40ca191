//! Files: whole or not at all, and read within bounds.

use super::error::ExploreError;
use crate::regular::{self, Links};
use std::io::Write;
use std::path::Path;

/// The longest file that is read.
const LONGEST: u64 = 256 * 1024 * 1024;

/// Writes a file under another name first: it is there whole or not at all.
pub(super) fn write_whole(path: &Path, text: &str) -> Result<(), ExploreError> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let part = path.with_file_name(name);
    let write = || {
        let mut file = std::fs::File::create(&part)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        std::fs::rename(&part, path)
    };
    write().map_err(|error| {
        let _gone = std::fs::remove_file(&part);
        ExploreError::file("write", path, &error)
    })
}

/// Reads a text.
pub(super) fn read_text(path: &Path) -> Result<String, ExploreError> {
    let read = || {
        let bytes = regular::read(path, Links::Refuse, LONGEST)?;
        String::from_utf8(bytes).map_err(std::io::Error::other)
    };
    read().map_err(|error| ExploreError::file("read", path, &error))
}
