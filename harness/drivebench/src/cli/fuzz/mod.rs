//! `drivebench fuzz`: generated conversations, and what the kept inputs of the fuzz targets reach.

mod coverage;
mod distil;
mod run;

use crate::bus_name::BusName;
use crate::buses::{RIG_BUSES, bus_of, find_any_rig, fuzz_of};
use crate::command::exit::Exit;
use crate::command::fuzz::power::PowerArguments;
use crate::command::fuzz::replay::ReplayArguments;
use crate::command::fuzz::run::FuzzRunArguments;
use crate::command::output::Output;
use clap::Subcommand;

/// The commands of `fuzz`.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Play random conversations and report every byte that differs from the manual.
    #[command(mut_arg("deviates", |argument| argument.value_parser(run::planted)))]
    Run(FuzzRunArguments),
    /// Play the conversations that a run has kept, the most telling first.
    Replay(ReplayArguments),
    /// Count the cases that it takes to find each planted deviation.
    Power(PowerArguments),
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
        FuzzCommand::Replay(arguments) => replay(arguments, output),
        FuzzCommand::Power(arguments) => {
            let power = fuzz_of(BusName::DEFAULT).and_then(|fuzz| fuzz.power);
            power.map_or(Ok(Exit::Usage), |power| {
                power(arguments, &RIG_BUSES, output)
            })
        }
        FuzzCommand::Coverage(arguments) => coverage::coverage(arguments, output),
        FuzzCommand::Distil(arguments) => distil::distil(arguments, output),
    }
}

/// Plays again what a run has kept.
fn replay(arguments: &ReplayArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(rig) = find_any_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    match fuzz_of(bus_of(&rig).name) {
        Some(fuzz) => (fuzz.replay)(&rig, arguments, output),
        None => Ok(Exit::Usage),
    }
}
