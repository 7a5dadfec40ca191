//! `drivebench deviations`: the wrong drives and the wrong masters that a scenario can ask for.

use crate::cli::args::{DeviationsArguments, TableFormat};
use crate::cli::exit::Exit;
use crate::cli::output::Output;
use harness_sim::novobus::deviation::{
    Deviation, MasterDeviation, deviations as all, master_deviations,
};
use serde::Serialize;
use std::fmt::Write as _;

/// The names of the deviations of drives.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    all().map(|deviation| deviation.name)
}

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

/// One deviation of the bench's own master, for tools.
#[derive(Serialize)]
struct MasterRow {
    name: &'static str,
    section: &'static str,
    about: &'static str,
}

impl From<&MasterDeviation> for MasterRow {
    fn from(deviation: &MasterDeviation) -> Self {
        Self {
            name: deviation.name,
            section: deviation.section,
            about: deviation.about,
        }
    }
}

/// All of them, for tools.
#[derive(Serialize)]
struct Table {
    schema: u8,
    deviations: Vec<Row>,
    masters: Vec<MasterRow>,
}

/// Shows the deviations.
pub(crate) fn deviations(
    arguments: &DeviationsArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let filter = filter.to_lowercase();
    let holds = |texts: [&str; 3]| {
        texts
            .iter()
            .any(|text| text.to_lowercase().contains(&filter))
    };
    let rows: Vec<Row> = all()
        .filter(|d| holds([d.name, d.section, d.about]))
        .map(Row::from)
        .collect();
    let masters: Vec<MasterRow> = master_deviations()
        .filter(|d| holds([d.name, d.section, d.about]))
        .map(MasterRow::from)
        .collect();
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
            text = serde_json::to_string(&Table {
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
