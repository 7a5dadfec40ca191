//! Commands on UNITEK drives: one file a command, over the driver [`crate::driver`].

mod bench;
pub(crate) mod cells;
mod control;
pub(crate) mod deviations;
mod held;
mod info;
mod params;
mod position;
mod read;
pub(crate) mod sim;
mod write;

use super::driver;
use crate::rig::UnitekDrives;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::drives::{read, watch};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::output::Output;
use harness_bench::command::params::params;
use harness_bench::command::port_bench::PortBench;

/// Runs a command on a rig, or on one that a session holds.
///
/// # Errors
/// [`Failure`].
pub(crate) fn drive(
    bench: PortBench<'_, UnitekDrives>,
    command: &DriveCommand,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match command {
        DriveCommand::Read(arguments) => read(bench, arguments, output),
        DriveCommand::Write(arguments) => write::write(bench, arguments, output),
        DriveCommand::Info(arguments) => info::info(bench, arguments, output),
        DriveCommand::Watch(arguments) => watch(bench, arguments, output),
        DriveCommand::Params(command) => params(bench, command, output),
        DriveCommand::Position(arguments) => position::position(bench, arguments, output),
        DriveCommand::Go(arguments) => control::go(bench, arguments, output),
        DriveCommand::Stop(arguments) => control::stop(bench, arguments, output),
        DriveCommand::Block(arguments) => control::block(bench, arguments, output),
        DriveCommand::DeleteError(arguments) => control::delete_error(bench, arguments, output),
        DriveCommand::Top(arguments) => info::top(bench, arguments, output),
        DriveCommand::Scope(_)
        | DriveCommand::Reset(_)
        | DriveCommand::Recover(_)
        | DriveCommand::Cyclic(_)
        | DriveCommand::Sim(_) => Err(Failure::refused(
            "this command is for drives of another bus; on UNITEK drives there are read, write, watch, info, top, params, position, go, stop, block and delete-error",
        )),
    }
}

impl From<driver::Error> for Failure {
    fn from(error: driver::Error) -> Self {
        let exit = match &error {
            driver::Error::NoReply { .. }
            | driver::Error::Differs { .. }
            | driver::Error::NotReady { .. }
            | driver::Error::TimeOutStays { .. } => Exit::Failed,
            driver::Error::OtherThanProfile { .. } => Exit::RigError,
            driver::Error::Refused(_) | driver::Error::NoSuchDrive(_) => Exit::Usage,
            driver::Error::Link(trouble) => exit_of_trouble(trouble),
        };
        Self::Bus(exit, error.to_string())
    }
}
