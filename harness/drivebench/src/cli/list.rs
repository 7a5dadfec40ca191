//! `drivebench list`.

use super::args::Selection;
use super::run::select;
use crate::command::exit::Exit;
use crate::command::output::Output;
use std::fmt::Write as _;

/// Shows what scenarios there are.
pub(crate) fn list(selection: &Selection, output: &mut Output) -> std::io::Result<Exit> {
    let entries = match select(selection, None) {
        Ok(entries) => entries,
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            return Ok(Exit::Usage);
        }
    };
    if entries.is_empty() {
        output.complain("no scenario was selected");
        return Ok(Exit::NothingSelected);
    }
    let mut text = String::new();
    for entry in &entries {
        let sources: Vec<_> = entry
            .scenario
            .sources
            .iter()
            .map(|s| s.text.as_str())
            .collect();
        let rings = entry.scenario.rings.join(", ");
        let bench = match rings.is_empty() {
            true => format!("{} {}", entry.scenario.bus.name(), entry.drives()),
            false => format!("ring {rings}"),
        };
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "{:44} {bench:13} {:26} {}",
            entry.short_name(),
            sources.join(", "),
            entry.scenario.title
        );
    }
    output.result(&output.fitted(&text))?;
    Ok(Exit::Passed)
}
