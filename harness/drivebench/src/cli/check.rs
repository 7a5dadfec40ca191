//! `drivebench check`.

use super::args::CheckArguments;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::library::Entry;
use crate::scenario::files::sources;

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
                let needs = entry.settled.needs().iter();
                let needs: Vec<_> = needs.map(|need| need.name()).collect();
                let needs = match needs.is_empty() {
                    true => String::new(),
                    false => format!("; needs {}", needs.join(", ")),
                };
                output.result(&format!(
                    "{name}: no mistakes, {}{needs}\n",
                    counted(entry.scenario.steps, "step")
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
