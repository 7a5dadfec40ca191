//! Commands on UNITEK drives over the driver [`crate::driver`]: `drives` has what they share with other buses.

mod bench;
pub(crate) mod cells;
mod control;
mod drives;
mod info;
mod params;
mod position;
mod read;
pub(crate) mod sim;
mod write;

use super::driver;
use crate::rig::{Axis, OfUnitek as _, Player, Session, UnitekDrives};
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::PortBench;
use harness_proto::time::Span;

impl HeldDrives for UnitekDrives {
    const WORDS: [&'static str; 2] = ["drive", "CAN bus"];
    const SPEED: &'static str = "SPEED_ACTUAL";

    type Drive = Axis;
    type Player = Player;

    fn listed(&self) -> Vec<Axis> {
        self.axes.clone()
    }

    fn number(axis: &Axis) -> u8 {
        axis.node
    }

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        match command {
            DriveCommand::Write(arguments) => write::write(bench, arguments, output),
            DriveCommand::Position(arguments) => position::position(bench, arguments, output),
            DriveCommand::Go(arguments) => control::go(bench, arguments, output),
            DriveCommand::Stop(arguments) => control::stop(bench, arguments, output),
            DriveCommand::Block(arguments) => control::block(bench, arguments, output),
            DriveCommand::DeleteError(arguments) => control::delete_error(bench, arguments, output),
            _ => Err(Failure::refused(
                "this command is for drives of another bus; on UNITEK drives there are read, write, watch, info, top, params, position, go, stop, block and delete-error",
            )),
        }
    }

    fn pass(session: &mut Session, time: Span) -> Result<(), Failure> {
        Ok(session.driver().run(time)?)
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
