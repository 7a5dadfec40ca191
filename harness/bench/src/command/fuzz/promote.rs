//! A finding that is kept as a scenario.

use super::tell;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::explore::promote::{Naming, Plays, Promoted, checkout, promote as write};
use crate::explore::{ExploreError, Finding, FuzzCase};
use clap::Args;
use std::path::PathBuf;

/// For `promote`.
#[derive(Clone, Debug, Args)]
pub struct PromoteArguments {
    /// A finding of `fuzz run` or `shrink`: its `.json` or `.scn` file.
    pub finding: PathBuf,
    /// Name of the scenario: section and subject, such as 9.6-checksum-of-a-read.
    #[arg(long, value_name = "NAME")]
    pub name: String,
    /// Title of the scenario.
    #[arg(long, value_name = "TEXT")]
    pub title: Option<String>,
    /// Table of the manual that the scenario tests, as `drivebench manual` names it.
    #[arg(long, value_name = "TABLE")]
    pub source: Option<String>,
    /// A checkout of the repository, or a folder in one; by default the current folder.
    #[arg(long, value_name = "FOLDER")]
    pub checkout: Option<PathBuf>,
}

/// Writes the files.
pub fn keep<C: FuzzCase>(
    arguments: &PromoteArguments,
    played: Plays,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let promoted = match promoted::<C>(arguments, played) {
        Ok(promoted) => promoted,
        Err(error) => return Ok(tell(&error, output)),
    };
    let names = promoted
        .files
        .iter()
        .map(|file| format!("{}\n", file.display()));
    output.result(&names.collect::<String>())?;
    output.say("the model passes it");
    output.say(match promoted.fails_on_deviating {
        Some(true) => ", and the drives with the finding fail it\n",
        Some(false) => {
            ", and so do the drives with the finding: the difference does not reach the master\n"
        }
        None => "\n",
    });
    output.say("compare the table with the print, cell by cell, before you keep it\n");
    Ok(Exit::Passed)
}

fn promoted<C: FuzzCase>(
    arguments: &PromoteArguments,
    played: Plays,
) -> Result<Promoted, ExploreError> {
    let (finding, _) = Finding::<C>::read_as(&arguments.finding)?;
    let here = PathBuf::from(".");
    let from = arguments.checkout.as_ref().unwrap_or(&here);
    let from = from
        .canonicalize()
        .map_err(|error| ExploreError::Usage(format!("{}: {error}", from.display())))?;
    let naming = Naming {
        name: arguments.name.clone(),
        title: arguments.title.clone(),
        source: arguments.source.clone(),
    };
    write(&finding, &naming, (&checkout(&from)?, played))
}
