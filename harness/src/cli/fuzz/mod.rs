//! `drivebench fuzz`: what the kept inputs of the fuzz targets reach.

mod coverage;

use super::exit::Exit;
use super::output::Output;
use clap::Subcommand;
use coverage::CoverageArguments;

/// The commands about fuzzing.
#[derive(Debug, Subcommand)]
pub enum FuzzCommand {
    /// Show which protocol transitions the kept inputs reach; exit code 1 where a reachable one is missing.
    Coverage(CoverageArguments),
}

/// Runs one of them.
pub(super) fn fuzz(command: &FuzzCommand, output: &mut Output) -> std::io::Result<Exit> {
    match command {
        FuzzCommand::Coverage(arguments) => coverage::coverage(arguments, output),
    }
}
