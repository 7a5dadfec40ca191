//! Cases that a run has kept, played again.

use super::case::{ExploredCase, settings};
use super::watch::{FindingWriter, summary};
use super::{exit_of_cases, tell};
use crate::command::args::{WIRE_TIME_HELP, duration};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::use_options;
use crate::counted::counted;
use crate::explore::{
    Bounds, ExploreError, FuzzCase, FuzzRun, LogLine, Target, by_novelty, read_as,
};
use crate::rig::Rig;
use clap::Args;
use harness_proto::time::Span;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The most cases that are taken of a folder.
pub const MOST_CASES: usize = 5_000;

/// For `fuzz replay`.
#[derive(Clone, Debug, Args)]
pub struct ReplayArguments {
    /// A folder of `fuzz run`, or a corpus of `.hex` files such as corpora/fuzz/ring.
    pub folder: PathBuf,
    /// The rig: sim:N, a file, or a name that `rig list` shows.
    #[arg(long, value_name = "RIG")]
    pub rig: String,
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "60s", help = WIRE_TIME_HELP)]
    pub wire_time: Duration,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
}

/// Plays again what a run has kept.
pub(super) fn replay<C: ExploredCase>(
    rig: &Rig,
    arguments: &ReplayArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let cases = match C::kept(&arguments.folder, rig) {
        Ok(cases) => cases,
        Err(error) => return Ok(tell(&error, output)),
    };
    if cases.is_empty() {
        let folder = arguments.folder.display();
        output.complain(&format!("{folder} holds no {}", C::missing(rig)));
        return Ok(Exit::NothingSelected);
    }
    let begun = |ports, (scope, setup): (C::Scope, C::Setup)| {
        let about = settings((&arguments.rig, ports), (&scope, setup), (0, (2, 3)));
        FuzzRun::new(about, scope)
    };
    if !rig.is_simulated() {
        let how = use_options("fuzz replay", arguments.allow_motion, arguments.wait);
        return C::on_ports(rig, &how, output, &mut |target, scope, output| {
            play(arguments, begun(true, scope), &cases, target, output)
        });
    }
    let setup = C::setup(rig, None);
    match C::simulated(&setup, Some(rig)) {
        Ok(mut target) => {
            let scope = C::scope(rig, &setup, true);
            let run = begun(false, (scope, setup));
            play(arguments, run, &cases, &mut *target, output)
        }
        Err(error) => Ok(tell(&error, output)),
    }
}

/// Plays cases, the most telling first.
fn play<C: FuzzCase>(
    arguments: &ReplayArguments,
    mut campaign: FuzzRun<C>,
    cases: &[C],
    target: &mut dyn Target<C>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let count = cases.len();
    let mut allowed = Vec::new();
    let mut denied = 0;
    for case in cases {
        match target.rehearse(case) {
            Ok(rehearsal) if rehearsal.denied.is_none() => {
                allowed.push((case.clone(), rehearsal.features))
            }
            Ok(_) => denied += 1,
            Err(error) => return Ok(tell(&error, output)),
        }
    }
    let ordered = by_novelty(allowed);
    output.say(&format!(
        "{}, {denied} not allowed or not possible here, {} kept to be played: those that reach something new\n",
        counted(count, "case"),
        ordered.len()
    ));
    let bounds = Bounds {
        cases: u64::MAX,
        wire: Some(Span::from_nanos(
            u64::try_from(arguments.wire_time.as_nanos()).unwrap_or(u64::MAX),
        )),
        findings: usize::MAX,
        every: 1,
    };
    let mut telling = FindingWriter {
        output,
        folder: None,
        rounds: false,
        told: None,
        failed: None,
    };
    let end = campaign.replay(&ordered, target, None, &bounds, &mut telling);
    if let Some(error) = telling.failed.take() {
        return Err(error);
    }
    let end = match end {
        Ok(end) => end,
        Err(error) => return Ok(tell(&error, output)),
    };
    output.result(&summary(&campaign, &end))?;
    Ok(exit_of_cases(&campaign))
}

/// The cases that a run has kept in its folder.
pub fn kept<C: FuzzCase>(folder: &Path) -> Result<Vec<C>, ExploreError> {
    let lines = read_as::<C>(folder)?.0.lines.into_iter();
    let kept = lines.filter_map(|line| match line {
        LogLine::Kept { case, .. } => Some(case),
        _ => None,
    });
    Ok(kept.take(MOST_CASES).collect())
}
