//! Options that several commands have.

use crate::bus_name::BusName;
use crate::file::values::{Time, ValueError};
use clap::{Args, ValueEnum};
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
