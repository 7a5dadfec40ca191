//! Files that a command writes at its end: checked at its start, and written as a whole.

use super::file;
use super::output::Output;
use crate::regular;
use std::path::Path;

/// A file cannot be written, which has been reported.
pub struct NotWritable;

/// Checks that a file could be written.
pub fn writable(path: &Path, output: &mut Output) -> Result<(), NotWritable> {
    file::check(path).map_err(|failure| {
        failure.tell(output);
        NotWritable
    })
}

/// Writes a page atomically. Returns false after reporting a failure.
pub fn write(path: &Path, text: &str, output: &mut Output) -> bool {
    save(path, text, "the report is", output)
}

/// Writes a file atomically, and says that `what` is in it. Returns false after reporting a failure.
pub fn save(path: &Path, text: &str, what: &str, output: &mut Output) -> bool {
    match regular::write_text(path, text) {
        Ok(()) => {
            output.say(&format!("{what} in {}\n", path.display()));
            true
        }
        Err(error) => {
            output.complain(&format!("failed to write {}: {error}", path.display()));
            false
        }
    }
}
