//! What `fuzz`, `shrink` and `promote` do on every bus.

pub mod case;
pub mod line;
pub mod power;
pub mod promote;
pub mod replay;
pub mod run;
pub mod shrink;
pub mod verify;
pub mod watch;

use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::rig_failure::exit_of;
use crate::evidence::Signer;
use crate::explore::page::page;
use crate::explore::promote::Plays;
use crate::explore::{ExploreError, FuzzCase, FuzzRun};
use crate::rig::Rig;
use crate::rig::buses::RigBuses;
use case::ExploredCase;
use power::PowerArguments;
use promote::PromoteArguments;
use replay::ReplayArguments;
use run::FuzzRunArguments;
use shrink::ShrinkArguments;
use std::path::Path;
use verify::verify_as;

/// What the commands do with the drives of a bus.
pub struct FuzzCommands {
    /// `fuzz run`
    pub run: fn(&Rig, &FuzzRunArguments, &mut Output) -> std::io::Result<Exit>,
    /// `fuzz replay`
    pub replay: fn(&Rig, &ReplayArguments, &mut Output) -> std::io::Result<Exit>,
    /// `shrink`
    pub shrink: fn(&ShrinkArguments, &'static RigBuses, &mut Output) -> std::io::Result<Exit>,
    /// `promote`
    pub promote: fn(&PromoteArguments, Plays, &mut Output) -> std::io::Result<Exit>,
    /// `verify` of the folder of a run; `None` if the folder has no run of this bus.
    pub verify: Verify,
    /// `fuzz power`, where the bus has it.
    pub power: Option<PowerRun>,
    /// The page of a run, made from its folder.
    pub page: Page,
}

impl FuzzCommands {
    /// The commands on the drives of a bus.
    pub const fn of<C: ExploredCase>() -> Self {
        Self {
            run: run::run::<C>,
            replay: replay::replay::<C>,
            shrink: shrink::shrink::<C>,
            promote: promote::keep::<C>,
            verify: verify_as::<C>,
            power: None,
            page: page::<C>,
        }
    }
}

/// Makes the page of the run in a folder.
type Page = fn(&Path) -> Result<String, ExploreError>;

/// Counts the cases that it takes to find each deviation.
type PowerRun = fn(&PowerArguments, &'static RigBuses, &mut Output) -> std::io::Result<Exit>;

/// Judges the findings of a run again.
type Verify = fn(&Path, Option<Signer<'_>>, &mut Output) -> Option<std::io::Result<Exit>>;

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
