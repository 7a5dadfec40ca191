//! Commands on UNITEK drives: one file a command, over the driver [`crate::buses::unitek::driver`].

mod bench;
pub(crate) mod cells;
mod check;
mod control;
pub(crate) mod deviations;
mod info;
mod params;
mod position;
mod read;
mod watch;
mod write;

pub(crate) use check::check;

use super::driver;
use crate::buses::commands::{DriveCommand, ParamsCommand};
use crate::cli::exit::Exit;
use crate::cli::failure::{Failure, exit_of_trouble};
use crate::cli::output::Output;
use crate::rig::Rig;

/// Runs a command on a rig.
///
/// # Errors
/// [`Failure`].
pub(crate) fn drive(
    rig: &Rig,
    command: &DriveCommand,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match command {
        DriveCommand::Read(arguments) => read::read(rig, arguments, output),
        DriveCommand::Write(arguments) => write::write(rig, arguments, output),
        DriveCommand::Info(arguments) => info::info(rig, arguments, output),
        DriveCommand::Watch(arguments) => watch::watch(rig, arguments, output),
        DriveCommand::Params(ParamsCommand::Save(arguments)) => {
            params::save(rig, arguments, output)
        }
        DriveCommand::Params(ParamsCommand::Diff(arguments)) => {
            params::diff(rig, arguments, output)
        }
        DriveCommand::Params(ParamsCommand::Load(arguments)) => {
            params::load(rig, arguments, output)
        }
        DriveCommand::Position(arguments) => position::position(rig, arguments, output),
        DriveCommand::Go(arguments) => control::go(rig, arguments, output),
        DriveCommand::Stop(arguments) => control::stop(rig, arguments, output),
        DriveCommand::Block(arguments) => control::block(rig, arguments, output),
        DriveCommand::DeleteError(arguments) => control::delete_error(rig, arguments, output),
        DriveCommand::Top(arguments) => info::top(rig, arguments, output),
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
            | driver::Error::NotReady { .. } => Exit::Failed,
            driver::Error::OtherThanProfile { .. } => Exit::RigError,
            driver::Error::Refused(_) | driver::Error::NoSuchDrive(_) => Exit::Usage,
            driver::Error::Link(trouble) => exit_of_trouble(trouble),
        };
        Self::Bus(exit, error.to_string())
    }
}
