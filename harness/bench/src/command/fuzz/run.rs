//! A fuzz run: its options, its bounds, and what is said of it.

use super::case::{ExploredCase, settings};
use super::watch::{FindingWriter, summary};
use super::{exit_of_cases, tell};
use crate::command::args::{WIRE_TIME_HELP, duration};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::write;
use crate::command::rig_failure::use_options;
use crate::counted::counted;
use crate::evidence::{can_sign, seal, unseal};
use crate::explore::page::page;
use crate::explore::{
    Bounds, ExploreError, FuzzCase, FuzzRecord, FuzzRun, FuzzSettings, Planted, RunEnd, Target,
    read_as,
};
use crate::partition::Partition;
use crate::rig::{Rig, state};
use clap::Args;
use harness_proto::time::Span;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// The default number of cases on simulated rings.
pub const CASES: u64 = 10_000;

/// The default time on the line, on a rig with ports.
const WIRE: Duration = Duration::from_secs(60);

/// After how many cases the progress is written, on simulated rings.
const EVERY: u64 = 50;

/// For `fuzz run`.
#[derive(Clone, Debug, Args)]
pub struct FuzzRunArguments {
    /// The rig: sim:N, a file, or a name that `rig list` shows.
    #[arg(long, value_name = "RIG", default_value = "sim:3")]
    pub rig: String,
    /// The seed: the same seed gives the same run.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Play one part of the run, slice:M/N or hash:M/N: its share of --cases, with a seed of its own that follows from --seed, M and N.
    #[arg(long, value_name = "PART", conflicts_with = "resume")]
    pub partition: Option<Partition>,
    /// Number of cases; by default 10000 on simulated rings.
    #[arg(long, value_name = "NUMBER")]
    pub cases: Option<u64>,
    #[arg(long, value_name = "TIME", value_parser = duration, help = WIRE_TIME_HELP)]
    pub wire_time: Option<Duration>,
    /// Plant a deviation in a drive of a simulated ring: DRIVE=NAME, or 2:DRIVE=NAME in ring 2. `drivebench deviations` lists the names. May repeat.
    #[arg(long, value_name = "DRIVE=NAME", value_parser = |text: &str| planted(text, |name| Ok(name.to_owned())))]
    pub deviates: Vec<Planted>,
    /// Make the drives of sim:N complete ND21s instead of plain memory. A witness judges each of them by the rules of the manual for the
    /// bus, the cells and the invariants of a drive.
    #[arg(long)]
    pub whole: bool,
    /// Judge a simulated rig as if it were behind a port: only by the bytes that the master receives.
    #[arg(long, conflicts_with = "whole")]
    pub behind_port: bool,
    /// Repetitions K of N in which a difference must be seen again to be a finding, as K/N.
    #[arg(long, value_name = "K/N", default_value = "2/3", value_parser = k_of_n)]
    pub confirm: (u8, u8),
    /// End after this number of findings.
    #[arg(long, value_name = "NUMBER", default_value_t = 5)]
    pub findings: usize,
    /// The folder for the run, which must be new or empty; by default fuzz-RIG-DATE.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Continue the run of this folder with the rig, seed, deviations and confirmation that it began with. Give --cases, --wire-time or
    /// --findings to go beyond a finished run.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["out", "rig", "seed", "deviates", "whole", "confirm"])]
    pub resume: Option<PathBuf>,
    /// Write the report into this file, as one HTML page.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Sign the folder of the run with this `ssh-keygen` key; `verify --allowed-signers` checks the signature.
    #[arg(long, value_name = "KEY")]
    pub sign: Option<PathBuf>,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
}

/// `1=sends-16-zeros`, `2:1=sends-16-zeros`; `named` gives the deviation of a name.
pub fn planted(
    text: &str,
    named: impl FnOnce(&str) -> Result<String, String>,
) -> Result<Planted, String> {
    let form = "a deviation is planted as DRIVE=NAME, such as 1=sends-16-zeros; in ring 2 as 2:1=sends-16-zeros";
    let (drive, name) = text.split_once('=').ok_or(form)?;
    let (ring, drive) = match drive.split_once(':') {
        None => (0, drive),
        Some((ring, drive)) => match ring.trim() {
            "1" => (0, drive),
            "2" => (1, drive),
            _ => return Err(form.to_owned()),
        },
    };
    let drive = drive.trim().parse().map_err(|_| form)?;
    Ok(Planted {
        ring,
        drive,
        name: named(name)?,
    })
}

/// `2/3`.
fn k_of_n(text: &str) -> Result<(u8, u8), String> {
    let wrong = || "K/N is expected, K of N repetitions, such as 2/3; N is at most 100".to_owned();
    let (k, n) = text.split_once('/').ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse::<u8>().map_err(|_| wrong());
    let (k, n) = (number(k)?, number(n)?);
    match (1..=n).contains(&k) && n <= 100 {
        true => Ok((k, n)),
        false => Err(wrong()),
    }
}

/// The bounds of a run on a rig with ports.
fn bounds_on_ports(arguments: &FuzzRunArguments) -> Bounds {
    Bounds {
        cases: arguments.cases.unwrap_or(u64::MAX),
        wire: Some(span(arguments.wire_time.unwrap_or(WIRE))),
        findings: arguments.findings.max(1),
        every: 1,
    }
}

/// The bounds of a run on simulated drives.
fn bounds_of_simulated(arguments: &FuzzRunArguments) -> Bounds {
    Bounds {
        cases: arguments.cases.unwrap_or(match arguments.wire_time {
            Some(_) => u64::MAX,
            None => CASES,
        }),
        wire: arguments.wire_time.map(span),
        findings: arguments.findings.max(1),
        every: EVERY,
    }
}

/// Explores the drives of a rig.
pub(super) fn run<C: ExploredCase>(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let refused = match rig.is_simulated() || arguments.deviates.is_empty() {
        true => C::refused(rig, arguments),
        false => Some("--deviates is for simulated drives; this rig has ports".to_owned()),
    };
    if let Some(why) = refused {
        output.complain(&why);
        return Ok(Exit::Usage);
    }
    let before = match arguments.resume.as_deref().map(read_as::<C>).transpose() {
        Ok(before) => before.map(|(kept, _)| kept.about),
        Err(error) => return Ok(tell(&error, output)),
    };
    let name = before.as_ref().map_or(&arguments.rig, |about| &about.rig);
    let ports = match &before {
        Some(about) => about.ports,
        None => arguments.behind_port || !rig.is_simulated(),
    };
    let drawn = (arguments.seed, arguments.confirm);
    if ports {
        let mut rig = rig.clone();
        C::plant(&mut rig, &arguments.deviates);
        let how = use_options("fuzz", arguments.allow_motion, arguments.wait);
        return C::on_ports(&rig, &how, output, &mut |target, (scope, setup), output| {
            target.end_between_cases();
            output.say(&C::left_out(&rig, arguments.allow_motion));
            let about = settings((name, true), (&scope, setup), drawn);
            let bounds = bounds_on_ports(arguments);
            explore(arguments, (about, scope), target, &bounds, output)
        });
    }
    let setup = match &before {
        Some(about) => about.setup.clone(),
        None => C::setup(rig, Some(arguments)),
    };
    let mut target = match C::simulated(&setup, Some(rig)) {
        Ok(target) => target,
        Err(error) => return Ok(tell(&error, output)),
    };
    let scope = C::scope(rig, &setup, false);
    let about = settings((name, false), (&scope, setup), drawn);
    let bounds = bounds_of_simulated(arguments);
    let exit = explore(arguments, (about, scope), &mut *target, &bounds, output)?;
    if target.undecided() > 0 {
        output.say(&format!(
            "{} not judged: more values of open points than are tried could explain what was seen\n",
            counted(target.undecided(), "case")
        ));
    }
    Ok(exit)
}

/// Begins a run or goes on with one, and tells what came of it.
fn explore<C: FuzzCase>(
    arguments: &FuzzRunArguments,
    (about, scope): (FuzzSettings<C>, C::Scope),
    target: &mut dyn Target<C>,
    bounds: &Bounds,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(Err(error)) = arguments.sign.as_deref().map(can_sign) {
        output.complain(&error.to_string());
        return Ok(Exit::of_evidence(&error));
    }
    let begun = match &arguments.resume {
        Some(folder) => resume(folder, &about, &scope, target),
        None => {
            let stamp = state::utc(SystemTime::now()).replace([':', ' '], "-");
            let name = about.rig.replace(|c: char| !c.is_ascii_alphanumeric(), "-");
            let name = name.trim_matches('-');
            let folder = arguments.out.clone();
            let folder = folder.unwrap_or_else(|| PathBuf::from(format!("fuzz-{name}-{stamp}")));
            FuzzRecord::create(&folder, &about).map(|record| (record, FuzzRun::new(about, scope)))
        }
    };
    let (mut record, mut campaign) = match begun {
        Ok(begun) => begun,
        Err(error) => return Ok(tell(&error, output)),
    };
    let folder = record.folder().to_owned();
    if let Err(error) = unseal(&folder) {
        output.complain(&error.to_string());
        return Ok(Exit::of_evidence(&error));
    }
    let mut telling = FindingWriter {
        output,
        folder: Some(folder.clone()),
        rounds: true,
        told: None,
        failed: None,
    };
    let played_before = campaign.progress().cases;
    let end = campaign.run(target, Some(&mut record), bounds, &mut telling);
    let failed = telling.failed.take();
    let end = match end {
        Ok(end) => end,
        Err(error) => {
            let exit = tell(&error, output);
            output.say(&format!(
                "what was done so far is in {}; go on: drivebench fuzz run --resume {}\n",
                folder.display(),
                folder.display()
            ));
            return Ok(exit);
        }
    };
    if let Some(error) = failed {
        return Err(error);
    }
    output.result(&summary(&campaign, &end))?;
    if arguments.resume.is_some() && campaign.progress().cases == played_before {
        output.say(&beyond(&end, bounds));
    }
    output.say(&format!("the run is in {}\n", folder.display()));
    // A run that could not go on has no sums, like one that was killed. That the key can sign was tried before anything was played.
    let sealed = match end {
        RunEnd::Over(_) if arguments.sign.is_none() => Ok(()),
        _ => seal(&folder, arguments.sign.as_deref()),
    };
    if let Err(error) = sealed {
        output.complain(&error.to_string());
        return Ok(exit_of_cases(&campaign).with_rig_error());
    }
    if let Some(path) = &arguments.html {
        match page::<C>(&folder) {
            Ok(text) if !write(path, &text, output) => return Ok(Exit::RigError),
            Ok(_) => {}
            Err(error) => return Ok(tell(&error, output)),
        }
    }
    Ok(exit_of_cases(&campaign))
}

/// Why a run that was resumed played nothing, and how to go on.
fn beyond(end: &RunEnd, bounds: &Bounds) -> String {
    let remedy = match end {
        RunEnd::Cases => format!(
            "the run has {} already; give --cases with more",
            counted(bounds.cases, "case")
        ),
        RunEnd::Findings => format!(
            "the run has {} already; give --findings with more",
            counted(bounds.findings, "finding")
        ),
        RunEnd::Wire => "its time on the line is used up; give --wire-time with more".to_owned(),
        RunEnd::Over(why) => why.clone(),
    };
    format!("nothing was played: {remedy}\n")
}

fn resume<C: FuzzCase>(
    folder: &std::path::Path,
    about: &FuzzSettings<C>,
    scope: &C::Scope,
    target: &mut dyn Target<C>,
) -> Result<(FuzzRecord, FuzzRun<C>), ExploreError> {
    let (record, kept) = FuzzRecord::resume(folder)?;
    let is = |about: &FuzzSettings<C>| (about.drives, about.second, about.spices.clone());
    if is(&kept.about) != is(about) {
        return Err(ExploreError::Usage(format!(
            "the rig {} is another one than when the run in {} began: other drives, or other leave; begin another run",
            kept.about.rig,
            folder.display()
        )));
    }
    let campaign = FuzzRun::resumed(&kept, scope.clone(), target)?;
    Ok((record, campaign))
}

/// A time on the line.
fn span(time: Duration) -> Span {
    Span::from_nanos(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX))
}
