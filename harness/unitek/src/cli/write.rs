//! `drivebench write` on UNITEK drives: registers are set, read back and shown.

use super::bench::scaling;
use crate::driver::Driver;
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, UnitekDrives};
use crate::value::{assignment, hex, words};
use harness_bench::command::drive::WriteArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::master::Job;
use harness_proto::unitek::units::Scaling;

/// A write that is to be done.
pub(super) type Order = (Axis, &'static Register, Data);

/// Writes registers and shows what they read.
pub(super) fn write(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &WriteArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let texts = arguments.values.iter();
    let values = texts
        .map(|text| assignment(text))
        .collect::<Result<Vec<_>, _>>();
    let values = values.map_err(Failure::refused)?;
    let as_what = Use::new("write", arguments.leave, arguments.hold.hold);
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let drives = select(std::slice::from_ref(&arguments.drives), session)?;
        let mut driver = session.driver();
        let mut orders = Vec::new();
        for axis in drives {
            let scaling = scaling(&mut driver, axis)?;
            for assignment in &values {
                let data = assignment.value.data(assignment.register, scaling);
                orders.push((axis, assignment.register, data.map_err(Failure::refused)?));
            }
        }
        refuse_denied(&mut driver, &orders)?;
        let mut exit = Exit::Passed;
        for (axis, register, data) in orders {
            exit = exit.max(one(&mut driver, (axis, register, data), output)?);
        }
        Ok(exit)
    })
}

/// Refuses writes of which one is denied, before the first is sent. A write that an earlier one permits, such as a speed of 0 after a
/// lock, is judged when it is due.
pub(super) fn refuse_denied(driver: &mut Driver<'_>, orders: &[Order]) -> Result<(), Failure> {
    let job = |(axis, register, data): &Order| {
        let register = register.number;
        (
            *axis,
            Job::Write {
                register,
                data: *data,
            },
        )
    };
    let jobs: Vec<_> = orders.iter().map(job).collect();
    match driver.denied(&jobs) {
        None => Ok(()),
        Some(why) => Err(Failure::refused(format!("nothing was written: {why}"))),
    }
}

/// Writes a register, and shows what it reads.
fn one(
    driver: &mut Driver<'_>,
    (axis, register, data): Order,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let name = format!(
        "drive {} {:02X} {}",
        axis.node, register.number, register.name
    );
    match driver.write(axis, register.number, data) {
        Ok(Some(reply)) => {
            let scaling = scaling(driver, axis).unwrap_or_else(|_| Scaling::default());
            let words = words(&reply, scaling);
            let line = format!("{name} = {} {words}", hex(reply.data));
            output.result(&format!("{}\n", line.trim_end()))?;
            Ok(Exit::Passed)
        }
        Ok(None) => {
            let line = format!(
                "{name}: {} was sent; a write is never answered, and this register keeps no value",
                hex(data)
            );
            output.result(&format!("{line}\n"))?;
            Ok(Exit::Passed)
        }
        Err(error @ crate::driver::Error::Differs { .. }) => Ok(Failure::from(error).tell(output)),
        Err(error) => Err(error.into()),
    }
}
