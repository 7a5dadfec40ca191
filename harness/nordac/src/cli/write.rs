//! `drivebench write` on NORDAC inverters: parameters are written, and the value that the inverter answers is shown.

use super::bench::driver;
use crate::driver::{Driver, Error, WriteResult};
use crate::rig::Inverters;
use crate::value::{Assignment, assignments, shown};
use harness_bench::command::drive::WriteArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_proto::nordac::{DEFAULT_ADDRESS, Image, Pkw, Task};

/// The parameters that are the address, and that load factory settings.
const ADDRESS: u16 = 1624;
const FACTORY: [u16; 2] = [970, 1602];

/// Writes parameters and shows what the slave answers.
pub(super) fn write(
    bench: PortBench<'_, Inverters>,
    arguments: &WriteArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let orders = assignments(&arguments.values).map_err(Failure::refused)?;
    let as_what = Use::new("write", arguments.leave, arguments.hold.hold);
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let slaves = select(std::slice::from_ref(&arguments.drives), session)?;
        let mut driver = driver(session);
        for slave in &slaves {
            driver.join(*slave)?;
            refuse_denied(&driver, *slave, &orders)?;
        }
        let mut exit = Exit::Passed;
        for slave in slaves {
            let mut at = slave;
            for order in &orders {
                let (now_at, order_exit) = one(&mut driver, at, order, output)?;
                exit = exit.max(order_exit);
                let Some(now_at) = now_at else {
                    break;
                };
                at = now_at;
            }
        }
        Ok(exit)
    })
}

/// Refuses writes of which one is denied, before the first is sent.
pub(super) fn refuse_denied(
    driver: &Driver<'_>,
    slave: u8,
    orders: &[Assignment],
) -> Result<(), Failure> {
    for order in orders {
        let parameter = order.parameter.parameter;
        let raw = parameter.raw_of(order.number).unwrap_or_default();
        let ak = Task::change(parameter).ak();
        let image = Image::from(Pkw::of(ak, parameter.number, order.parameter.ind(), raw));
        if let Some(why) = driver.denied(slave, &image)? {
            return Err(Failure::refused(format!("nothing was written: {why}")));
        }
    }
    Ok(())
}

/// Writes a parameter. Returns the address of the slave afterwards; `None` where nothing more can be written.
fn one(
    driver: &mut Driver<'_>,
    slave: u8,
    order: &Assignment,
    output: &mut Output,
) -> Result<(Option<u8>, Exit), Failure> {
    let Assignment { parameter, number } = *order;
    let known = parameter.parameter;
    let name = format!("slave {slave}: {parameter} {}", known.name);
    match driver.write(slave, &parameter, number) {
        Ok(WriteResult::Holds(holds)) => {
            output.result(&format!("{name} = {}\n", shown(&parameter, holds)))?;
            Ok((Some(slave), Exit::Passed))
        }
        Ok(WriteResult::Restarted) => {
            let at = match known.number {
                ADDRESS => u8::try_from(number).unwrap_or(slave),
                number if FACTORY.contains(&number) => DEFAULT_ADDRESS,
                _ => slave,
            };
            let started = driver.start(at, None);
            let about = match &started {
                Ok(started) => format!("it is back at address {at} with {}", started.ppo),
                Err(error) => format!("it is not back at address {at}: {error}"),
            };
            let value = shown(&parameter, number);
            output.result(&format!(
                "{name} = {value}; its module restarted, {about}\n"
            ))?;
            Ok(match started {
                Ok(_) => (Some(at), Exit::Passed),
                Err(_) => (None, Exit::Failed),
            })
        }
        Err(error @ (Error::Refused { .. } | Error::Differs { .. })) => {
            Ok((Some(slave), Failure::from(error).tell(output)))
        }
        Err(error) => Err(error.into()),
    }
}
