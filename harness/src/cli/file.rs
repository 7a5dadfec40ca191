//! Files that are there whole or not at all.

use super::exit::Exit;
use super::failure::Failure;
use crate::regular;
use std::path::Path;

/// Writes a text into a file.
pub(crate) fn write(path: &Path, text: &str) -> Result<(), Failure> {
    if path.file_name().is_none() {
        return Err(Failure::refused(format!(
            "{} is not the name of a file",
            path.display()
        )));
    }
    regular::write_text(path, text).map_err(|error| {
        let message = format!("failed to write {}: {error}", path.display());
        Failure::Said(Exit::RigError, message)
    })
}
