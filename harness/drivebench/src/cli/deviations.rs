//! `drivebench deviations`: the wrong drives and the wrong masters that a scenario can ask for.

use crate::buses::named;
use crate::command::args::{DeviationsArguments, TableFormat};
use crate::command::deviations::DeviationRow;
use crate::command::exit::Exit;
use crate::command::output::Output;
use serde::Serialize;
use std::fmt::Write as _;

/// All of them, for tools.
#[derive(Serialize)]
struct DeviationTable {
    schema: u8,
    deviations: Vec<DeviationRow>,
    masters: Vec<DeviationRow>,
}

/// Shows the deviations.
pub(crate) fn deviations(
    arguments: &DeviationsArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let filter = filter.to_lowercase();
    let holds = |row: &DeviationRow| {
        let texts = [row.name, row.section, row.about];
        let mut texts = texts.iter();
        texts.any(|text| text.to_lowercase().contains(&filter))
    };
    let mut rows = (named(arguments.bus).deviations)();
    rows.iter_mut().for_each(|rows| rows.retain(holds));
    let [rows, masters] = rows;
    if rows.is_empty() && masters.is_empty() {
        output.complain(
            "no deviation has this text in it; `drivebench deviations` shows all of them",
        );
        return Ok(Exit::NothingSelected);
    }
    let mut text = String::new();
    match arguments.format {
        TableFormat::Table => {
            let mut line = |name, section, about| {
                // Writing to a String cannot fail.
                let _infallible = writeln!(text, "{name:32} {section:9} {about}");
            };
            for row in rows {
                line(row.name, row.section, row.about);
            }
            if !masters.is_empty() {
                line(
                    "wrong masters",
                    "section",
                    "`master deviates NAME` in a scenario",
                );
            }
            for row in masters {
                line(row.name, row.section, row.about);
            }
        }
        TableFormat::Json => {
            text = serde_json::to_string(&DeviationTable {
                schema: 1,
                deviations: rows,
                masters,
            })?;
            text.push('\n');
        }
    }
    output.result(&text)?;
    Ok(Exit::Passed)
}
