//! `drivebench fuzz run` and `shrink` on UNITEK drives.

use crate::buses::unitek::explore::{FrameSpice, FrameTalk, OnAdapter};
use crate::buses::unitek::language::Unitek;
use crate::buses::unitek::rig::{Session, axes, limits};
use crate::buses::unitek::simulate::Setup;
use crate::cli::exit::Exit;
use crate::cli::fuzz::{FuzzRunArguments, bounds_of_simulated, bounds_on_ports, explore, tell};
use crate::cli::output::Output;
use crate::cli::rig_failure::{alarm, exit_of, tell_end};
use crate::cli::shrink::write_smaller;
use crate::counted::counted;
use crate::explore::line::{LineScope, LineSetup, OnLine, PlantedDrive};
use crate::explore::smaller::smaller;
use crate::explore::{ExploreError, Finding, FuzzSettings, KeptRun, Spiced as _, read_as};
use crate::link::{Line as _, Trouble};
use crate::rig::{Options, Rig};
use crate::signals::interrupt_flag;
use std::path::Path;

/// Explores the drives of a rig.
pub(crate) fn run(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(why) = refused(rig, arguments) {
        output.complain(why);
        return Ok(Exit::Usage);
    }
    let before: Option<KeptRun<FrameTalk>> = match &arguments.resume {
        Some(folder) => match read_as(folder) {
            Ok((kept, _)) => Some(kept),
            Err(error) => return Ok(tell(&error, output)),
        },
        None => None,
    };
    let planted = arguments.deviates.iter().map(|own| PlantedDrive {
        drive: own.drive,
        name: own.name.clone(),
    });
    let name = before.as_ref().map(|kept| kept.about.rig.clone());
    let setup = match before {
        Some(kept) => kept.about.setup,
        None => LineSetup::of_rig::<Unitek>(rig, planted.collect()),
    };
    let ports = !rig.is_simulated();
    let drives = rig.port().map(axes).unwrap_or_default();
    let scope = LineScope::<Unitek> {
        drives: drives.iter().map(|own| (own.node, own.rx)).collect(),
        spices: spices(rig, arguments),
    };
    let about = FuzzSettings {
        schema: FuzzSettings::<FrameTalk>::SCHEMA,
        rig: name.unwrap_or_else(|| arguments.rig.clone()),
        drives: u8::try_from(scope.drives.len()).unwrap_or(u8::MAX),
        second: None,
        ports,
        seed: arguments.seed,
        confirm: arguments.confirm.0,
        of: arguments.confirm.1,
        setup,
        spices: scope
            .spices
            .iter()
            .map(|own| own.name().to_owned())
            .collect(),
    };
    let simulated = match setup_of(&about) {
        Ok(simulated) => simulated,
        Err(error) => return Ok(tell(&error, output)),
    };
    if ports {
        return on_adapter(rig, arguments, (about, scope), simulated, output);
    }
    let mut target = OnLine::<Unitek>::new(simulated);
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

fn setup_of(about: &FuzzSettings<FrameTalk>) -> Result<Setup, ExploreError> {
    about.setup.under_test::<Unitek>()
}

/// What cases may have: behind an adapter only what a drive takes back.
fn spices(rig: &Rig, arguments: &FuzzRunArguments) -> Vec<FrameSpice> {
    let all = FrameSpice::NAMES.iter().map(|(_, own)| *own);
    if rig.is_simulated() {
        return all.collect();
    }
    let limits = limits(rig, arguments.allow_motion);
    let possible = |own: &FrameSpice| match own {
        FrameSpice::Read | FrameSpice::Cycles | FrameSpice::Mode => true,
        FrameSpice::Write => limits.motion,
        FrameSpice::Foreign => limits.other_identifiers,
        _ => false,
    };
    all.filter(possible).collect()
}

/// Explores drives behind an adapter, and gives the rig back in its safe state.
fn on_adapter(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    (about, scope): (FuzzSettings<FrameTalk>, LineScope<Unitek>),
    simulated: Setup,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let options = Options {
        purpose: "fuzz".to_owned(),
        wait: arguments.wait.unwrap_or_default(),
        allow_motion: arguments.allow_motion,
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..Options::default()
    };
    let mut session = match Session::open(rig, &options) {
        Ok(session) => session,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(exit_of(&error));
        }
    };
    let explored = match OnAdapter::new(&mut session, simulated) {
        Ok(mut target) => {
            let bounds = bounds_on_ports(arguments);
            let exit = explore(arguments, (about, scope), &mut target, &bounds, output);
            for remark in target.restore() {
                output.complain(&remark);
            }
            exit
        }
        Err(error) => Ok(tell(&error, output)),
    };
    let exit = match session.link().trouble() {
        Some(Trouble::Interrupted) => Exit::Interrupted,
        Some(Trouble::Lost(_) | Trouble::Garbled(_)) => Exit::RigError,
        _ => explored.unwrap_or_else(|error| output.unwritable(&error)),
    };
    let end = session.close(matches!(exit, Exit::RigError | Exit::Interlock));
    Ok(tell_end(&end, exit, output))
}

/// Why a run is not possible.
fn refused(rig: &Rig, arguments: &FuzzRunArguments) -> Option<&'static str> {
    if !rig.is_simulated() && !arguments.deviates.is_empty() {
        return Some("--deviates is for simulated drives; this rig has an adapter");
    }
    if arguments.whole || arguments.behind_port {
        return Some("--whole and --behind-port are for rings; leave them out for UNITEK drives");
    }
    if arguments.html.is_some() {
        return Some(
            "--html is for runs on rings; the findings of this run are scenarios: `drivebench run --html` shows them",
        );
    }
    let second = arguments.deviates.iter().any(|own| own.ring != 0);
    second.then_some("a deviation of a UNITEK drive is planted as DRIVE=NAME, such as 1=no-lock")
}

/// Makes a finding small, in at most `most` runs, and writes what came of it beside it.
pub(crate) fn shrink(path: &Path, most: u32, output: &mut Output) -> std::io::Result<Exit> {
    let read = Finding::<FrameTalk>::read_as(path);
    let small = read.and_then(|(finding, file)| {
        let most = if finding.ports { 0 } else { most };
        let mut target = OnLine::<Unitek>::new(finding.setup.under_test::<Unitek>()?);
        Ok((smaller(&finding, &mut target, most)?, finding, file))
    });
    let (small, finding, file) = match small {
        Ok(small) => small,
        Err(error) => return Ok(tell(&error, output)),
    };
    if finding.ports {
        output.complain(
            "this finding was made on drives behind an adapter: only findings of simulated drives are made small; its scenario is beside it",
        );
        return Ok(Exit::Usage);
    }
    let acts = |finding: &Finding<FrameTalk>| finding.case.acts.len();
    let became = format!(
        "{} became {}",
        counted(acts(&finding), "act"),
        acts(&small.finding)
    );
    let runs = small.finding.shrunk_in.unwrap_or(0);
    write_smaller(
        &small.finding,
        &file,
        &became,
        (runs, small.complete),
        output,
    )
}
