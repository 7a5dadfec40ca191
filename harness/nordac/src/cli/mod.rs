//! Commands on NORDAC inverters: one file a command, over the driver [`crate::driver`].

mod bench;
pub(crate) mod cells;
mod control;
mod held;
mod info;
mod params;
mod read;
pub(crate) mod sim;
mod write;

use super::driver;
use crate::rig::Inverters;
pub(super) use bench::Parked;
use control::Stop;
use harness_bench::command::cyclic::CyclicCommand;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::drives::{read, watch};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::output::Output;
use harness_bench::command::params::params;
use harness_bench::command::port_bench::PortBench;

/// The calls that stop motors, with their names on the command line.
const OFF: (&str, Stop) = ("off", |driver, slave| driver.off(slave));
const STOP: (&str, Stop) = ("stop", |driver, slave| driver.off(slave));
const BLOCK: (&str, Stop) = ("block", |driver, slave| driver.block(slave));
const QUICK_STOP: (&str, Stop) = ("quick-stop", |driver, slave| driver.quick_stop(slave));

/// Runs a command on a rig, or on one that a session holds.
///
/// # Errors
/// [`Failure`].
pub(crate) fn drive(
    bench: PortBench<'_, Inverters>,
    command: &DriveCommand,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match command {
        DriveCommand::Read(own) => read(bench, own, output),
        DriveCommand::Write(own) => write::write(bench, own, output),
        DriveCommand::Info(own) => info::info(bench, own, output),
        DriveCommand::Watch(own) => watch(bench, own, output),
        DriveCommand::Top(own) => info::top(bench, own, output),
        DriveCommand::Params(command) => params(bench, command, output),
        DriveCommand::Stop(own) => control::stop(bench, STOP, own, output),
        DriveCommand::Block(own) => control::stop(bench, BLOCK, own, output),
        DriveCommand::Cyclic(CyclicCommand::Start(own)) => control::start(bench, own, output),
        DriveCommand::Cyclic(CyclicCommand::Exchange(own)) => control::exchange(bench, own, output),
        DriveCommand::Cyclic(CyclicCommand::On(own)) => control::on(bench, own, output),
        DriveCommand::Cyclic(CyclicCommand::Off(own)) => control::stop(bench, OFF, own, output),
        DriveCommand::Cyclic(CyclicCommand::QuickStop(own)) => {
            control::stop(bench, QUICK_STOP, own, output)
        }
        DriveCommand::Cyclic(CyclicCommand::Acknowledge(own)) => {
            control::acknowledge(bench, own, output)
        }
        DriveCommand::Go(own) => control::go(bench, own, output),
        DriveCommand::DeleteError(_)
        | DriveCommand::Position(_)
        | DriveCommand::Scope(_)
        | DriveCommand::Reset(_)
        | DriveCommand::Recover(_)
        | DriveCommand::Sim(_) => Err(Failure::refused(
            "this command is for drives of another bus; on NORDAC inverters there are start, exchange, on, off, quick-stop, stop, block, acknowledge, read, write, watch, info, top and params",
        )),
    }
}

impl From<driver::Error> for Failure {
    fn from(error: driver::Error) -> Self {
        use driver::Error;
        let exit = match &error {
            Error::Link(trouble) => exit_of_trouble(trouble),
            error if error.is_not_blocked() => Exit::NotSafe,
            Error::Taken { .. } | Error::OtherMaster { .. } | Error::NotSent => Exit::RigError,
            Error::NotRunning(_) | Error::NoChannel { .. } | Error::Setpoint { .. } => Exit::Usage,
            _ => Exit::Failed,
        };
        Self::Bus(exit, error.to_string())
    }
}
