//! What the commands ask of the bus of a rig.

use super::check::check;
use super::drive::DriveCommand;
use super::drives::{CommandDrives, perform};
use super::exit::Exit;
use super::failure::Failure;
use super::fuzz::FuzzCommands;
use super::held::{HeldBench, HeldPort};
use super::output::Output;
use super::port_bench::PortBench;
use super::rig_failure::exit_of;
use crate::explore::line::{LineRig, LineTalk};
use crate::rig::playing::run::{PortJudge, PortRun};
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
    pub check: Check,
    /// Explores its drives.
    pub fuzz: FuzzCommands,
}

/// Runs `rig check`.
type Check = fn(&Rig, &UseOptions, bool, &mut Output) -> Result<Exit, Failure>;

impl RigCommands {
    /// Those of a bus behind `[port.1]`.
    pub const fn of_port<D: CommandDrives, B: LineRig>() -> Self {
        Self {
            // Of a file of its own the drives are set up, or the limits are to be tried.
            is_bare: |rig| rig.origin.starts_with("sim:"),
            run: |rig, options| Ok(Box::new(PortRun::<D::Player>::open(rig, options)?)),
            judge: |rig, qualifies| Ok(Box::new(PortJudge::<D::Player>::new(rig, qualifies))),
            command: |rig, command, output| match rig {
                Some(rig) => perform::<D>(PortBench::Rig(&rig), &command, output),
                None => Err(Failure::refused("--rig names no bench of this bus")),
            },
            hold: |rig, options, _| {
                let held = HeldPort::<D>::open(rig, options).map_err(unusable)?;
                Ok(Box::new(held))
            },
            check: check::<D>,
            fuzz: FuzzCommands::of::<LineTalk<B>>(),
        }
    }
}

/// A rig that cannot be used, as the failure of a command.
pub fn unusable(error: SessionError) -> Failure {
    match error {
        SessionError::Mistakes(problems) => Failure::from(*problems),
        error => Failure::Said(exit_of(&error), error.to_string()),
    }
}
