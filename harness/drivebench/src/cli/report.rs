//! `drivebench report`.

use super::args::ReportArguments;
use crate::bus_name::BusName;
use crate::buses::fuzz_of;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::{writable, write};
use crate::evidence::{RIG, derive};
use crate::explore::{RECORD, bus_of_run};

/// Makes the reports of a folder again.
pub(crate) fn report(arguments: &ReportArguments, output: &mut Output) -> std::io::Result<Exit> {
    for path in arguments.html.iter().chain(&arguments.junit) {
        if writable(path, output).is_err() {
            return Ok(Exit::Usage);
        }
    }
    if arguments.folder.join(RECORD).exists() && !arguments.folder.join(RIG).exists() {
        return Ok(explored(arguments, output));
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

/// The page of a run of fuzzing.
fn explored(arguments: &ReportArguments, output: &mut Output) -> Exit {
    if arguments.junit.is_some() {
        output.complain(
            "a run of fuzzing has no verdicts of scenarios: JUnit is made of folders of evidence",
        );
        return Exit::Usage;
    }
    let bus = bus_of_run(&arguments.folder).unwrap_or(BusName::DEFAULT);
    let text = match fuzz_of(bus).map(|fuzz| (fuzz.page)(&arguments.folder)) {
        Some(Ok(text)) => text,
        None => return Exit::Usage,
        Some(Err(error)) => {
            output.complain(&error.to_string());
            return Exit::Usage;
        }
    };
    let written = arguments.html.iter().all(|path| write(path, &text, output));
    if written {
        Exit::Passed
    } else {
        Exit::RigError
    }
}
