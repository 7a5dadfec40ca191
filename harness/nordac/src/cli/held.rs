//! Drives of a port that a session holds.

use crate::rig::Inverters;
use crate::rig::Player;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::PortBench;
use harness_bench::link::Line;
use harness_bench::rig::port_session::PortSession;
use harness_proto::time::Span;

impl HeldDrives for Inverters {
    const SPEED: &'static str = "HIW";

    type Player = Player;

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(bench, command, output)
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
