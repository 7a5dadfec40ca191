//! `drivebench go`, `stop`, `block` and `delete-error` on UNITEK drives.

use super::write::{Order, refuse_denied};
use crate::driver::{Driver, Error, StopKind};
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives};
use harness_bench::command::drive::{DeleteErrorArguments, MoveArguments, SelectArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives as _;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::words::{ERROR_TIME_OUT, ERRORS, MODE_LOCK, set_bits};

/// What a drive needs to take notice: some of its scans of 1 ms.
const SCANS: Span = Span::from_millis(5);

/// The register that clears errors, and the value that clients write.
const CANCEL: (u8, u16) = (0x8E, 0x4D44);

/// Releases drives: their motors may turn.
pub(super) fn go(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &MoveArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new("go", arguments.leave, arguments.hold.hold);
    let select = &arguments.select;
    on(bench, &select.rig, as_what, output, |session, output| {
        let drives = harness_bench::command::port_bench::select(&select.drives, session)?;
        let warning = format!("go: {}: motors may turn", UnitekDrives::named(&drives));
        if !arguments.leave {
            return Err(Failure::refused(format!(
                "{warning}; nothing was done, add --move to allow it"
            )));
        }
        let has_ports = !session.rig().is_simulated();
        let orders: Vec<_> = drives.iter().flat_map(|axis| start_up(*axis)).collect();
        refuse_denied(&mut session.driver(), &orders)?;
        output.say(&format!("{warning}\n"));
        let exit = each(session, &drives, output, |driver, axis| {
            driver.release(axis).map(|()| "released")
        })?;
        if has_ports && !arguments.hold.hold {
            output.say(
                "this command ends in the safe state; add --hold to leave the drives released: their motors may then turn without supervision\n",
            );
        }
        Ok(exit)
    })
}

/// What the routine of ex 11 writes: lock, commands 0, release.
pub(super) fn start_up(axis: Axis) -> [Order; 4] {
    let writes = [(0x51, MODE_LOCK), (0x31, 0), (0x90, 0), (0x51, 0)];
    writes.map(|(register, value)| (axis, Register::of(register), Data::Short(value)))
}

/// Stops drives: a speed command of 0, or a lock where no command is permitted.
pub(super) fn stop(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new("stop", true, true);
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let drives = select(&arguments.drives, session)?;
        each(session, &drives, output, |driver, axis| {
            driver.stop(axis).map(how)
        })
    })
}

pub(super) const fn how(stopped: StopKind) -> &'static str {
    match stopped {
        StopKind::OnRamp => "its speed command is 0",
        StopKind::Locked => "it is locked and coasts: the rig's file permits no speed command",
    }
}

/// Locks drives: no torque.
pub(super) fn block(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &SelectArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    on(
        bench,
        &arguments.rig,
        Use::look("block"),
        output,
        |session, output| {
            let drives = select(&arguments.drives, session)?;
            each(session, &drives, output, |driver, axis| {
                driver.lock(axis).map(|()| "locked, with commands 0")
            })
        },
    )
}

pub(super) fn delete_error(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &DeleteErrorArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::new("delete-error", arguments.leave, true);
    let select = &arguments.select;
    on(bench, &select.rig, as_what, output, |session, output| {
        let drives = harness_bench::command::port_bench::select(&select.drives, session)?;
        let order = |axis: &Axis| (*axis, Register::of(CANCEL.0), Data::Short(CANCEL.1));
        let orders: Vec<_> = drives.iter().map(order).collect();
        refuse_denied(&mut session.driver(), &orders)?;
        let exit = each(session, &drives, output, |driver, axis| {
            let _never_answered = driver.write(axis, CANCEL.0, Data::Short(CANCEL.1))?;
            Ok("the command that clears errors was sent")
        })?;
        Ok(exit.max(with_errors(session, &drives, output)?))
    })
}

/// Has failed where a drive still has errors (unitek dump, registers 8E and 8F).
fn with_errors(
    session: &mut Session,
    drives: &[Axis],
    output: &mut Output,
) -> Result<Exit, Failure> {
    let mut exit = Exit::Passed;
    for axis in drives {
        // A drive that does not answer has been reported.
        let errors = session.driver().read(*axis, 0x8F);
        let errors = errors.map_or(0, |read| read.data.bits());
        if errors != 0 {
            let node = axis.node;
            let hint = match errors & ERROR_TIME_OUT {
                0 => "",
                _ => {
                    "; a time-out of the bus may need a lock and its release: `block`, then `write` with MODE=0x0000 --move"
                }
            };
            output.complain(&format!(
                "drive {node}: its errors stay: their causes are there{hint}"
            ));
            exit = Exit::Failed;
        }
    }
    Ok(exit)
}

/// Does it to every drive first, and then reports the state of each. A drive that does not answer does not keep the others from it.
fn each(
    session: &mut Session,
    drives: &[Axis],
    output: &mut Output,
    call: impl Fn(&mut Driver<'_>, Axis) -> Result<&'static str, Error>,
) -> Result<Exit, Failure> {
    let mut driver = session.driver();
    let done: Vec<_> = drives.iter().map(|axis| call(&mut driver, *axis)).collect();
    driver.run(SCANS)?;
    let mut exit = Exit::Passed;
    for (axis, done) in drives.iter().zip(done) {
        let state = done.and_then(|done| {
            let errors = driver.read(*axis, 0x8F)?.data.bits();
            let ready = driver.read(*axis, 0xE2)?.data.bits() & 1;
            Ok((done, ready, errors))
        });
        match state {
            Err(error) => exit = exit.max(Failure::from(error).tell(output)),
            Ok((done, ready, errors)) => {
                let ready = ["not ready", "ready"][ready as usize];
                let errors: Vec<_> = set_bits(ERRORS, errors).map(|bit| bit.name).collect();
                let errors = match errors.is_empty() {
                    true => String::new(),
                    false => format!(", errors {}", errors.join(" ")),
                };
                let node = axis.node;
                output.result(&format!("drive {node}: {done}; {ready}{errors}\n"))?;
            }
        }
    }
    Ok(exit)
}
