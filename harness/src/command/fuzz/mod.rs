//! What `fuzz`, `shrink` and `promote` do on every bus.

mod line;
pub(crate) mod promote;
pub(crate) mod replay;
pub(crate) mod rig;
pub(crate) mod run;
pub(crate) mod shrink;
mod verify;
pub(crate) mod watch;

use crate::command::exit::Exit;
use crate::explore::{FuzzCase, FuzzRun};

pub(crate) use line::LineFuzz;
pub(crate) use rig::{on_ports, scope, sizes, tell};
pub(crate) use verify::verify;

/// The exit code of cases that were played.
pub(crate) fn exit_of_cases<C: FuzzCase>(campaign: &FuzzRun<C>) -> Exit {
    let progress = campaign.progress();
    match campaign.findings() {
        (0, 0) if progress.not_sent < progress.cases => Exit::Passed,
        // Something differed once, or no case was judged.
        (0, _) => Exit::Incomplete,
        _ => Exit::Failed,
    }
}
