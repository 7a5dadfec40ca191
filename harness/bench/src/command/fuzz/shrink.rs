//! A finding made small: its options, and the file beside it.

use super::case::ExploredCase;
use super::tell;
use crate::command::args::duration;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::{find_any_rig, use_options};
use crate::counted::counted;
use crate::explore::smaller::{ShrinkOutcome, Subject, asked, shrink as smaller};
use crate::explore::{Differing as _, ExploreError, Finding, Target};
use crate::rig::buses::RigBuses;
use clap::Args;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The default limit of tries on a simulated ring.
const RUNS: u32 = 300;

/// The default limit of tries on a rig with ports.
const RUNS_ON_RIG: u32 = 40;

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

/// How often a finding is tried before it is made small on a rig.
const TRIES: u8 = 3;

/// Makes a finding small, and writes what came of it beside it.
pub(super) fn shrink<C: ExploredCase>(
    arguments: &ShrinkArguments,
    buses: &'static RigBuses,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (finding, path) = match Finding::<C>::read_as(&arguments.finding) {
        Ok(read) => read,
        Err(error) => return Ok(tell(&error, output)),
    };
    let refused = |why: String, output: &mut Output| {
        output.complain(&why);
        Ok(Exit::Usage)
    };
    match (finding.ports, &arguments.rig) {
        (false, None) => {
            let most = arguments.runs.unwrap_or(RUNS);
            // A mistake in what its drives are made of is told before anything is tried.
            let small = C::simulated(&finding.setup, None).and_then(|_| {
                let difference = finding.difference.clone();
                smaller(finding.subject(), difference, most, &mut on_simulated)
            });
            match small {
                Ok(small) => write_smaller(&finding, &path, small, output),
                Err(error) => Ok(tell(&error, output)),
            }
        }
        (false, Some(_)) => {
            let why =
                "this finding was made on simulated drives: it is made small there, without --rig";
            refused(why.to_owned(), output)
        }
        (true, None) => {
            let rig = &finding.rig;
            let why = format!(
                "this finding was made behind the ports of the rig {rig}: name it with --rig"
            );
            refused(why, output)
        }
        (true, Some(name)) => {
            let Some(rig) = find_any_rig(name, buses, output) else {
                return Ok(Exit::Usage);
            };
            if let Some(why) = C::is_of_another(&finding, &rig) {
                let why = format!("the finding is of {why}, and {name} is another rig");
                return refused(why, output);
            }
            let most = arguments.runs.unwrap_or(RUNS_ON_RIG);
            let how = use_options("shrink", arguments.allow_motion, arguments.wait);
            let first = on_suspects(&finding, output);
            C::on_ports(&rig, &how, output, &mut |target, _, output| {
                let small = on_rig(&finding, first.clone(), most, target);
                match small {
                    Ok(Some(small)) => write_smaller(&finding, &path, small, output),
                    Ok(None) => {
                        output.complain(&format!(
                            "the drives of {name} do not show this difference in {TRIES} attempts, so it is not made small; is this the rig of the finding?"
                        ));
                        Ok(Exit::Incomplete)
                    }
                    Err(error) => Ok(tell(&error, output)),
                }
            })
        }
    }
}

/// Asks simulated drives. Those of a smaller conversation may not be what the header speaks of.
fn on_simulated<C: ExploredCase>(
    subject: &Subject<C>,
) -> Result<Option<C::Difference>, ExploreError> {
    let mut target = C::simulated(&subject.setup, None)?;
    Ok(asked(subject, &mut *target).unwrap_or(None))
}

/// What a finding of a rig becomes on simulated drives that show the same: runs that cost nothing. The rig decides about it.
fn on_suspects<C: ExploredCase>(finding: &Finding<C>, output: &mut Output) -> Option<Subject<C>> {
    for (words, suspect) in C::suspects(finding) {
        let found = on_simulated(&suspect).ok().flatten();
        let Some(difference) = found.filter(|found| found.is_like(&finding.difference)) else {
            continue;
        };
        let mut ask = |subject: &Subject<C>| match subject.case.has_drives_of(&finding.case) {
            true => on_simulated(subject),
            false => Ok(None),
        };
        let small = smaller(suspect, difference, RUNS, &mut ask).ok()?;
        output.say(&format!(
            "{words} shows the same on the simulator: made small there first, in {}\n",
            counted(small.runs, "run")
        ));
        return Some(Subject {
            case: small.subject.case,
            setup: finding.setup.clone(),
        });
    }
    None
}

/// Makes a finding small on the rig that it was made on; `None` if its drives do not show it.
///
/// # Errors
/// The rig is lost, or was stopped before they have shown it.
fn on_rig<C: ExploredCase>(
    finding: &Finding<C>,
    first: Option<Subject<C>>,
    most: u32,
    target: &mut dyn Target<C>,
) -> Result<Option<ShrinkOutcome<C>>, ExploreError> {
    let mut ended = false;
    let mut ask = |subject: &Subject<C>| {
        ended |= target.over().is_some();
        match !ended && subject.case.has_drives_of(&finding.case) {
            true => asked(subject, target),
            false => Ok(None),
        }
    };
    let tried = first.map(|first| (first, 1)).into_iter();
    for (subject, tries) in tried.chain([(finding.subject(), TRIES)]) {
        for _ in 0..tries {
            let found = ask(&subject)?;
            if let Some(difference) = found.filter(|found| found.is_like(&finding.difference)) {
                let mut small = smaller(subject, difference, most, &mut ask)?;
                small.complete &= !ended;
                return Ok(Some(small));
            }
        }
    }
    match target.over() {
        Some(why) => Err(ExploreError::Lost(why)),
        None => Ok(None),
    }
}

/// Writes a finding that was made small beside the old one, and shows it.
fn write_smaller<C: ExploredCase>(
    finding: &Finding<C>,
    path: &Path,
    small: ShrinkOutcome<C>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (before, unit) = finding.case.size();
    let (after, _) = small.subject.case.size();
    let (runs, complete) = (small.runs, small.complete);
    let new = finding.shrunk(small);
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
        "{} became {after} in {}; {end}\n{}\ndrivebench promote {} --name NAME\n",
        counted(before, unit),
        counted(runs, "run"),
        files[1].display(),
        files[0].display()
    ));
    Ok(Exit::Passed)
}
