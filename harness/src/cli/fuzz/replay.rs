//! `drivebench fuzz replay`: a minute on hardware.

use super::exit_of_cases;
use super::rig::{on_ports, rings, scope, simulated, sizes, tell};
use super::watch::{Telling, summary};
use crate::buses::line_fuzz;
use crate::cli::args::{WIRE_TIME_HELP, duration};
use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::cli::rig_failure::find_any_rig;
use crate::counted::counted;
use crate::explore::{
    Act, ActKind, Bounds, Case, ExploreError, FuzzCase, FuzzRun, FuzzSettings, LogLine, MOST_BYTES,
    OnRig, OnSim, RingSetup, Target, by_novelty, read_as,
};
use crate::guard::Limits;
use crate::regular::{self, Links};
use crate::rig::{Rig, UseOptions};
use clap::Args;
use harness_proto::time::Span;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The most cases that are taken of a folder.
const MOST_CASES: usize = 5_000;

/// The largest file of a corpus.
const LARGEST: u64 = 64 * 1024;

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

/// Replays.
pub(crate) fn replay(arguments: &ReplayArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(rig) = find_any_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    if let Some(own) = rig.port().and_then(|port| line_fuzz(port.bus.bus())) {
        return (own.replay)(&rig, arguments, output);
    }
    let cases = match cases(&arguments.folder, &rig) {
        Ok(cases) => cases,
        Err(error) => return Ok(tell(&error, output)),
    };
    if cases.is_empty() {
        let sizes: Vec<_> = sizes(&rig).iter().map(u8::to_string).collect();
        output.complain(&format!(
            "{} holds no case for a ring of {}",
            arguments.folder.display(),
            sizes.join(" or of ")
        ));
        return Ok(Exit::NothingSelected);
    }
    if rig.is_simulated() {
        let setup = RingSetup::of_rig(&rig, &[], false);
        let mut target = match OnSim::ready(setup.clone(), &sizes(&rig)) {
            Ok(target) => target,
            Err(error) => return Ok(tell(&error, output)),
        };
        let scope = simulated(&rig, Limits::unlimited(), &setup);
        let campaign = campaign(arguments, &rig, setup, scope);
        return play(arguments, campaign, cases, &mut target, output);
    }
    let options = UseOptions {
        purpose: "fuzz replay".to_owned(),
        allow_motion: arguments.allow_motion,
        wait: arguments.wait.unwrap_or_default(),
        ..UseOptions::default()
    };
    on_ports(&rig, options, output, |run, output| {
        let scope = scope(run);
        let limits = scope.limits;
        let campaign = campaign(
            arguments,
            &rig,
            RingSetup::of_ports(rig.rings().count()),
            scope,
        );
        match OnRig::new(run, limits) {
            Ok(mut target) => play(arguments, campaign, cases, &mut target, output),
            Err(error) => Ok(tell(&error, output)),
        }
    })
}

fn campaign(
    arguments: &ReplayArguments,
    rig: &Rig,
    setup: RingSetup,
    scope: crate::explore::CaseScope,
) -> FuzzRun {
    let about = FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: arguments.rig.clone(),
        drives: scope.first.drives,
        second: scope.second.as_ref().map(|ring| ring.drives),
        ports: !rig.is_simulated(),
        seed: 0,
        confirm: 2,
        of: 3,
        setup,
        spices: Vec::new(),
    };
    FuzzRun::new(about, scope)
}

/// Plays cases, the most telling first.
pub(super) fn play<C: FuzzCase>(
    arguments: &ReplayArguments,
    mut campaign: FuzzRun<C>,
    cases: Vec<C>,
    target: &mut dyn Target<C>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let count = cases.len();
    let mut allowed = Vec::new();
    let mut denied = 0;
    for case in cases {
        match target.rehearse(&case) {
            Ok(rehearsal) if rehearsal.denied.is_none() => allowed.push((case, rehearsal.features)),
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
    let mut telling = Telling {
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
pub(super) fn kept<C: FuzzCase>(folder: &Path) -> Result<Vec<C>, ExploreError> {
    let lines = read_as::<C>(folder)?.0.lines.into_iter();
    let kept = lines.filter_map(|line| match line {
        LogLine::Kept { case, .. } => Some(case),
        _ => None,
    });
    Ok(kept.take(MOST_CASES).collect())
}

/// The cases of a folder, each on every ring of the rig that has as many drives.
fn cases(folder: &Path, rig: &Rig) -> Result<Vec<Case>, ExploreError> {
    let (first, second) = rings(rig, |_, _| true);
    let places: Vec<_> = std::iter::once(first).chain(second).collect();
    if folder.join(crate::explore::RECORD).exists() {
        let placed = kept::<Case>(folder)?.into_iter().flat_map(|case| {
            let fit = places.iter().filter(move |own| own.drives == case.drives);
            fit.map(move |own| own.case(case.acts.clone()))
        });
        return Ok(placed.take(MOST_CASES).collect());
    }
    let unreadable = |error: std::io::Error| {
        ExploreError::File(format!("failed to read {}: {error}", folder.display()))
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)
        .map_err(unreadable)?
        .take(MOST_CASES)
    {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|ending| ending == "hex") {
            files.push(path);
        }
    }
    files.sort();
    let mut cases = Vec::new();
    for path in &files {
        let acts = of_hex(path)?;
        cases.extend(places.iter().map(|own| own.case(acts.clone())));
    }
    Ok(cases)
}

/// A file of corpora/fuzz/ring: two bytes that say what is damaged, and the bytes of the wire. The bytes alone are a case: what they
/// damage lies on links that a rig does not reach.
fn of_hex(path: &Path) -> Result<Vec<Act>, ExploreError> {
    let wrong = |why: &str| ExploreError::File(format!("{}: {why}", path.display()));
    let read = regular::read(path, Links::Follow, LARGEST);
    let text = read.and_then(|bytes| String::from_utf8(bytes).map_err(std::io::Error::other));
    let text = text.map_err(|error| wrong(&error.to_string()))?;
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default());
    let words: Vec<_> = lines.flat_map(str::split_whitespace).collect();
    let bytes = words
        .iter()
        .map(|word| u8::from_str_radix(word, 16))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|_| wrong("bytes are two hexadecimal digits each"))?;
    let wire = bytes.get(2..).unwrap_or_default().to_vec();
    match wire.len() <= MOST_BYTES {
        true => Ok(vec![Act::sound(ActKind::Bytes(wire))]),
        false => Err(wrong("more bytes than a case has")),
    }
}
