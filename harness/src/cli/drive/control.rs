//! `drivebench go`, `stop`, `block`, `reset`, `delete-error`: the modes of drives (ND21 11.8, 14.10).

use super::args::{MoveArguments, SelectArguments};
use super::axes;
use super::failure::Failure;
use super::rig::{self, Bench};
use crate::bus::{Axis, Bus, Error};
use crate::cli::exit::Exit;
use crate::cli::output::Output;
use harness_proto::time::Span;

/// How long a drive is given before it is looked at: some of its cycles of 432 us (4.1).
const CYCLES: Span = Span::from_millis(5);
/// The same after a reset.
const RESET: Span = Span::from_millis(200);

type Call = fn(&Bus<'_>, Axis) -> Result<(), Error>;

/// Lets drives run.
pub(super) fn go(arguments: &MoveArguments, output: &mut Output) -> Result<Exit, Failure> {
    with_leave(arguments, output, "go", |bus, axis| bus.go(axis), CYCLES)
}

/// Resets drives.
pub(super) fn reset(arguments: &MoveArguments, output: &mut Output) -> Result<Exit, Failure> {
    with_leave(
        arguments,
        output,
        "reset",
        |bus, axis| bus.reset(axis),
        RESET,
    )
}

/// Stops drives.
pub(super) fn stop(arguments: &SelectArguments, output: &mut Output) -> Result<Exit, Failure> {
    let (bench, drives) = selected(arguments)?;
    each(&bench, &drives, output, |bus, axis| bus.stop(axis), CYCLES)
}

/// Blocks drives.
pub(super) fn block(arguments: &SelectArguments, output: &mut Output) -> Result<Exit, Failure> {
    let (bench, drives) = selected(arguments)?;
    each(&bench, &drives, output, |bus, axis| bus.block(axis), CYCLES)
}

/// Confirms errors.
pub(super) fn delete_error(
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let (bench, drives) = selected(arguments)?;
    each(
        &bench,
        &drives,
        output,
        |bus, axis| bus.delete_error(axis),
        CYCLES,
    )
}

fn selected(arguments: &SelectArguments) -> Result<(Bench, Vec<Axis>), Failure> {
    let bench = rig::open(&arguments.rig)?;
    let drives = axes::select(&arguments.drives, &bench.bus.axes())?;
    Ok((bench, drives))
}

/// Says what can move before it can, and refuses it without a leave.
fn with_leave(
    arguments: &MoveArguments,
    output: &mut Output,
    what: &str,
    call: Call,
    wait: Span,
) -> Result<Exit, Failure> {
    let (bench, drives) = selected(&arguments.select)?;
    let names: Vec<_> = drives.iter().map(Axis::to_string).collect();
    let (s, their) = if drives.len() == 1 {
        ("", "its motor")
    } else {
        ("s", "their motors")
    };
    let warning = format!("{what}: drive{s} {}: {their} may turn", names.join(", "));
    if !arguments.leave {
        return Err(Failure::refused(format!(
            "{warning}; nothing was done, add --move to allow it"
        )));
    }
    output.say(&format!("{warning}\n"));
    each(&bench, &drives, output, call, wait)
}

/// Orders it of every drive first, and then says how each is. One that does not answer does not keep the
/// others from being stopped.
fn each(
    bench: &Bench,
    drives: &[Axis],
    output: &mut Output,
    call: Call,
    wait: Span,
) -> Result<Exit, Failure> {
    let bus = &bench.bus;
    let done: Vec<_> = drives.iter().map(|axis| call(bus, *axis)).collect();
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
            }
        }
    }
    Ok(exit)
}
