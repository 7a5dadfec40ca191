//! Exploring drives of a shared line: `fuzz run`, `fuzz replay`, `shrink` and `promote`.

use super::replay::{ReplayArguments, kept, play};
use super::run::{FuzzRunArguments, bounds_of_simulated, bounds_on_ports, explore};
use super::{FuzzCommands, tell, verify_as};
use crate::command::exit::Exit;
use crate::command::fuzz::promote::keep;
use crate::command::fuzz::shrink::{RUNS, RUNS_ON_RIG, ShrinkArguments, write_smaller};
use crate::command::output::Output;
use crate::command::rig_failure::{exit_of, exit_of_end, find_any_rig, tell_end, use_options};
use crate::counted::counted;
use crate::explore::line::{LineRig, LineScope, LineSetup, LineTalk, OnAdapter, OnLine, SessionOf};
use crate::explore::smaller::{Smaller, smaller};
use crate::explore::{
    Differing as _, ExploreError, Finding, FuzzRun, FuzzSettings, KeptRun, Planted, Spiced, Target,
    read_as,
};
use crate::link::Line as _;
use crate::rig::buses::RigBuses;
use crate::rig::{Rig, UseOptions};
use std::collections::BTreeMap;

/// How often a finding is tried before it is made small on a rig.
const TRIES: u8 = 3;

impl FuzzCommands {
    /// The commands on a bus whose stations share one line.
    pub const fn of_line<B: LineRig>() -> Self {
        Self {
            run: run::<B>,
            replay: replay::<B>,
            shrink: shrink::<B>,
            promote: keep::<LineTalk<B>>,
            verify: verify_as::<LineTalk<B>>,
            power: None,
            page: None,
        }
    }
}

/// The settings of a run.
fn settings<B: LineRig>(
    (rig, ports): (&str, bool),
    (scope, setup): (&LineScope<B>, LineSetup),
    (seed, (confirm, of)): (u64, (u8, u8)),
) -> FuzzSettings<LineTalk<B>> {
    FuzzSettings {
        schema: FuzzSettings::<LineTalk<B>>::SCHEMA,
        rig: rig.to_owned(),
        drives: u8::try_from(scope.drives.len()).unwrap_or(u8::MAX),
        second: None,
        ports,
        seed,
        confirm,
        of,
        setup,
        spices: scope
            .spices
            .iter()
            .map(|spice| spice.name().to_owned())
            .collect(),
    }
}

/// Explores the drives of a rig.
fn run<B: LineRig>(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(why) = refused::<B>(rig, arguments) {
        output.complain(&why);
        return Ok(Exit::Usage);
    }
    let before: Option<KeptRun<LineTalk<B>>> =
        match arguments.resume.as_deref().map(read_as).transpose() {
            Ok(before) => before.map(|(kept, _)| kept),
            Err(error) => return Ok(tell(&error, output)),
        };
    let name = before
        .as_ref()
        .map_or(&arguments.rig, |kept| &kept.about.rig)
        .clone();
    let ports = match &before {
        Some(kept) => kept.about.ports,
        None => arguments.behind_port || !rig.is_simulated(),
    };
    let planted = arguments.deviates.clone();
    let run = (arguments.seed, arguments.confirm);
    if ports {
        let mut rig = rig.clone();
        if let Some(sim) = &mut rig.file.sim {
            sim.setup.extend(planted.iter().map(Planted::line::<B>));
        }
        let how = use_options("fuzz", arguments.allow_motion, arguments.wait);
        return on_adapter::<B>(&rig, &how, output, |target, (scope, setup), output| {
            target.end_between_cases();
            output.say(&left_out::<B>(&rig, arguments.allow_motion));
            let about = settings((&name, true), (&scope, setup), run);
            let bounds = bounds_on_ports(arguments);
            explore(arguments, (about, scope), target, &bounds, output)
        });
    }
    let scope = simulated::<B>(rig);
    let setup = match before {
        Some(kept) => kept.about.setup,
        None => LineSetup::of_rig::<B>(rig, &scope.drives, planted),
    };
    let mut target = match setup.under_test::<B>() {
        Ok(drives) => OnLine::<B>::new(drives),
        Err(error) => return Ok(tell(&error, output)),
    };
    let about = settings((&name, false), (&scope, setup), run);
    let bounds = bounds_of_simulated(arguments);
    let exit = explore(arguments, (about, scope), &mut target, &bounds, output)?;
    if target.undecided() > 0 {
        output.say(&format!(
            "{} not judged: more values of open points than are tried could explain what was seen\n",
            counted(target.undecided(), "case")
        ));
    }
    Ok(exit)
}

/// What conversations on a rig do not have, with the limit that would permit it; nothing where they have everything.
fn left_out<B: LineRig>(rig: &Rig, allow_motion: bool) -> String {
    let mut left: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (name, spice) in B::Spice::ALL {
        if let Some(why) = B::lacks(rig, allow_motion, *spice) {
            left.entry(why).or_default().push(name);
        }
    }
    let each = left
        .iter()
        .map(|(why, names)| format!("{} ({why})", names.join(", ")));
    let each: Vec<_> = each.collect();
    match each.is_empty() {
        true => String::new(),
        false => format!("not in the conversations: {}\n", each.join("; ")),
    }
}

/// What conversations with simulated drives may have: everything.
fn simulated<B: LineRig>(rig: &Rig) -> LineScope<B> {
    LineScope {
        drives: B::stations(rig, None),
        spices: B::Spice::ALL.iter().map(|(_, spice)| *spice).collect(),
    }
}

/// Works on the drives of a rig behind an adapter, and gives the rig back in its safe state.
fn on_adapter<B: LineRig>(
    rig: &Rig,
    options: &UseOptions,
    output: &mut Output,
    work: impl FnOnce(
        &mut OnAdapter<'_, B>,
        (LineScope<B>, LineSetup),
        &mut Output,
    ) -> std::io::Result<Exit>,
) -> std::io::Result<Exit> {
    let mut session = match SessionOf::<B>::open(rig, options) {
        Ok(session) => session,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    let all = B::Spice::ALL.iter().map(|(_, spice)| *spice);
    let scope = LineScope::<B> {
        drives: B::stations(rig, Some(&session)),
        spices: all
            .filter(|spice| B::lacks(rig, options.allow_motion, *spice).is_none())
            .collect(),
    };
    let mut setup = LineSetup::of_rig::<B>(rig, &scope.drives, Vec::new());
    // What they are, only the drives themselves show.
    setup.deviates.clear();
    let target = setup
        .under_test::<B>()
        .and_then(|model| OnAdapter::<B>::new(&mut session, model));
    let worked = match target {
        Ok(mut target) => {
            let exit = work(&mut target, (scope, setup), output);
            for remark in target.restore() {
                output.complain(&remark);
            }
            exit
        }
        Err(error) => Ok(tell(&error, output)),
    };
    let exit = worked.unwrap_or_else(|error| output.unwritable(&error));
    session.end_if_overdue();
    let exit = exit_of_end(session.link().trouble(), exit, output);
    let end = session.close(matches!(exit, Exit::RigError | Exit::Interlock));
    Ok(tell_end(&end, exit, output))
}

/// Why a run is not possible.
fn refused<B: LineRig>(rig: &Rig, arguments: &FuzzRunArguments) -> Option<String> {
    let (drives, bus) = (B::DRIVES, B::BUS.name());
    if !rig.is_simulated() && !arguments.deviates.is_empty() {
        return Some("--deviates is for simulated drives; this rig has an adapter".to_owned());
    }
    if arguments.whole {
        return Some(format!("--whole is for rings; leave it out for {drives}"));
    }
    if arguments.html.is_some() {
        return Some(
            "--html is for runs on rings; the findings of this run are scenarios: `drivebench run --html` shows them"
                .to_owned(),
        );
    }
    let mut planted = arguments.deviates.iter();
    let second = planted.any(|drive| drive.ring != 0);
    second.then(|| {
        format!(
            "a deviation of {drives} is planted as NUMBER=NAME; `drivebench deviations --bus {bus}` lists the names"
        )
    })
}

/// Makes a finding small, and writes what came of it beside it.
fn shrink<B: LineRig>(
    arguments: &ShrinkArguments,
    buses: &'static RigBuses,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (finding, file) = match Finding::<LineTalk<B>>::read_as(&arguments.finding) {
        Ok(read) => read,
        Err(error) => return Ok(tell(&error, output)),
    };
    let told = |small: Result<Smaller<LineTalk<B>>, ExploreError>, output: &mut Output| {
        let small = match small {
            Ok(small) => small,
            Err(error) => return Ok(tell(&error, output)),
        };
        let (before, after) = (finding.case.acts.len(), small.finding.case.acts.len());
        let became = format!("{} became {after}", counted(before, "act"));
        let runs = (small.finding.shrunk_in.unwrap_or(0), small.complete);
        write_smaller(&small.finding, &file, &became, runs, output)
    };
    match (finding.ports, &arguments.rig) {
        (false, None) => {
            let most = arguments.runs.unwrap_or(RUNS);
            let drives = finding.setup.under_test::<B>();
            let target = drives.map(OnLine::<B>::new);
            let small = target.and_then(|mut target| smaller(&finding, &mut target, most));
            told(small, output)
        }
        (false, Some(_)) => {
            output.complain(
                "this finding was made on simulated drives: it is made small there, without --rig",
            );
            Ok(Exit::Usage)
        }
        (true, None) => {
            output.complain(&format!(
                "this finding was made on the rig {}, behind an adapter: name it with --rig",
                finding.rig
            ));
            Ok(Exit::Usage)
        }
        (true, Some(name)) => {
            let Some(rig) = find_any_rig(name, buses, output) else {
                return Ok(Exit::Usage);
            };
            if rig.port().map(|port| port.bus.bus()) != Some(B::BUS) {
                output.complain(&format!(
                    "the finding is of {}, and {name} is a rig of other drives",
                    B::DRIVES
                ));
                return Ok(Exit::Usage);
            }
            let most = arguments.runs.unwrap_or(RUNS_ON_RIG);
            let how = use_options("shrink", arguments.allow_motion, arguments.wait);
            on_adapter::<B>(&rig, &how, output, |target, _, output| {
                match is_shown(&finding, target) {
                    Ok(true) => told(smaller(&finding, target, most), output),
                    Ok(false) => {
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

/// Whether the drives under test still differ as a finding says.
fn is_shown<B: LineRig>(
    finding: &Finding<LineTalk<B>>,
    target: &mut dyn Target<LineTalk<B>>,
) -> Result<bool, ExploreError> {
    let rehearsal = target.rehearse(&finding.case)?;
    for _ in 0..TRIES {
        if rehearsal.denied.is_some() || target.over().is_some() {
            return Ok(false);
        }
        target.begin();
        let found = target.attempt(&finding.case, &rehearsal)?.difference;
        if found.is_some_and(|difference| difference.is_like(&finding.difference)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Plays again what a run has kept.
fn replay<B: LineRig>(
    rig: &Rig,
    arguments: &ReplayArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let cases = match kept::<LineTalk<B>>(&arguments.folder) {
        Ok(cases) => cases,
        Err(error) => return Ok(tell(&error, output)),
    };
    if cases.is_empty() {
        let folder = arguments.folder.display();
        output.complain(&format!("{folder} holds no case of {}", B::DRIVES));
        return Ok(Exit::NothingSelected);
    }
    let begin = |ports, (scope, setup): (LineScope<B>, LineSetup)| {
        let about = settings((&arguments.rig, ports), (&scope, setup), (0, (2, 3)));
        FuzzRun::new(about, scope)
    };
    if !rig.is_simulated() {
        let how = use_options("fuzz replay", arguments.allow_motion, arguments.wait);
        return on_adapter::<B>(rig, &how, output, |target, scope, output| {
            play(arguments, begin(true, scope), cases, target, output)
        });
    }
    let scope = simulated::<B>(rig);
    let setup = LineSetup::of_rig::<B>(rig, &scope.drives, Vec::new());
    match setup.under_test::<B>() {
        Ok(drives) => {
            let target: &mut dyn Target<_> = &mut OnLine::<B>::new(drives);
            play(
                arguments,
                begin(false, (scope, setup)),
                cases,
                target,
                output,
            )
        }
        Err(error) => Ok(tell(&error, output)),
    }
}
