//! `drivebench report`.

use super::args::ReportArguments;
use super::exit::Exit;
use super::output::Output;
use super::page::{writable, write};
use crate::evidence::derive;

/// Makes the reports of a folder again.
pub(super) fn report(arguments: &ReportArguments, output: &mut Output) -> std::io::Result<Exit> {
    for path in arguments.html.iter().chain(&arguments.junit) {
        if writable(path, output).is_err() {
            return Ok(Exit::Usage);
        }
    }
    let derived = match derive(&arguments.folder) {
        Ok(derived) => derived,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::Usage);
        }
    };
    let html = arguments.html.iter().map(|path| (path, &derived.html));
    let junit = arguments.junit.iter().map(|path| (path, &derived.junit));
    for (path, text) in html.chain(junit) {
        if !write(path, text, output) {
            return Ok(Exit::RigError);
        }
    }
    Ok(Exit::Passed)
}
