//! `drivebench fuzz`: generated conversations, and what the kept inputs of the fuzz targets reach.

mod line;
mod replay;
pub(crate) mod rig;
mod run;
mod verify;
mod watch;

use super::exit::Exit;
use super::output::Output;
use crate::explore::{FuzzCase, FuzzRun};
use clap::Subcommand;

pub(crate) use line::LineFuzz;
pub(crate) use rig::{on_ports, scope, sizes, tell};
pub(crate) use verify::verify;

/// The commands of `fuzz`.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Play random conversations and report every byte that differs from the manual.
    Run(run::FuzzRunArguments),
    /// Play the conversations that a run has kept, the most telling first.
    Replay(replay::ReplayArguments),
    /// Count the cases that it takes to find each planted deviation.
    Power(crate::buses::commands::power::PowerArguments),
    /// Show which protocol transitions the kept inputs reach.
    ///
    /// The exit code is 1 if a reachable transition is missing.
    Coverage(crate::buses::commands::coverage::CoverageArguments),
    /// Add the inputs of a grown corpus that reach something new to the kept ones.
    Distil(crate::buses::commands::distil::DistilArguments),
}

/// The exit code of cases that were played.
fn exit_of_cases<C: FuzzCase>(campaign: &FuzzRun<C>) -> Exit {
    let progress = campaign.progress();
    match campaign.findings() {
        (0, 0) if progress.not_sent < progress.cases => Exit::Passed,
        // Something differed once, or no case was judged.
        (0, _) => Exit::Incomplete,
        _ => Exit::Failed,
    }
}

/// Does it.
pub(crate) fn fuzz(command: &FuzzCommand, output: &mut Output) -> std::io::Result<Exit> {
    match command {
        FuzzCommand::Run(arguments) => run::run(arguments, output),
        FuzzCommand::Replay(arguments) => replay::replay(arguments, output),
        FuzzCommand::Power(arguments) => crate::buses::commands::power::power(arguments, output),
        FuzzCommand::Coverage(arguments) => {
            crate::buses::commands::coverage::coverage(arguments, output)
        }
        FuzzCommand::Distil(arguments) => crate::buses::commands::distil::distil(arguments, output),
    }
}
