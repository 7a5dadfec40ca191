//! Files that are there whole or not at all.

use super::exit::Exit;
use super::failure::Failure;
use crate::regular;
use std::io::Write;
use std::path::Path;

/// Refuses a file that cannot be written, before the work for it begins.
pub fn check(path: &Path) -> Result<(), Failure> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let why = if path.is_dir() {
        "it is a folder; name a file in it"
    } else if !folder.is_dir() {
        "there is no such folder; make it first"
    } else {
        return Ok(());
    };
    let path = path.display();
    Err(Failure::refused(format!("failed to write {path}: {why}")))
}

/// Writes a text into a file.
pub fn write(path: &Path, text: &str) -> Result<(), Failure> {
    if path.file_name().is_none() {
        return Err(Failure::refused(format!(
            "{} is not the name of a file",
            path.display()
        )));
    }
    regular::write_text(path, text).map_err(|error| failed(path, &error))
}

/// Writes a file while work goes on, and gives what the work gave and whether the file was written. Where the work gives `false` too, it has
/// written nothing, and what stood in the place of the file stays.
///
/// # Errors
/// The file cannot be begun; then the work has not begun either.
pub(crate) fn write_while<T>(
    path: &Path,
    work: impl FnOnce(&mut dyn Write) -> (T, bool),
) -> Result<(T, Result<(), Failure>), Failure> {
    let mut done = None;
    let written = regular::write(path, |mut out| {
        let (value, some) = work(&mut out);
        done = Some((value, some));
        match some {
            true => out.flush(),
            false => Err(std::io::Error::other("nothing was written")),
        }
    });
    let written = written.map_err(|error| failed(path, &error));
    match done {
        Some((value, true)) => Ok((value, written)),
        Some((value, false)) => Ok((value, Ok(()))),
        None => Err(written.err().unwrap_or(Failure::Told(Exit::RigError))),
    }
}

/// A file could not be written.
pub fn failed(path: &Path, error: &std::io::Error) -> Failure {
    let message = format!("failed to write {}: {error}", path.display());
    Failure::Said(Exit::of_file(error), message)
}
