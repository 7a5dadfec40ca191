//! Drives of a port that a session holds.

use crate::buses::nordac::rig::Inverters;
use crate::buses::nordac::rig::Player;
use crate::command::drive::DriveCommand;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::held::HeldDrives;
use crate::command::output::Output;
use crate::command::port_bench::PortBench;
use crate::link::Line;
use crate::rig::port_session::PortSession;
use harness_proto::time::Span;

impl HeldDrives for Inverters {
    const SPEED: &'static str = "HIW";

    type Player = Player;

    fn perform(
        session: &mut PortSession<Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(PortBench::Held(session), command, output)
    }

    fn pass(session: &mut PortSession<Self>, time: Span) -> Result<(), Failure> {
        let mut driver = super::bench::driver(session);
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
