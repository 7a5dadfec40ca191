//! Options that several commands have.

use super::exit::Exit;
use super::output::Output;
use crate::bus_name::BusName;
use crate::file::values::{Time, ValueError};
use clap::{Args, ValueEnum};
use std::io;
use std::time::Duration;

/// For `cells`.
#[derive(Clone, Debug, Args)]
pub struct CellsArguments {
    /// Only cells with this text in their name, address or meaning.
    pub filter: Option<String>,
    /// List the EEPROM instead of the RAM.
    #[arg(long)]
    pub eeprom: bool,
    /// The bus: novobus for the cells of an ND21, unitek for the registers of a UNITEK drive.
    #[arg(long, value_enum, default_value_t = BusName::DEFAULT)]
    pub bus: BusName,
}

impl CellsArguments {
    /// Shows the lines that have the filter in them, each about a `cell`. `kept` says what the EEPROM keeps if it has no cells of its own.
    ///
    /// # Errors
    /// Standard output cannot be written to.
    pub fn show(
        &self,
        lines: impl Iterator<Item = String>,
        (cell, kept): (&str, Option<&str>),
        output: &mut Output,
    ) -> io::Result<Exit> {
        if let Some(kept) = kept.filter(|_| self.eeprom) {
            output.complain(&format!("--eeprom is for the bus novobus; {kept}"));
            return Ok(Exit::Usage);
        }
        let filter = self.filter.as_deref().unwrap_or_default().to_lowercase();
        let lines = lines.map(|line| format!("{}\n", line.trim_end()));
        let wanted: String = lines
            .filter(|line| line.to_lowercase().contains(&filter))
            .collect();
        if wanted.is_empty() {
            let bus = match self.bus {
                BusName::DEFAULT => String::new(),
                bus => format!(" --bus {}", bus.name()),
            };
            output.complain(&format!(
                "no {cell} has this text in it; `drivebench cells{bus}` shows all of them"
            ));
            return Ok(Exit::NothingSelected);
        }
        output.result(&output.fitted(&wanted))?;
        Ok(Exit::Passed)
    }
}

/// For `deviations`.
#[derive(Clone, Debug, Args)]
pub struct DeviationsArguments {
    /// Only deviations with this text in their name, section or description.
    pub filter: Option<String>,
    /// The bus: novobus for ND21 drives, unitek for UNITEK drives.
    #[arg(long, value_enum, default_value_t = BusName::DEFAULT)]
    pub bus: BusName,
    /// Output format.
    #[arg(long, value_enum, default_value_t = TableFormat::Table)]
    pub format: TableFormat,
}

/// The forms of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// A table for people.
    Table,
    /// JSON for tools; the guide describes it.
    Json,
}

/// The forms of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ListFormat {
    /// A line a bench.
    Text,
    /// A list for tools.
    Json,
}

/// When to do something that suits a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ColourWhen {
    /// On a terminal, unless NO_COLOR is set or TERM is `dumb`.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// When to show a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShowProgress {
    /// On a terminal, unless TERM is `dumb`.
    Auto,
    /// Always.
    Bar,
    /// Never.
    None,
}

/// What `--wire-time` of the commands of `fuzz` says of itself.
pub(crate) const WIRE_TIME_HELP: &str =
    "Maximum time on the line, such as 60s; by default one minute on a rig with ports";

/// A time such as `30s`; at most a day.
pub fn duration(text: &str) -> Result<Duration, String> {
    const LONGEST: Duration = Duration::from_secs(24 * 3_600);
    let time: Time = text
        .parse()
        .map_err(|error: ValueError| error.to_string())?;
    if time.0 > LONGEST {
        return Err("at most 24 hours (86400s)".to_owned());
    }
    Ok(time.0)
}
