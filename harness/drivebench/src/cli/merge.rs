//! `drivebench merge`: one folder of evidence of the parts of a run. Parts that are files go to `merge_counts`.

use super::merge_counts::merge_counts;
use super::run_rig::worse;
use super::tally::counts;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::evidence::{Merged, merge as join};
use crate::scenario::verdict::Verdict;
use clap::Args;
use std::path::PathBuf;

/// For `merge`.
#[derive(Clone, Debug, Args)]
pub struct MergeArguments {
    /// The evidence folders of the parts of a run or of a qualification, or the files that `campaign --output` wrote.
    #[arg(value_name = "FOLDER", required = true)]
    pub folders: Vec<PathBuf>,
    /// The folder for the merged evidence, which must be new or empty, and which `verify` checks; or the file for the added counts.
    #[arg(long, short, value_name = "PATH")]
    pub output: PathBuf,
    /// Let a skipped scenario make the run incomplete (exit code 5).
    #[arg(long)]
    pub require_all: bool,
}

/// Merges the folders of parts.
pub(crate) fn merge(arguments: &MergeArguments, output: &mut Output) -> std::io::Result<Exit> {
    if arguments.folders.iter().any(|folder| folder.is_file()) {
        return merge_counts(arguments, output);
    }
    let merged = match join(&arguments.folders, &arguments.output) {
        Ok(merged) => merged,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::of_evidence(&error));
        }
    };
    for (name, verdict) in merged
        .verdicts
        .iter()
        .filter(|case| case.1 != Verdict::Passed)
    {
        output.result(&format!("{} {name}\n", output.verdict(*verdict)))?;
    }
    for why in &merged.missing {
        output.result(&format!("incomplete   {why}\n"))?;
    }
    let verdicts: Vec<_> = merged
        .verdicts
        .iter()
        .map(|(_, verdict)| *verdict)
        .collect();
    let (there, of) = &merged.parts;
    output.result(&format!(
        "{} ({}, {} on the line); {} of {of} parts\n",
        counts(&verdicts),
        counted(verdicts.len(), "scenario"),
        merged.took,
        there.len()
    ))?;
    if let Some((text, _)) = &merged.deviations {
        output.result(text)?;
    }
    output.say(&format!("evidence in {}\n", arguments.output.display()));
    Ok(exit(&merged, &verdicts, arguments.require_all))
}

/// The exit code of the whole run, as `run` and `qualify` have it. A part that is missing leaves a failure a failure, and makes all else incomplete.
fn exit(merged: &Merged, verdicts: &[Verdict], require_all: bool) -> Exit {
    let scenarios = Exit::of(verdicts, require_all);
    let all = match &merged.deviations {
        Some((_, verdict)) => worse(scenarios, Exit::of(&[*verdict], false)),
        None => scenarios,
    };
    match all {
        _ if !merged.safe => Exit::NotSafe,
        Exit::Passed | Exit::Incomplete if merged.named_denied => Exit::Usage,
        Exit::Passed | Exit::NothingSelected if !merged.missing.is_empty() => Exit::Incomplete,
        exit => exit,
    }
}
