//! `drivebench fuzz run`.

use crate::buses::novobus::cli::fuzz::{on_ports, scope, simulated, sizes};
use crate::buses::novobus::explore::{
    Case, CaseScope, FuzzSettings, KeptRun, OnRig, OnSim, RingSetup, planted_setup,
};
use crate::buses::novobus::rig::sim;
use crate::buses::{BUSES, find_any_rig, line_fuzz};
use crate::command::exit::Exit;
use crate::command::fuzz::run::{
    CASES, FuzzRunArguments, bounds_of_simulated, bounds_on_ports, explore, planted as read_planted,
};
use crate::command::fuzz::tell;
use crate::command::output::Output;
use crate::command::page::writable;
use crate::explore::{Planted, Spiced as _, read_as, rig_of};
use crate::partition::Partition;
use crate::rig::{Rig, UseOptions};
use crate::scenario::problem::nearest;
use harness_proto::novobus::guard::Limits;

/// A deviation of a drive, which a bus must have.
pub(super) fn planted(text: &str) -> Result<Planted, String> {
    read_planted(text, |name| {
        let names = deviation_names();
        let known = names.iter().find(|own| **own == name.trim());
        let known = known.ok_or_else(|| {
            let remedy = match nearest(name.trim(), &names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`drivebench deviations` lists them".to_owned(),
            };
            format!("there is no deviation `{name}`; {remedy}")
        })?;
        Ok((*known).to_owned())
    })
}

/// The deviations of drives of all buses.
fn deviation_names() -> Vec<&'static str> {
    let rows = BUSES.iter().flat_map(|bus| {
        let [drives, _masters] = (bus.deviations)();
        drives
    });
    rows.map(|row| row.name).collect()
}

/// Explores.
pub(crate) fn run(arguments: &FuzzRunArguments, output: &mut Output) -> std::io::Result<Exit> {
    if let Some(path) = &arguments.html
        && writable(path, output).is_err()
    {
        return Ok(Exit::Usage);
    }
    // What a run that goes on is, its record says.
    let name = match arguments.resume.as_deref().map(rig_of).transpose() {
        Ok(name) => name.unwrap_or_else(|| arguments.rig.clone()),
        Err(error) => return Ok(tell(&error, output)),
    };
    let Some(rig) = find_any_rig(&name, output) else {
        return Ok(Exit::Usage);
    };
    let part = match arguments.partition {
        None => None,
        Some(part) => {
            let own = share(arguments, part, &rig);
            if own.cases == Some(0) {
                output.complain(&format!("{part} has no case"));
                return Ok(Exit::NothingSelected);
            }
            output.say(&format!("{part} has the seed {}\n", own.seed));
            Some(own)
        }
    };
    let arguments = part.as_ref().unwrap_or(arguments);
    match rig.port().and_then(|port| line_fuzz(port.bus.bus())) {
        Some(own) => (own.run)(&rig, arguments, output),
        None => on_rings(rig, arguments, output),
    }
}

/// The run that is one part of this one: its seed and its share of the cases. A time on the line is that of each part.
fn share(arguments: &FuzzRunArguments, part: Partition, rig: &Rig) -> FuzzRunArguments {
    let by_number = rig.is_simulated() && !arguments.behind_port && arguments.wire_time.is_none();
    let cases = arguments.cases.or(by_number.then_some(CASES));
    FuzzRunArguments {
        seed: part.seed(arguments.seed),
        cases: cases.map(|cases| part.share(cases)),
        partition: None,
        ..arguments.clone()
    }
}

fn on_rings(
    mut rig: Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let before = match arguments.resume.as_deref().map(read_as::<Case>).transpose() {
        Ok(before) => before.map(|(kept, _)| kept),
        Err(error) => return Ok(tell(&error, output)),
    };
    let others = |own: &&Planted| planted_setup(own).is_none();
    if let Some(planted) = arguments.deviates.iter().find(others) {
        output.complain(&format!(
            "drives on a ring have no deviation `{}`; `drivebench deviations` lists them",
            planted.name
        ));
        return Ok(Exit::Usage);
    }
    let behind_port = match &before {
        Some(kept) => kept.about.ports,
        None => arguments.behind_port || !rig.is_simulated(),
    };
    if !behind_port {
        return on_simulated(arguments, before.as_ref(), &rig, output);
    }
    if rig.is_simulated() {
        let planted = arguments.deviates.iter().filter_map(planted_setup);
        let mut own = sim::setup(&rig);
        own.setups.extend(planted);
        sim::set_up(&mut rig, &own);
    } else if !arguments.deviates.is_empty() || arguments.whole {
        output.complain("--deviates and --whole are only for simulated rings; this rig has ports");
        return Ok(Exit::Usage);
    }
    let options = UseOptions {
        purpose: "fuzz".to_owned(),
        allow_motion: arguments.allow_motion,
        wait: arguments.wait.unwrap_or_default(),
        ..UseOptions::default()
    };
    on_ports(&rig, options, output, |run, output| {
        let scope = scope(run);
        let mut target = match OnRig::new(run, scope.limits) {
            Ok(target) => target,
            Err(error) => return Ok(tell(&error, output)),
        };
        target.end_between_cases();
        let about = about(
            arguments,
            (RingSetup::of_ports(rig.rings().count()), true),
            &scope,
        );
        let bounds = bounds_on_ports(arguments);
        explore(arguments, (about, scope), &mut target, &bounds, output)
    })
}

fn on_simulated(
    arguments: &FuzzRunArguments,
    before: Option<&KeptRun>,
    rig: &Rig,
    output: &mut Output,
) -> std::io::Result<Exit> {
    for planted in &arguments.deviates {
        let own = rig.rings().nth(planted.ring);
        let drives = own.map_or(0, |(_, ring)| ring.drives);
        if planted.drive >= drives {
            output.complain(&match drives {
                0 => "the rig has one ring, and no ring 2".to_owned(),
                _ => format!(
                    "ring {} has the drives 0 to {}, and no drive {}",
                    planted.ring + 1,
                    drives - 1,
                    planted.drive
                ),
            });
            return Ok(Exit::Usage);
        }
    }
    let setup = match before {
        Some(kept) => kept.about.setup.clone(),
        None => RingSetup::of_rig(rig, &arguments.deviates, arguments.whole),
    };
    let own = &rig.file.limits;
    let limits = Limits {
        motion: own.allow_motion,
        eeprom: own.allow_eeprom,
        reset: own.allow_reset,
        outputs: own.allow_outputs,
        monitoring: own.allow_monitoring,
        ..Limits::default()
    };
    let scope = simulated(rig, limits, &setup);
    let mut target = match OnSim::ready(setup.clone(), &sizes(rig)) {
        Ok(target) => target,
        Err(error) => return Ok(tell(&error, output)),
    };
    let bounds = bounds_of_simulated(arguments);
    let about = about(arguments, (setup, false), &scope);
    explore(arguments, (about, scope), &mut target, &bounds, output)
}

fn about(
    arguments: &FuzzRunArguments,
    (setup, ports): (RingSetup, bool),
    scope: &CaseScope,
) -> FuzzSettings {
    let names = scope.spices.iter().map(|spice| spice.name().to_owned());
    FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: arguments.rig.clone(),
        drives: scope.first.drives,
        second: scope.second.as_ref().map(|ring| ring.drives),
        ports,
        seed: arguments.seed,
        confirm: arguments.confirm.0,
        of: arguments.confirm.1,
        setup,
        spices: names.collect(),
    }
}
