//! Files that are there whole or not at all.

use super::failure::Failure;
use crate::cli::exit::Exit;
use std::path::Path;

/// Writes a text into a file: first beside its place, then into it.
pub(super) fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let failed = |error: std::io::Error| {
        let message = format!("failed to write {}: {error}", path.display());
        Failure::Said(Exit::RigError, message)
    };
    let Some(name) = path.file_name() else {
        return Err(Failure::refused(format!(
            "{} is not the name of a file",
            path.display()
        )));
    };
    let mut beside = std::ffi::OsString::from(".");
    beside.push(name);
    beside.push(format!(".{}.part", std::process::id()));
    let beside = path.with_file_name(beside);
    let written = whole(&beside, text).and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|error| {
        // Where nothing was begun there is nothing to take away.
        let _gone = std::fs::remove_file(&beside);
        failed(error)
    })
}

fn whole(path: &Path, text: &str) -> std::io::Result<()> {
    use std::io::Write as _;
    let mut file = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(path)?;
    file.write_all(text.as_bytes())?;
    file.sync_all()
}
