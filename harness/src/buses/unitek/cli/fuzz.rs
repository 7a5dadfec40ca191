//! `drivebench fuzz run` and `shrink` on UNITEK drives.

use crate::buses::unitek::explore::shrink::smaller;
use crate::buses::unitek::explore::{
    FrameScope, FrameSetup, FrameSpice, FrameTalk, OnBench, PlantedDrive,
};
use crate::buses::unitek::rig::axes;
use crate::cli::exit::Exit;
use crate::cli::fuzz::{FuzzRunArguments, bounds_of_simulated, explore, tell};
use crate::cli::output::Output;
use crate::cli::shrink::write_smaller;
use crate::counted::counted;
use crate::explore::{Finding, FuzzSettings, KeptRun, Spiced as _, read_as};
use crate::rig::Rig;
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
        None => FrameSetup::of_rig(rig, planted.collect()),
    };
    let mut target = match OnBench::new(&setup) {
        Ok(target) => target,
        Err(error) => return Ok(tell(&error, output)),
    };
    let drives = rig.port().map(axes).unwrap_or_default();
    let scope = FrameScope {
        drives: drives.iter().map(|own| (own.node, own.rx)).collect(),
        spices: FrameSpice::NAMES.iter().map(|(_, own)| *own).collect(),
    };
    let about = FuzzSettings {
        schema: FuzzSettings::<FrameTalk>::SCHEMA,
        rig: name.unwrap_or_else(|| arguments.rig.clone()),
        drives: u8::try_from(scope.drives.len()).unwrap_or(u8::MAX),
        second: None,
        ports: false,
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
    let bounds = bounds_of_simulated(arguments);
    let exit = explore(arguments, (about, scope), &mut target, &bounds, output)?;
    if target.undecided() > 0 {
        output.say(&format!(
            "{} of the cases not judged: more values of open points than are tried could explain them\n",
            target.undecided()
        ));
    }
    Ok(exit)
}

/// Why a run is not possible.
fn refused(rig: &Rig, arguments: &FuzzRunArguments) -> Option<&'static str> {
    if !rig.is_simulated() {
        return Some(
            "fuzz run on UNITEK drives behind an adapter is not built yet; name a simulated rig, such as sim:unitek:1",
        );
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
    let small = read.and_then(|(finding, file)| Ok((smaller(&finding, most)?, finding, file)));
    let (small, finding, file) = match small {
        Ok(small) => small,
        Err(error) => return Ok(tell(&error, output)),
    };
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
