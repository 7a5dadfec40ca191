//! Commands on NORDAC inverters over the driver [`crate::driver`]: `drives` has what they share with other buses.

mod bench;
pub(crate) mod cells;
mod control;
mod drives;
mod info;
mod params;
mod read;
pub(crate) mod sim;
mod write;

use super::driver;
use crate::rig::{Inverters, Player, Session};
pub(super) use bench::ParkedDriver;
use control::Stop;
use harness_bench::command::cyclic::CyclicCommand;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::PortBench;
use harness_bench::link::Line as _;
use harness_proto::time::Span;

/// The calls that stop motors, with their names on the command line.
const OFF: (&str, Stop) = ("off", |driver, slave| driver.off(slave));
const STOP: (&str, Stop) = ("stop", |driver, slave| driver.off(slave));
const BLOCK: (&str, Stop) = ("block", |driver, slave| driver.block(slave));
const QUICK_STOP: (&str, Stop) = ("quick-stop", |driver, slave| driver.quick_stop(slave));

impl HeldDrives for Inverters {
    const WORDS: [&'static str; 2] = ["slave", "PROFIBUS segment"];
    const SPEED: &'static str = "HIW";

    /// Its address.
    type Drive = u8;
    type Player = Player;

    fn listed(&self) -> Vec<u8> {
        self.slaves.iter().map(|slave| slave.address).collect()
    }

    fn number(address: &u8) -> u8 {
        *address
    }

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        match command {
            DriveCommand::Write(args) => write::write(bench, args, output),
            DriveCommand::Stop(args) => control::stop(bench, STOP, args, output),
            DriveCommand::Block(args) => control::stop(bench, BLOCK, args, output),
            DriveCommand::Cyclic(CyclicCommand::Start(args)) => control::start(bench, args, output),
            DriveCommand::Cyclic(CyclicCommand::Exchange(args)) => {
                control::exchange(bench, args, output)
            }
            DriveCommand::Cyclic(CyclicCommand::On(args)) => control::on(bench, args, output),
            DriveCommand::Cyclic(CyclicCommand::Off(args)) => {
                control::stop(bench, OFF, args, output)
            }
            DriveCommand::Cyclic(CyclicCommand::QuickStop(args)) => {
                control::stop(bench, QUICK_STOP, args, output)
            }
            DriveCommand::Cyclic(CyclicCommand::Acknowledge(args)) => {
                control::acknowledge(bench, args, output)
            }
            DriveCommand::Go(args) => control::go(bench, args, output),
            _ => Err(Failure::refused(
                "this command is for drives of another bus; on NORDAC inverters there are start, exchange, on, off, quick-stop, stop, block, acknowledge, read, write, watch, info, top and params",
            )),
        }
    }

    fn pass(session: &mut Session, time: Span) -> Result<(), Failure> {
        let mut driver = bench::driver(session);
        if driver.slaves().next().is_some() {
            return Ok(driver.run(time)?);
        }
        drop(driver);
        let link = session.link();
        let end = link.now() + time;
        while link.now() < end && link.wait(end) {}
        Ok(())
    }

    fn forget(&self) {
        *self
            .parked
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner) = None;
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
