//! `drivebench fuzz run` on rings.

use super::{on_ports, scope, simulated};
use crate::explore::{
    Case, CaseScope, FuzzSettings, KeptRun, OnRig, OnSim, RingSetup, planted_setup,
};
use crate::rig::sim;
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::run::{
    FuzzRunArguments, bounds_of_simulated, bounds_on_ports, explore,
};
use harness_bench::command::fuzz::tell;
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::use_options;
use harness_bench::explore::{Planted, Spiced as _, read_as};
use harness_bench::rig::Rig;
use harness_proto::novobus::guard::Limits;

/// Explores the rings of a rig.
pub(super) fn run(
    rig: &Rig,
    arguments: &FuzzRunArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let before = match arguments.resume.as_deref().map(read_as::<Case>).transpose() {
        Ok(before) => before.map(|(kept, _)| kept),
        Err(error) => return Ok(tell(&error, output)),
    };
    let others = |planted: &&Planted| planted_setup(planted).is_none();
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
        return on_simulated(arguments, before.as_ref(), rig, output);
    }
    let mut rig = rig.clone();
    if rig.is_simulated() {
        let planted = arguments.deviates.iter().filter_map(planted_setup);
        let mut setup = sim::setup(&rig);
        setup.setups.extend(planted);
        sim::set_up(&mut rig, &setup);
    } else if !arguments.deviates.is_empty() || arguments.whole {
        output.complain("--deviates and --whole are only for simulated rings; this rig has ports");
        return Ok(Exit::Usage);
    }
    let options = use_options("fuzz", arguments.allow_motion, arguments.wait);
    on_ports(&rig, &options, output, |run, output| {
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
        let ring = rig.rings().nth(planted.ring);
        let drives = ring.map_or(0, |(_, ring)| ring.drives);
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
    let permitted = &rig.file.limits;
    let limits = Limits {
        motion: permitted.allow_motion,
        eeprom: permitted.allow_eeprom,
        reset: permitted.allow_reset,
        outputs: permitted.allow_outputs,
        monitoring: permitted.allow_monitoring,
        ..Limits::default()
    };
    let scope = simulated(rig, limits, &setup);
    let mut target = match OnSim::ready(setup.clone(), &rig.sizes()) {
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
