//! `drivebench fuzz`: generated conversations, and what the kept inputs of the fuzz targets reach.

mod replay;
pub(crate) mod rig;
mod run;
mod verify;
mod watch;

use super::exit::Exit;
use super::output::Output;
use clap::Subcommand;

pub(crate) use rig::{Use, on_ports, scope, sizes, tell};
pub(crate) use verify::verify;

/// The commands of `fuzz`.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Make conversations from a seed and look for a byte that differs from the manual; every finding is a scenario.
    Run(run::FuzzRunArguments),
    /// Try the conversations that a run has kept, or those of a corpus, the ones that show most first.
    Replay(replay::ReplayArguments),
    /// Show how many cases it takes to find each planned deviation of a drive.
    Power(crate::buses::commands::power::PowerArguments),
    /// Show which protocol transitions the kept inputs reach, and what those of each target reach; exit code 1 where a reachable transition is missing.
    Coverage(crate::buses::commands::coverage::CoverageArguments),
    /// Choose from a grown corpus the few small inputs that reach what the kept ones do not, and put them beside those.
    Distil(crate::buses::commands::distil::DistilArguments),
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
