//! Drives of a port that a session holds.

use crate::buses::unitek::rig::OfUnitek as _;
use crate::buses::unitek::rig::Player;
use crate::buses::unitek::rig::UnitekDrives;
use crate::command::drive::DriveCommand;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::held::HeldDrives;
use crate::command::output::Output;
use crate::command::port_bench::PortBench;
use crate::rig::port_session::PortSession;
use harness_proto::time::Span;

impl HeldDrives for UnitekDrives {
    const SPEED: &'static str = "SPEED_ACTUAL";

    type Player = Player;

    fn perform(
        session: &mut PortSession<Self>,
        command: &DriveCommand,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        super::drive(PortBench::Held(session), command, output)
    }

    fn pass(session: &mut PortSession<Self>, time: Span) -> Result<(), Failure> {
        Ok(session.driver().run(time)?)
    }
}
