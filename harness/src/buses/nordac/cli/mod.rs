//! Commands on NORDAC inverters: one file a command.

mod check;

pub(crate) use check::check;

use crate::buses::commands::DriveCommand;
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::fuzz::FuzzRunArguments;
use crate::cli::output::Output;
use crate::rig::Rig;

/// Runs a command on a rig.
///
/// # Errors
/// [`Failure`].
pub(crate) fn drive(_: &Rig, _: &DriveCommand, _: &mut Output) -> Result<Exit, Failure> {
    Err(Failure::refused(
        "this command is not for NORDAC inverters; `rig check` is",
    ))
}

/// Explores the inverters of a rig.
///
/// # Errors
/// The output cannot be written.
pub(crate) fn fuzz(_: &Rig, _: &FuzzRunArguments, output: &mut Output) -> std::io::Result<Exit> {
    output.complain("`fuzz run` is not for NORDAC inverters yet");
    Ok(Exit::Usage)
}
