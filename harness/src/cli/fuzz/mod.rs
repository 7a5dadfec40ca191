//! `drivebench fuzz`: generated conversations, and what the kept inputs of the fuzz targets reach.

mod coverage;
mod distil;
mod replay;
mod run;

use crate::buses::RIG_BUSES;
use crate::command::exit::Exit;
use crate::command::fuzz::replay::ReplayArguments;
use crate::command::fuzz::run::FuzzRunArguments;
use crate::command::output::Output;
use clap::Subcommand;

/// The commands of `fuzz`.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Play random conversations and report every byte that differs from the manual.
    #[command(mut_arg("deviates", |own| own.value_parser(run::planted)))]
    Run(FuzzRunArguments),
    /// Play the conversations that a run has kept, the most telling first.
    Replay(ReplayArguments),
    /// Count the cases that it takes to find each planted deviation.
    Power(crate::buses::commands::power::PowerArguments),
    /// Show which protocol transitions the kept inputs reach.
    ///
    /// The exit code is 1 if a reachable transition is missing.
    Coverage(coverage::CoverageArguments),
    /// Add the inputs of a grown corpus that reach something new to the kept ones.
    Distil(distil::DistilArguments),
}

/// Does it.
pub(crate) fn fuzz(command: &FuzzCommand, output: &mut Output) -> std::io::Result<Exit> {
    match command {
        FuzzCommand::Run(arguments) => run::run(arguments, output),
        FuzzCommand::Replay(arguments) => replay::replay(arguments, output),
        FuzzCommand::Power(arguments) => {
            crate::buses::commands::power::power(arguments, &RIG_BUSES, output)
        }
        FuzzCommand::Coverage(arguments) => coverage::coverage(arguments, output),
        FuzzCommand::Distil(arguments) => distil::distil(arguments, output),
    }
}
