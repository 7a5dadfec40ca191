//! What the commands that every bus behind `[port.1]` has ask of its drives.

use super::check::CheckedDrive;
use super::drive::{ReadArguments, WatchArguments};
use super::exit::Exit;
use super::failure::Failure;
use super::held::HeldDrives;
use super::output::Output;
use super::params::ParameterFile;
use super::port_bench::{PortBench, on, select};
use super::reading::{CellReading, show};
use super::rig_name::Use;
use super::watch::{WatchBench, WatchedCell, watch as show_again};
use crate::link::Line as _;
use crate::rig::port_session::PortSession;
use harness_proto::time::{Instant, Span};
use std::slice::from_ref;

/// Drives that are read and written by the same commands as those of other buses.
pub trait CommandDrives: HeldDrives {
    /// What is read of a drive: a register or a parameter.
    type Cell;
    type Reading: CellReading;
    /// A value that a file has for a drive.
    type Parameter;

    const PARAMETERS: ParameterFile<Self, Self::Parameter>;

    /// What a command line names, each cell once.
    ///
    /// # Errors
    /// The first name that is wrong, and what is expected, in a sentence.
    fn cells(texts: &[String]) -> Result<Vec<Self::Cell>, String>;

    /// Reads these cells of each drive. A slave of a cyclic master is taken into the exchange first, even if no cell is to be read.
    ///
    /// # Errors
    /// [`Failure`]: a drive does not answer as it must, or the port is lost.
    fn read(
        session: &mut PortSession<Self>,
        drives: &[Self::Drive],
        cells: &[Self::Cell],
    ) -> Result<Vec<Self::Reading>, Failure>;

    /// What `rig check` says of a drive without an answer.
    const SILENT: &'static str;

    /// Asks every drive for `rig check`, unless the bench only listens.
    fn check(session: &mut PortSession<Self>) -> Vec<CheckedDrive>;
}

/// Reads cells and shows them.
///
/// # Errors
/// [`Failure`].
pub fn read<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &ReadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let cells = D::cells(&arguments.cells).map_err(Failure::refused)?;
    let look = Use::look("read");
    on(bench, &arguments.rig, look, output, |session, output| {
        let drives = select(from_ref(&arguments.drives), session)?;
        show(
            &D::read(session, &drives, &cells)?,
            arguments.format,
            output,
        )
    })
}

/// Shows the values of cells repeatedly.
///
/// # Errors
/// [`Failure`].
pub fn watch<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &WatchArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let cells = D::cells(&arguments.cells).map_err(Failure::refused)?;
    let look = Use::look("watch");
    show_again(arguments, output, |readings, output| {
        on(bench, &arguments.rig, look, output, |session, output| {
            let drives = select(from_ref(&arguments.drives), session)?;
            // All slaves are in the exchange before the first one is read.
            D::read(session, &drives, &[])?;
            let mut watched = WatchedDrives {
                session,
                drives,
                cells: &cells,
            };
            readings.show(&mut watched, output)
        })
    })
}

struct WatchedDrives<'a, D: CommandDrives> {
    session: &'a mut PortSession<D>,
    drives: Vec<D::Drive>,
    cells: &'a [D::Cell],
}

impl<D: CommandDrives> WatchBench for WatchedDrives<'_, D> {
    const DRIVE: &'static str = D::WORDS[0];

    fn now(&mut self) -> Instant {
        self.session.guarded().now()
    }

    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure> {
        let found = D::read(self.session, &self.drives, self.cells)?;
        Ok(found.iter().map(CellReading::watched).collect())
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        D::pass(self.session, time)
    }
}
