//! `drivebench check`.

use super::args::CheckArguments;
use super::exit::Exit;
use super::output::Output;
use crate::counted::counted;
use crate::library::{Entry, sources};

/// Reads scenarios and plays nothing.
pub(crate) fn check(arguments: &CheckArguments, output: &mut Output) -> std::io::Result<Exit> {
    let sources = match sources(&arguments.files) {
        Ok(sources) => sources,
        Err(error) => {
            output.library_error(&error);
            return Ok(Exit::Usage);
        }
    };
    if sources.is_empty() {
        output.complain("no scenario (*.scn) was found in the folders given");
        return Ok(Exit::NothingSelected);
    }
    let mut exit = Exit::Passed;
    for source in sources {
        let name = source.name.clone();
        match Entry::new(source, arguments.ring) {
            Ok(entry) => {
                let steps = entry.scenario.steps.len();
                let needs = entry
                    .plan
                    .map(|plan| crate::scenario::run::needs(&plan).join(", "));
                let needs = needs
                    .filter(|needs| !needs.is_empty())
                    .map(|needs| format!("; needs {needs}"))
                    .unwrap_or_default();
                output.result(&format!(
                    "{name}: no mistakes, {}{needs}\n",
                    counted(steps, "step")
                ))?;
            }
            Err(problems) => {
                output.mistakes(&problems);
                exit = Exit::Usage;
            }
        }
    }
    Ok(exit)
}
