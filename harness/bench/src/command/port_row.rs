//! What the commands ask of a bus behind `[port.1]`, as a row of a table.

use super::drive::DriveCommand;
use super::exit::Exit;
use super::failure::Failure;
use super::fuzz::LineFuzz;
use super::held::HeldBench;
use super::output::Output;
use crate::rig::port_file::PortBus;
use crate::rig::segment::{SegmentJudge, SegmentRun};
use crate::rig::{Rig, SessionError, UseOptions};

/// Takes a rig to play scenarios on it.
type OpenRun = fn(&Rig, &UseOptions) -> Result<Box<dyn SegmentRun>, SessionError>;

/// Takes a rig for a session.
type OpenSession = fn(&Rig, &UseOptions) -> Result<Box<dyn HeldBench>, SessionError>;

/// Judges what was played on a rig again.
type OpenJudge = fn(&Rig, bool, bool) -> Box<dyn SegmentJudge>;

/// What the commands ask of a bus behind `[port.1]`.
pub struct PortCommands {
    pub bus: PortBus,
    /// Takes a rig to play scenarios on it.
    pub run: OpenRun,
    /// Judges what was played again, with or without `--allow-motion`, by a qualification or by a run.
    pub judge: OpenJudge,
    /// Runs a command on its drives.
    pub command: fn(&Rig, &DriveCommand, &mut Output) -> Result<Exit, Failure>,
    /// Takes a rig for a session.
    pub hold: OpenSession,
    /// Runs `rig check`, as text or for tools.
    pub check: fn(&Rig, &UseOptions, bool, &mut Output) -> Result<Exit, Failure>,
    /// Explores its drives.
    pub fuzz: LineFuzz,
}
