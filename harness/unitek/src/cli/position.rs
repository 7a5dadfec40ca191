//! `drivebench position` on UNITEK drives: homing, and a move to a destination (ex 12).

use super::control::start_up;
use super::write::refuse_denied;
use crate::driver::Driver;
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, UnitekDrives};
use harness_bench::command::drive::PositionArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, single};
use harness_bench::command::rig_name::Use;
use harness_bench::scenario::quantity::Quantity;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::master::Job;
use harness_proto::unitek::words::{MODE_LOCK, status};

/// Increments of a revolution (UNITEK 6.1).
const TURN: f64 = 65_536.0;

/// How often a drive is asked whether it has arrived.
const POLL: Span = Span::from_millis(20);

/// How long a drive may show no movement on its way.
const STALLED: Span = Span::from_millis(2_000);

/// Homes a drive, or moves it, and waits until it has arrived.
pub(super) fn position(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &PositionArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    if arguments.init || arguments.speed.is_some() {
        return Err(Failure::refused(
            "--init and --speed are for rings of ND21; the speed of a UNITEK drive is bounded by SPEED_LIMIT (0x34)",
        ));
    }
    let as_what = Use::new("position", arguments.leave, arguments.hold.hold);
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let axis = single::<UnitekDrives>(&arguments.drive, session)?;
        if !arguments.leave {
            return Err(Failure::refused(format!(
                "position: drive {}: its motor will turn; nothing was done, add --move to allow it",
                axis.node
            )));
        }
        let mut driver = session.driver();
        make_ready(&mut driver, axis, output)?;
        if arguments.reference {
            home(&mut driver, axis)?;
            output.result(&format!("drive {}: homed\n", axis.node))?;
        }
        let actual = f64::from(read(&mut driver, axis, 0x6D)?.cast_signed());
        let target = match (&arguments.to, &arguments.by) {
            (Some(to), _) => increments(to),
            (None, Some(by)) => actual + increments(by),
            (None, None) => return Ok(Exit::Passed),
        };
        if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&target) {
            let message = "the destination is out of range: -32768 to 32767 turns expected";
            return Err(Failure::refused(message));
        }
        let data = Data::Long((target.round() as i32).cast_unsigned());
        refuse_denied(&mut driver, &[(axis, Register::of(0x6E), data)])?;
        driver.write(axis, 0x6E, data)?;
        output.say(&format!("drive {}: its motor turns\n", axis.node));
        let at = arrive(&mut driver, axis)?;
        let turns = f64::from(at) / TURN;
        output.result(&format!(
            "drive {}: arrived at {turns:.3} turns\n",
            axis.node
        ))?;
        Ok(Exit::Passed)
    })
}

/// Makes a drive ready to move: its speed limited where the rig's file limits it, and released where it is locked.
fn make_ready(driver: &mut Driver<'_>, axis: Axis, output: &mut Output) -> Result<(), Failure> {
    let node = axis.node;
    let destination = Job::Write {
        register: 0x6E,
        data: Data::Long(0),
    };
    if !driver.permits(axis, destination) {
        // The highest limit that `max_speed` lets pass; none where motors may not turn at all.
        let all: Vec<u16> = (0..=0x7FFF).collect();
        let permitted = all.partition_point(|speed| driver.permits_write(axis, 0x34, *speed));
        if let Some(most) = permitted.checked_sub(1).and_then(|last| all.get(last)) {
            driver.write(axis, 0x34, Data::Short(*most))?;
            output.say(&format!(
                "drive {node}: SPEED_LIMIT (34) set to {most} of 32767, which is `max_speed` of the rig's file\n"
            ));
        }
    }
    if read(driver, axis, 0x51)? & u32::from(MODE_LOCK) != 0 {
        refuse_denied(driver, &start_up(axis))?;
        driver.release(axis)?;
        output.result(&format!("drive {node}: released\n"))?;
    }
    Ok(())
}

fn increments(of: &Quantity) -> f64 {
    of.value.to_f64() * TURN
}

fn read(driver: &mut Driver<'_>, axis: Axis, register: u8) -> Result<u32, Failure> {
    Ok(driver.read(axis, register)?.data.bits())
}

/// Starts homing, and waits until the drive is calibrated.
fn home(driver: &mut Driver<'_>, axis: Axis) -> Result<(), Failure> {
    let start = Data::Short(1);
    refuse_denied(driver, &[(axis, Register::of(0x78), start)])?;
    driver.write(axis, 0x78, start)?;
    let mut end = driver.now() + STALLED;
    let mut last = 0;
    loop {
        let word = read(driver, axis, 0x40)?;
        if word & status::CALIBRATED != 0 {
            return Ok(());
        }
        let at = read(driver, axis, 0x6D)?;
        if at != last {
            (last, end) = (at, driver.now() + STALLED);
        }
        if driver.now() >= end {
            return Err(Failure::drive(format!(
                "drive {} is not calibrated, and does not move (STATUS {word:X}); is it released? `drivebench go` releases it",
                axis.node
            )));
        }
        driver.run(POLL)?;
    }
}

/// Waits until a drive is in tolerance of its destination. Returns where it is.
fn arrive(driver: &mut Driver<'_>, axis: Axis) -> Result<i32, Failure> {
    let mut end = driver.now() + STALLED;
    let mut last = None;
    loop {
        driver.run(POLL)?;
        let at = read(driver, axis, 0x6D)?;
        if read(driver, axis, 0xF4)? & 1 == 1 {
            return Ok(at.cast_signed());
        }
        if last != Some(at) {
            (last, end) = (Some(at), driver.now() + STALLED);
        }
        if driver.now() >= end {
            return Err(Failure::drive(format!(
                "drive {} has not arrived, and does not move; is it released? `drivebench go` releases it",
                axis.node
            )));
        }
    }
}
