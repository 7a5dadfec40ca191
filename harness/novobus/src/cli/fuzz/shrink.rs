//! `drivebench shrink` for a finding on rings.

use super::super::rig::find_rig;
use super::{on_ports, scope};
use crate::explore::shrink::{Shrunk, Subject, shrink as make_small};
use crate::explore::{Case, Difference, Finding, OnRig, OnSim, RingSetup};
use crate::rig::Run;
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::shrink::{RUNS, RUNS_ON_RIG, ShrinkArguments, write_smaller};
use harness_bench::command::fuzz::tell;
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::use_options;
use harness_bench::counted::counted;
use harness_bench::explore::Planted;
use harness_bench::explore::{Differing as _, ExploreError, Target};
use harness_bench::rig::buses::RigBuses;
use harness_sim::novobus::deviation::DEVIATIONS;
use std::path::Path;

/// Makes a finding small, and writes what came of it beside it.
pub(super) fn shrink(
    arguments: &ShrinkArguments,
    buses: &'static RigBuses,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (finding, path) = match Finding::read_as(&arguments.finding) {
        Ok(read) => read,
        Err(error) => return Ok(tell(&error, output)),
    };
    if !finding.ports {
        if arguments.rig.is_some() {
            output.complain(
                "this finding was made on a simulated ring: it is made small there, without --rig",
            );
            return Ok(Exit::Usage);
        }
        let most = arguments.runs.unwrap_or(RUNS);
        let subject = subject(&finding);
        let small = make_small(subject, finding.difference.clone(), most, &mut on_simulated);
        return settle(&finding, &path, small, output);
    }
    let Some(name) = &arguments.rig else {
        output.complain(&format!(
            "this finding was made on the rig {}, which has ports: name it with --rig",
            finding.rig
        ));
        return Ok(Exit::Usage);
    };
    let Some(rig) = find_rig(name, buses, output) else {
        return Ok(Exit::Usage);
    };
    if rig.is_simulated() || rig.sizes() != finding.case.sizes() {
        let sizes: Vec<_> = finding.case.sizes().iter().map(u8::to_string).collect();
        output.complain(&format!(
            "the finding is of a rig with ports whose rings have the sizes {}, and {name} is another",
            sizes.join(", ")
        ));
        return Ok(Exit::Usage);
    }
    let options = use_options("shrink", arguments.allow_motion, arguments.wait);
    let most = arguments.runs.unwrap_or(RUNS_ON_RIG);
    let start = explained(&finding, output);
    on_ports(&rig, &options, output, |run, output| {
        let small = on_rig(&finding, start, most, run);
        settle(&finding, &path, small, output)
    })
}

fn subject(finding: &Finding) -> Subject {
    Subject {
        case: finding.case.clone(),
        setup: finding.setup.clone(),
    }
}

fn is_on_same_rings(subject: &Subject, finding: &Finding) -> bool {
    let rings = |case: &Case| (case.drives, case.beside);
    rings(&subject.case) == rings(&finding.case)
}

/// Asks a simulated ring.
fn on_simulated(subject: &Subject) -> Result<Option<Difference>, ExploreError> {
    let mut target = OnSim::new(subject.setup.clone());
    // A smaller ring may not have what the header speaks of.
    let Ok(rehearsal) = target.rehearse(&subject.case) else {
        return Ok(None);
    };
    match target.attempt(&subject.case, &rehearsal) {
        Ok(tried) => Ok(tried.difference),
        Err(_) => Ok(None),
    }
}

/// What a finding of a rig is made into on the simulator first, where a known deviation of a drive shows the same there: runs that
/// cost nothing. What comes of it is only a proposal; the rig decides.
fn explained(finding: &Finding, output: &mut Output) -> Option<Subject> {
    let drives = 0..finding.case.drives;
    let accused = finding.difference.drive;
    let suspects: Vec<u8> = accused.map_or_else(|| drives.collect(), |drive| vec![drive]);
    for deviation in DEVIATIONS.all() {
        for drive in &suspects {
            let name = deviation.name.to_owned();
            let planted = Planted {
                ring: finding.case.ring(),
                drive: *drive,
                name,
            };
            let subject = Subject {
                case: finding.case.clone(),
                setup: RingSetup {
                    deviates: vec![planted],
                    ..finding.setup.clone()
                },
            };
            let found = on_simulated(&subject).ok().flatten();
            let Some(difference) = found.filter(|found| found.is_like(&finding.difference)) else {
                continue;
            };
            // The rig's rings have the sizes that they have.
            let mut ask = |subject: &Subject| match is_on_same_rings(subject, finding) {
                true => on_simulated(subject),
                false => Ok(None),
            };
            let small = make_small(subject, difference, RUNS, &mut ask).ok()?;
            output.say(&format!(
                "drive {drive} deviates {} shows the same on the simulator: made small there first, in {}\n",
                deviation.name,
                counted(small.runs, "run")
            ));
            return Some(Subject {
                setup: finding.setup.clone(),
                ..small.subject
            });
        }
    }
    None
}

/// Makes a finding small on the rig that it was made on.
fn on_rig(
    finding: &Finding,
    start: Option<Subject>,
    most: u32,
    run: &mut Run<'_>,
) -> Result<Shrunk, ExploreError> {
    let limits = scope(run).limits;
    let mut target = OnRig::new(run, limits)?;
    let mut ask = |subject: &Subject| {
        if !is_on_same_rings(subject, finding) {
            return Ok(None);
        }
        let rehearsal = target.rehearse(&subject.case)?;
        if rehearsal.denied.is_some() {
            return Ok(None);
        }
        target.begin();
        let tried = target.attempt(&subject.case, &rehearsal)?;
        Ok(tried.difference)
    };
    let mut spent = 0;
    if let Some(start) = start {
        spent += 1;
        let found = ask(&start)?;
        if let Some(difference) = found.filter(|found| found.is_like(&finding.difference)) {
            let mut small = make_small(start, difference, most.saturating_sub(spent), &mut ask)?;
            small.runs += spent;
            return Ok(small);
        }
    }
    let left = most.saturating_sub(spent);
    let mut small = make_small(subject(finding), finding.difference.clone(), left, &mut ask)?;
    small.runs += spent;
    Ok(small)
}

/// Writes the smaller finding beside the old one, and shows it.
fn settle(
    finding: &Finding,
    path: &Path,
    small: Result<Shrunk, ExploreError>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let small = match small {
        Ok(small) => small,
        Err(error) => return Ok(tell(&error, output)),
    };
    let before = finding.case.bytes().len();
    let after = small.subject.case.bytes().len();
    let new = Finding {
        shrunk_in: Some(small.runs),
        difference: small.difference,
        setup: small.subject.setup,
        case: small.subject.case,
        attempts: Vec::new(),
        ..finding.clone()
    };
    let (end, runs) = (small.complete, small.runs);
    let became = format!("{} became {after}", counted(before, "byte"));
    write_smaller(&new, path, &became, (runs, end), output)
}
