//! What the commands ask of the bus of a rig.

use super::drive::DriveCommand;
use super::exit::Exit;
use super::failure::Failure;
use super::fuzz::FuzzCommands;
use super::held::HeldBench;
use super::output::Output;
use super::rig_failure::exit_of;
use crate::rig::playing::{RecordJudge, RigRun};
use crate::rig::{Rig, SessionError, UseOptions};
use std::rc::Rc;

/// Takes a rig to play scenarios on it.
type OpenRun = fn(&Rig, &UseOptions) -> Result<Box<dyn RigRun>, SessionError>;

/// Judges what was played on a rig again, in a qualification or in a run.
type OpenJudge = fn(&Rig, bool) -> Result<Box<dyn RecordJudge>, String>;

/// Takes a rig for a session.
type OpenSession = fn(&Rig, &UseOptions, &mut Output) -> Result<Box<dyn HeldBench>, Failure>;

/// Runs a command on the drives of a rig; on those of a bench that needs no file where there is none.
type RunCommand = fn(Option<Rc<Rig>>, DriveCommand, &mut Output) -> Result<Exit, Failure>;

/// What the commands ask of the bus of a rig.
pub struct RigCommands {
    /// Whether a rig is simulated and its file says no more than how many drives there are, so that every scenario may bring drives of its own.
    pub is_bare: fn(&Rig) -> bool,
    pub run: OpenRun,
    pub judge: OpenJudge,
    pub command: RunCommand,
    pub hold: OpenSession,
    /// Runs `rig check`, as text or for tools.
    pub check: fn(&Rig, &UseOptions, bool, &mut Output) -> Result<Exit, Failure>,
    /// Explores its drives.
    pub fuzz: FuzzCommands,
}

/// A rig that cannot be used, as the failure of a command.
pub fn unusable(error: SessionError) -> Failure {
    match error {
        SessionError::Mistakes(problems) => Failure::from(*problems),
        error => Failure::Said(exit_of(&error), error.to_string()),
    }
}
