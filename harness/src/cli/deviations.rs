//! `drivebench deviations`: the wrong drives that a scenario can ask for.

use super::args::{DeviationsArguments, Format};
use super::exit::Exit;
use super::output::Output;
use harness_sim::deviation::{Deviation, deviations as all};
use serde::Serialize;
use std::fmt::Write as _;

/// One deviation, for tools.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    section: &'static str,
    about: &'static str,
    /// Which models can deviate so.
    models: &'static [&'static str],
}

impl From<&Deviation> for Row {
    fn from(deviation: &Deviation) -> Self {
        Self {
            name: deviation.name,
            section: deviation.section,
            about: deviation.about,
            models: if deviation.behind_the_bus {
                &["nd21"]
            } else {
                &["plain", "nd21"]
            },
        }
    }
}

/// All of them, for tools.
#[derive(Serialize)]
struct Table {
    schema: u8,
    deviations: Vec<Row>,
}

/// Shows the deviations.
pub(super) fn deviations(
    arguments: &DeviationsArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let filter = filter.to_lowercase();
    let wanted = |d: &&Deviation| {
        let texts = [d.name, d.section, d.about];
        texts
            .iter()
            .any(|text| text.to_lowercase().contains(&filter))
    };
    let rows: Vec<Row> = all().filter(wanted).map(Row::from).collect();
    if rows.is_empty() {
        output.complain(
            "no deviation has this text in it; `drivebench deviations` shows all of them",
        );
        return Ok(Exit::NothingSelected);
    }
    let mut text = String::new();
    match arguments.format {
        Format::Table => {
            for row in rows {
                // Writing to a String cannot fail.
                let _infallible = writeln!(text, "{:32} {:9} {}", row.name, row.section, row.about);
            }
        }
        Format::Json => {
            text = serde_json::to_string(&Table {
                schema: 1,
                deviations: rows,
            })?;
            text.push('\n');
        }
    }
    output.result(&text)?;
    Ok(Exit::Passed)
}
