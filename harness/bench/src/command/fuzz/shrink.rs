//! A finding made small: its options, and the file beside it.

use super::tell;
use crate::command::args::duration;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::explore::{ExploreError, Finding, FuzzCase};
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The default limit of tries on a simulated ring.
pub const RUNS: u32 = 300;

/// The default limit of tries on a rig with ports.
pub const RUNS_ON_RIG: u32 = 40;

/// For `shrink`.
#[derive(Clone, Debug, Args)]
pub struct ShrinkArguments {
    /// A finding of `fuzz run`: its `.json` or `.scn` file.
    pub finding: PathBuf,
    /// The rig with ports on which the finding was made; a finding of simulated drives needs none.
    #[arg(long, value_name = "RIG")]
    pub rig: Option<String>,
    /// Maximum number of runs; by default 300 on simulated drives, 40 on a rig with ports.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub runs: Option<u32>,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
}

/// Writes a finding that was made small beside the old one, and shows it.
pub fn write_smaller<C: FuzzCase>(
    new: &Finding<C>,
    path: &Path,
    became: &str,
    (runs, complete): (u32, bool),
    output: &mut Output,
) -> std::io::Result<Exit> {
    let stem = path
        .file_stem()
        .and_then(|stem| stem.to_str())
        .unwrap_or("finding");
    let stem = stem.trim_end_matches("-small");
    let folder = path.parent().unwrap_or(Path::new(""));
    let written = new.write(folder, &format!("{stem}-small"));
    let text = written.and_then(|files| {
        let text = std::fs::read_to_string(&files[1])
            .map_err(|error| ExploreError::File(format!("{}: {error}", files[1].display())))?;
        Ok((files, text))
    });
    let (files, text) = match text {
        Ok(done) => done,
        Err(error) => return Ok(tell(&error, output)),
    };
    output.result(&text)?;
    let end = match complete {
        true => "nothing more can be taken away",
        false => "the runs are used up; --runs allows more",
    };
    output.say(&format!(
        "{became} in {}; {end}\n{}\ndrivebench promote {} --name NAME\n",
        counted(runs, "run"),
        files[1].display(),
        files[0].display()
    ));
    Ok(Exit::Passed)
}
