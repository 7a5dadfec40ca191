//! The bench of a command: taken, used, and given back in the state that the command asks for.

use crate::buses::commands::{RigArguments, Use};
use crate::buses::unitek::driver::{Driver, Error};
use crate::buses::unitek::rig::{Axis, Session, setup};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::rig_failure::{alarm, exit_of, tell_end};
use crate::link::{Line, Trouble};
use crate::rig::{Options, Rig};
use crate::scenario::source::Source;
use crate::signals::interrupt_flag;
use harness_proto::unitek::units::Scaling;
use std::time::Duration;

/// Takes a rig, runs `act` on it and gives it back. The drives stay as they are if `as_what` says so and `act` succeeds, or if nothing
/// was done. In all other cases the bench is given back in its safe state.
pub(super) fn on(
    rig: &Rig,
    arguments: &RigArguments,
    as_what: Use,
    output: &mut Output,
    act: impl FnOnce(&mut Session, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    let mut rig = rig.clone();
    if let Some(path) = &arguments.setup {
        if !rig.origin.starts_with("sim:") {
            return Err(Failure::refused(
                "--setup is for sim:unitek:N; what stands in a rig's file is set up by its [sim] setup",
            ));
        }
        let source = Source::read(path).map_err(|error| Failure::File(error.into()))?;
        if let Some(port) = rig.port() {
            setup(port, &source)?;
        }
        if let Some(sim) = &mut rig.file.sim {
            sim.setup = vec![source.text.to_string()];
        }
    }
    let options = Options {
        purpose: as_what.purpose.to_owned(),
        wait: Duration::from_nanos(arguments.patience.as_nanos()),
        allow_motion: as_what.moves,
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..Options::default()
    };
    let session = Session::open(&rig, &options);
    let mut session = session.map_err(|error| Failure::Said(exit_of(&error), error.to_string()))?;
    let result = act(&mut session, output);
    Ok(give_back(session, as_what, result, output))
}

fn give_back(
    mut session: Session,
    as_what: Use,
    result: Result<Exit, Failure>,
    output: &mut Output,
) -> Exit {
    let (exit, leave) = match result {
        Ok(exit) => (exit, as_what.holds),
        // Impossible requests and missing permissions are refused before anything is done.
        Err(failure @ (Failure::Said(Exit::Usage, _) | Failure::Told(_) | Failure::File(_))) => {
            (failure.tell(output), true)
        }
        Err(failure) => (failure.tell(output), as_what.looks_only()),
    };
    let trouble = session.link().trouble().cloned();
    let exit = match trouble {
        Some(Trouble::Interrupted) => Exit::Interrupted,
        _ => exit,
    };
    let end = match leave && trouble.is_none() {
        true => session.release(),
        false => session.close(matches!(exit, Exit::RigError | Exit::Interlock)),
    };
    tell_end(&end, exit, output)
}

/// What the scales of a drive depend on: the rpm of 100 %, the device's current and the current's scale (App 7).
pub(super) fn scaling(driver: &mut Driver<'_>, axis: Axis) -> Result<Scaling, Error> {
    let mut read = |register| {
        let reply = driver.read(axis, register)?;
        Ok::<_, Error>((reply.data.bits() & 0xFFFF) as u16)
    };
    Ok(Scaling {
        rpm_max: read(0xCE)?,
        device_current: read(0xC6)?,
        units_at_200: read(0xD9)?,
    })
}

/// The drives that are meant, each once, in the order in which they are named.
pub(super) fn select(
    wanted: &[crate::buses::commands::Axes],
    session: &Session,
) -> Result<Vec<Axis>, Failure> {
    use crate::buses::commands::Axes;
    let all = session.axes();
    let mut selected: Vec<Axis> = Vec::new();
    for axes in wanted {
        let named: Vec<Axis> = match axes {
            Axes::All => all.to_vec(),
            Axes::Some(0, nodes) => {
                let of = |node: u8| all.iter().find(|axis| axis.node == node).copied();
                let missing = nodes.clone().find(|node| of(*node).is_none());
                if let Some(node) = missing {
                    let known: Vec<_> = all.iter().map(|axis| axis.node.to_string()).collect();
                    return Err(Failure::refused(format!(
                        "the rig has no drive {node}: {} expected",
                        known.join(", ")
                    )));
                }
                nodes.clone().filter_map(of).collect()
            }
            Axes::Some(ring, _) => {
                let message = format!("a CAN bus has no ring {}", ring + 1);
                return Err(Failure::refused(message));
            }
        };
        for axis in named {
            if !selected.contains(&axis) {
                selected.push(axis);
            }
        }
    }
    Ok(selected)
}

/// The only drive that is meant.
pub(super) fn single(
    wanted: &crate::buses::commands::Axes,
    session: &Session,
) -> Result<Axis, Failure> {
    match select(std::slice::from_ref(wanted), session)?[..] {
        [axis] => Ok(axis),
        _ => Err(Failure::refused("one drive expected here, not several")),
    }
}

/// Drives in a sentence: `drive 1`, `drives 1, 2`.
pub(super) fn named(axes: &[Axis]) -> String {
    let names: Vec<_> = axes.iter().map(|axis| axis.node.to_string()).collect();
    let s = if names.len() == 1 { "" } else { "s" };
    format!("drive{s} {}", names.join(", "))
}
