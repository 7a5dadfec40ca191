//! Commands on a bus: one file a command, over the driver [`crate::driver`].

mod axes;
pub(crate) mod cells;
mod control;
pub(crate) mod deviations;
pub(crate) mod fuzz;
mod held;
mod info;
mod params;
mod params_file;
mod position;
mod read;
mod recover;
mod rig;
mod rig_check;
mod scope;
mod signal;
pub(crate) mod sim;
mod top;
mod top_page;
mod write;

pub(crate) use rig::give_back_session;

use crate::driver;
use crate::rig::sim::is_bare;
use crate::rig::{RingJudge, RingRun};
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::output::Output;
use harness_bench::command::rig_commands::RigCommands;

/// Commands on rigs with rings.
pub(crate) const COMMANDS: RigCommands = RigCommands {
    is_bare,
    run: |rig, options| Ok(Box::new(RingRun::open(rig, options)?)),
    judge: |rig, qualifies| Ok(Box::new(RingJudge::new(rig, qualifies)?)),
    command: |rig, mut command, output| {
        if let Some(arguments) = command.rig_mut() {
            arguments.found = rig;
        }
        perform(&command, output)
    },
    hold: held::hold,
    check: rig_check::check,
    fuzz: fuzz::COMMANDS,
};

/// Runs a command.
///
/// # Errors
/// [`Failure`].
fn perform(command: &DriveCommand, output: &mut Output) -> Result<Exit, Failure> {
    match command {
        DriveCommand::Read(arguments) => read::read(arguments, output),
        DriveCommand::Write(arguments) => write::write(arguments, output),
        DriveCommand::Info(arguments) => info::info(arguments, output),
        DriveCommand::Watch(arguments) => read::watch(arguments, output),
        DriveCommand::Top(arguments) => top::top(arguments, output),
        DriveCommand::Params(command) => params::params(command, output),
        DriveCommand::Scope(arguments) => scope::scope(arguments, output),
        DriveCommand::Position(arguments) => position::position(arguments, output),
        DriveCommand::Go(arguments) => control::go(arguments, output),
        DriveCommand::Stop(arguments) => control::stop(arguments, output),
        DriveCommand::Block(arguments) => control::block(arguments, output),
        DriveCommand::Reset(arguments) => control::reset(arguments, output),
        DriveCommand::DeleteError(arguments) => control::delete_error(arguments, output),
        DriveCommand::Recover(arguments) => recover::recover(arguments, output),
        DriveCommand::Cyclic(_) | DriveCommand::Sim(_) => Err(Failure::refused(
            "this command is for slaves with a cyclic master, such as --rig sim:nordac; on a ring there are go, stop, block and delete-error",
        )),
    }
}

/// The exit code of an error: caused by a drive, by the bench or by the user.
fn exit(error: &driver::Error) -> Exit {
    match error {
        driver::Error::InErrorMode { .. }
        | driver::Error::InReset { .. }
        | driver::Error::Interrupted { .. }
        | driver::Error::NotSet { .. }
        | driver::Error::TimeOut { .. } => Exit::Failed,
        driver::Error::Refused(_) | driver::Error::Value(_) | driver::Error::Open(_) => Exit::Usage,
        driver::Error::Link(trouble) => exit_of_trouble(trouble),
        driver::Error::Unknown(_)
        | driver::Error::Disturbed { .. }
        | driver::Error::Stopped(_)
        | driver::Error::NoSuchOrder => Exit::RigError,
    }
}

impl From<driver::Error> for Failure {
    fn from(error: driver::Error) -> Self {
        Self::Bus(exit(&error), error.to_string())
    }
}
