//! Drives of a port that a session holds.

use crate::rig::OfUnitek as _;
use crate::rig::Player;
use crate::rig::UnitekDrives;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::held::HeldDrives;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::PortBench;
use harness_bench::rig::port_session::PortSession;
use harness_proto::time::Span;

impl HeldDrives for UnitekDrives {
    const SPEED: &'static str = "SPEED_ACTUAL";

    type Player = Player;

    fn perform(
        bench: PortBench<'_, Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(bench, command, output)
    }

    fn pass(session: &mut PortSession<Self>, time: Span) -> Result<(), Failure> {
        Ok(session.driver().run(time)?)
    }
}
