//! `drivebench go`, `stop`, `block`, `reset`, `delete-error`: the modes of drives (ND21 11.8, 14.10).

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::{Axis, Error, OpenRings};
use crate::language::run::over_bus::reset_drives;
use crate::rig::{OfRings as _, Session};
use harness_bench::command::drive::{DeleteErrorArguments, MoveArguments, SelectArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::{RigName, Use};
use harness_bench::link::Line;
use harness_proto::nd21::State;
use harness_proto::nd21::bits::status;
use harness_proto::time::Span;

/// How long a drive is given before it is looked at: some of its cycles of 432 us (4.1).
const CYCLES: Span = Span::from_millis(5);
/// The same after a reset.
const AFTER_RESET: Span = Span::from_millis(200);

/// What is sent to a drive, and whether the drive is then as it was asked to be.
#[derive(Clone, Copy)]
struct Order {
    what: &'static str,
    call: fn(&OpenRings<'_>, Axis) -> Result<(), Error>,
    reached: fn(&State) -> bool,
}

/// The drive may stay blocked or stopped by its inputs.
const GO: Order = Order {
    what: "go",
    call: |bus, axis| bus.go(axis),
    reached: |state| {
        state.status & (status::BLOCK | status::STOP | status::ERROR | status::RESET) == 0
    },
};
const STOP: Order = Order {
    what: "stop",
    call: |bus, axis| bus.stop(axis),
    reached: |state| state.mode() != "go",
};
const BLOCK: Order = Order {
    what: "block",
    call: |bus, axis| bus.block(axis),
    reached: |state| !["go", "stop"].contains(&state.mode()),
};
const DELETE_ERROR: Order = Order {
    what: "delete-error",
    call: |bus, axis| bus.delete_error(axis),
    reached: |state| state.mode() != "error",
};
const RESET: Order = Order {
    what: "reset",
    call: |bus, axis| bus.reset(axis),
    reached: |_| true,
};

/// Lets drives run.
pub(crate) fn go(arguments: &MoveArguments, output: &mut Output) -> Result<Exit, Failure> {
    with_leave(arguments, output, GO, CYCLES)
}

/// Resets drives.
pub(crate) fn reset(arguments: &MoveArguments, output: &mut Output) -> Result<Exit, Failure> {
    let Some(RigName::Named(_)) = &arguments.select.rig.rig else {
        return with_leave(arguments, output, RESET, AFTER_RESET);
    };
    let first = |session: &mut Session, output: &mut Output| {
        let drives = axes::select(&arguments.select.drives, &session.axes())?;
        warn(arguments, &drives, "reset", output)?;
        let drives: Vec<_> = drives
            .iter()
            .map(|axis| (axis.ring(), axis.drive()))
            .collect();
        // After a reset the drives' state is unknown: the check sequence (9.8) follows, which the master does not send by itself.
        reset_drives(session.link(), &drives).map_err(|why| denied(session, why.to_string()))
    };
    let what = Use::new("reset", arguments.leave, arguments.hold.hold);
    rig::on_after(
        &arguments.select.rig,
        what,
        output,
        first,
        |bench, output| {
            let drives = axes::select(&arguments.select.drives, &bench.bus.axes())?;
            let seen = Order {
                call: |_, _| Ok(()),
                ..RESET
            };
            each(bench, &drives, output, seen, CYCLES)
        },
    )
}

/// Why a reset came to nothing.
fn denied(session: &mut Session, why: String) -> Failure {
    match session.link().trouble() {
        Some(trouble) => Error::Link(trouble.clone()).into(),
        None => Failure::drive(why),
    }
}

/// Stops drives.
pub(crate) fn stop(arguments: &SelectArguments, output: &mut Output) -> Result<Exit, Failure> {
    quietly(arguments, output, STOP)
}

/// Blocks drives.
pub(crate) fn block(arguments: &SelectArguments, output: &mut Output) -> Result<Exit, Failure> {
    quietly(arguments, output, BLOCK)
}

/// Confirms errors.
pub(crate) fn delete_error(
    arguments: &DeleteErrorArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let what = Use::new("delete-error", arguments.leave, true);
    let select = &arguments.select;
    rig::on(&select.rig, what, output, |bench, output| {
        let drives = axes::select(&select.drives, &bench.bus.axes())?;
        if bench.has_ports() && !arguments.leave {
            return Err(Failure::refused(format!(
                "delete-error: a released drive runs again when its error is confirmed, so the motors of {} may turn; nothing was confirmed, add --move to allow it",
                axes::named(&drives)
            )));
        }
        each(bench, &drives, output, DELETE_ERROR, CYCLES)
    })
}

/// For what makes no motor turn.
fn quietly(
    arguments: &SelectArguments,
    output: &mut Output,
    order: Order,
) -> Result<Exit, Failure> {
    let as_what = Use::look(order.what);
    rig::on(&arguments.rig, as_what, output, |bench, output| {
        let drives = axes::select(&arguments.drives, &bench.bus.axes())?;
        each(bench, &drives, output, order, CYCLES)
    })
}

/// Warns which motors may turn before the command runs, and refuses it without `--move`. At ports `go` is the only command that runs this.
fn with_leave(
    arguments: &MoveArguments,
    output: &mut Output,
    order: Order,
    wait: Span,
) -> Result<Exit, Failure> {
    let as_what = Use::new(order.what, arguments.leave, arguments.hold.hold);
    rig::on(&arguments.select.rig, as_what, output, |bench, output| {
        let drives = axes::select(&arguments.select.drives, &bench.bus.axes())?;
        warn(arguments, &drives, order.what, output)?;
        let exit = each(bench, &drives, output, order, wait)?;
        if bench.has_ports() && !arguments.hold.hold {
            output.say(
                "this command ends in the safe state; add --hold to leave the drives in go: their motors may then turn without supervision\n",
            );
        }
        Ok(exit)
    })
}

/// Warns which motors may turn, and refuses the command without `--move`.
fn warn(
    arguments: &MoveArguments,
    drives: &[Axis],
    what: &str,
    output: &mut Output,
) -> Result<(), Failure> {
    let their = match drives.len() {
        1 => "its motor",
        _ => "their motors",
    };
    let warning = format!("{what}: {}: {their} may turn", axes::named(drives));
    if !arguments.leave {
        return Err(Failure::refused(format!(
            "{warning}; nothing was done, add --move to allow it"
        )));
    }
    output.say(&format!("{warning}\n"));
    Ok(())
}

/// Sends the command to every drive first, and then reports the state of each. A drive that does not answer does not prevent the others
/// from being stopped. One that is not as it was asked to be has failed.
fn each(
    bench: &OpenBench,
    drives: &[Axis],
    output: &mut Output,
    order: Order,
    wait: Span,
) -> Result<Exit, Failure> {
    let bus = &bench.bus;
    let done: Vec<_> = drives.iter().map(|axis| (order.call)(bus, *axis)).collect();
    bus.run(wait);
    let mut exit = Exit::Passed;
    for (axis, done) in drives.iter().zip(done) {
        let after = done.and_then(|()| bus.state(*axis));
        match after {
            Err(error) => exit = exit.max(Failure::from(error).tell(output)),
            Ok(after) => {
                let error = after.error_in_words();
                let error = error.map_or(String::new(), |error| format!(", error {error}"));
                let mode = after.mode();
                output.result(&format!("drive {axis} is in {mode}{error}\n"))?;
                if !(order.reached)(&after) {
                    let what = order.what;
                    // A motor in "stop" or "go" has torque: one that was to be blocked is dangerous too.
                    let (remedy, code) = match (what, mode) {
                        ("block", _) => (
                            ": the safe state is NOT confirmed; use the emergency stop",
                            Exit::NotSafe,
                        ),
                        (_, "go") => ("; use the emergency stop", Exit::Failed),
                        _ => ("", Exit::Failed),
                    };
                    output.complain(&format!(
                        "drive {axis}: `{what}` was sent, and it is in {mode} (ND21 11.8){remedy}"
                    ));
                    exit = exit.max(code);
                }
            }
        }
    }
    Ok(exit)
}
