//! `drivebench fuzz run` and `shrink` on NORDAC inverters.

use crate::buses::nordac::explore::{TelegramSpice, TelegramTalk};
use crate::buses::nordac::language::Nordac;
use crate::buses::nordac::rig::slaves;
use crate::cli::exit::Exit;
use crate::cli::fuzz::{FuzzRunArguments, bounds_of_simulated, explore, tell};
use crate::cli::output::Output;
use crate::cli::shrink::write_smaller;
use crate::counted::counted;
use crate::explore::line::{LineScope, LineSetup, OnLine, PlantedDrive};
use crate::explore::smaller::smaller;
use crate::explore::{Finding, FuzzSettings, KeptRun, Spiced as _, read_as};
use crate::rig::Rig;
use std::path::Path;

/// Explores the simulated inverters of a rig.
pub(crate) fn run(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(why) = refused(rig, arguments) {
        output.complain(why);
        return Ok(Exit::Usage);
    }
    let before: Option<KeptRun<TelegramTalk>> = match &arguments.resume {
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
        None => LineSetup::of_rig::<Nordac>(rig, planted.collect()),
    };
    let own = rig.port().map(slaves).unwrap_or_default();
    let scope = LineScope::<Nordac> {
        drives: own
            .iter()
            .map(|own| (own.address, own.ppo.unwrap_or_default()))
            .collect(),
        spices: TelegramSpice::NAMES.iter().map(|(_, own)| *own).collect(),
    };
    let simulated = match setup.under_test::<Nordac>() {
        Ok(simulated) => simulated,
        Err(error) => return Ok(tell(&error, output)),
    };
    let about = FuzzSettings {
        schema: FuzzSettings::<TelegramTalk>::SCHEMA,
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
    let mut target = OnLine::<Nordac>::new(simulated);
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

/// Why a run is not possible.
fn refused(rig: &Rig, arguments: &FuzzRunArguments) -> Option<&'static str> {
    if !rig.is_simulated() {
        return Some(
            "`fuzz run` explores simulated NORDAC inverters, and this rig has an adapter; name sim:nordac, or a rig file with [sim]",
        );
    }
    if arguments.whole || arguments.behind_port {
        return Some(
            "--whole and --behind-port are for rings; leave them out for NORDAC inverters",
        );
    }
    if arguments.html.is_some() {
        return Some(
            "--html is for runs on rings; the findings of this run are scenarios: `drivebench run --html` shows them",
        );
    }
    let second = arguments.deviates.iter().any(|own| own.ring != 0);
    second
        .then_some("a deviation of a NORDAC inverter is planted as ADDRESS=NAME, such as 8=no-off2")
}

/// Makes a finding small, in at most `most` runs, and writes what came of it beside it.
pub(crate) fn shrink(path: &Path, most: u32, output: &mut Output) -> std::io::Result<Exit> {
    let read = Finding::<TelegramTalk>::read_as(path);
    let small = read.and_then(|(finding, file)| {
        let mut target = OnLine::<Nordac>::new(finding.setup.under_test::<Nordac>()?);
        Ok((smaller(&finding, &mut target, most)?, finding, file))
    });
    let (small, finding, file) = match small {
        Ok(small) => small,
        Err(error) => return Ok(tell(&error, output)),
    };
    let became = format!(
        "{} became {}",
        counted(finding.case.sent(), "telegram"),
        small.finding.case.sent()
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
