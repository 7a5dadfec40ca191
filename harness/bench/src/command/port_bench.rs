//! The bench of a command on drives behind `[port.1]`: taken, used, and given back in the state that the command asks for.

use super::exit::Exit;
use super::failure::Failure;
use super::held::HeldDrives;
use super::output::Output;
use super::rig_commands::unusable;
use super::rig_failure::{exit_of_end, tell_end, use_options};
use crate::command::axes::Axes;
use crate::command::drive::RigArguments;
use crate::command::rig_name::Use;
use crate::link::Line as _;
use crate::rig::Rig;
use crate::rig::session::{RigDrives, RigSession};
use crate::scenario::source::Source;
use std::time::Duration;

/// Where a command runs.
pub enum PortBench<'b, D: RigDrives> {
    /// On a rig that is taken for this command.
    Rig(&'b Rig),
    /// On a rig that a session holds.
    Held(&'b mut RigSession<D>),
}

/// Runs `act` on a bench. A rig is taken for it and given back: its drives stay as they are if `as_what` says so and `act` succeeds, or if
/// nothing was done. In all other cases it is given back in its safe state. What a session holds stays as `act` leaves it.
///
/// # Errors
/// [`Failure`]: the rig cannot be taken. Of a session also that of `act`.
pub fn on<D: RigDrives>(
    bench: PortBench<'_, D>,
    arguments: &RigArguments,
    as_what: Use,
    output: &mut Output,
    act: impl FnOnce(&mut RigSession<D>, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    let rig = match bench {
        PortBench::Rig(rig) => rig,
        PortBench::Held(session) => return act(session, output),
    };
    let mut rig = rig.clone();
    if let Some(path) = &arguments.setup {
        let simulated = rig.origin.starts_with("sim:");
        let Some((port, row)) = rig.port().zip(rig.port_row()).filter(|_| simulated) else {
            let bus = rig.port().map_or("", |port| port.bus.name());
            return Err(Failure::refused(format!(
                "--setup is for sim:{bus}:N; what stands in a rig's file is set up by its [sim] setup",
            )));
        };
        let source = Source::read(path).map_err(|error| Failure::File(error.into()))?;
        if let Some(problems) = (row.setup_mistakes)(port, &source) {
            return Err(problems.into());
        }
        if let Some(sim) = &mut rig.file.sim {
            sim.setup = vec![source.text.to_string()];
        }
    }
    let wait = Duration::from_nanos(arguments.patience.as_nanos());
    let options = use_options(as_what.purpose, as_what.moves, Some(wait));
    let mut session = RigSession::open(&rig, &options).map_err(unusable)?;
    session.look_at_interlocks();
    let result = act(&mut session, output);
    Ok(give_back(session, as_what, result, output))
}

/// The exit code of a command, and whether the drives stay as they are: always if nothing was done, else as it is said for success and for
/// failure.
pub fn outcome(
    result: Result<Exit, Failure>,
    [success, failure]: [bool; 2],
    output: &mut Output,
) -> (Exit, bool) {
    match result {
        Ok(exit) => (exit, success),
        // Impossible requests and missing permissions are refused before anything is done.
        Err(refused @ (Failure::Said(Exit::Usage, _) | Failure::Told(_) | Failure::File(_))) => {
            (refused.tell(output), true)
        }
        Err(failed) => (failed.tell(output), failure),
    }
}

fn give_back<D: RigDrives>(
    mut session: RigSession<D>,
    as_what: Use,
    result: Result<Exit, Failure>,
    output: &mut Output,
) -> Exit {
    let (exit, leave) = outcome(result, [as_what.holds, as_what.looks_only()], output);
    let exit = exit_of_end(session.link().trouble(), exit, output);
    let end = match leave {
        true => session.release(),
        false => session.close(matches!(exit, Exit::RigError | Exit::Interlock)),
    };
    tell_end(&end, exit, output)
}

/// The drives that are meant, each once, in the order in which they are named.
///
/// # Errors
/// The rig has no such drive.
pub fn select<D: HeldDrives>(
    wanted: &[Axes],
    session: &RigSession<D>,
) -> Result<Vec<D::Drive>, Failure> {
    let [drive, line] = D::WORDS;
    let all = session.drives().listed();
    let of = |number: u8| all.iter().find(|drive| D::number(drive) == number).copied();
    each_once(wanted, |axes| match axes {
        Axes::All => Ok(all.clone()),
        Axes::Some(0, numbers) => {
            if let Some(missing) = numbers.clone().find(|number| of(*number).is_none()) {
                let known: Vec<_> = all
                    .iter()
                    .map(|drive| D::number(drive).to_string())
                    .collect();
                return Err(format!(
                    "the rig has no {drive} {missing}: {} expected",
                    known.join(", ")
                ));
            }
            Ok(numbers.clone().filter_map(of).collect())
        }
        Axes::Some(ring, _) => Err(format!("a {line} has no ring {}", ring + 1)),
    })
}

/// What `find` finds for each that is wanted, each once.
///
/// # Errors
/// Those of `find`, in a sentence.
pub fn each_once<T: PartialEq>(
    wanted: &[Axes],
    find: impl Fn(&Axes) -> Result<Vec<T>, String>,
) -> Result<Vec<T>, Failure> {
    let mut selected = Vec::new();
    for axes in wanted {
        for found in find(axes).map_err(Failure::refused)? {
            if !selected.contains(&found) {
                selected.push(found);
            }
        }
    }
    Ok(selected)
}

/// The only drive that is meant.
///
/// # Errors
/// The rig has no such drive, or several are meant.
pub fn single<D: HeldDrives>(wanted: &Axes, session: &RigSession<D>) -> Result<D::Drive, Failure> {
    match select(std::slice::from_ref(wanted), session)?[..] {
        [drive] => Ok(drive),
        _ => Err(Failure::refused(format!(
            "one {} expected here, not several",
            D::WORDS[0]
        ))),
    }
}
