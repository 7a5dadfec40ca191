//! What `fuzz`, `shrink` and `promote` do on every bus.

pub mod line;
pub mod promote;
pub mod replay;
pub mod run;
pub mod shrink;
pub mod verify;
pub mod watch;

use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::exit_of;
use crate::explore::{ExploreError, FuzzCase, FuzzRun};

pub use line::LineFuzz;
pub use verify::verify;

/// Tells why exploring ended early, and gives the exit code for it.
pub fn tell(error: &ExploreError, output: &mut Output) -> Exit {
    match error {
        ExploreError::Mistakes(problems) => output.mistakes(problems),
        other => output.complain(&other.to_string()),
    }
    match error {
        ExploreError::Session(error) => exit_of(error),
        ExploreError::Mistakes(_) | ExploreError::File(_) | ExploreError::Usage(_) => Exit::Usage,
        ExploreError::Lost(_) | ExploreError::Unwritable(_) => Exit::RigError,
    }
}

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
