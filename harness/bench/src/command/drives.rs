//! The commands that all buses behind `[port.1]` share, and what they ask of the drives of a bus.

use super::check::CheckedDrive;
use super::drive::{DriveCommand, InfoArguments, OutputForm, ReadArguments, WatchArguments};
use super::exit::Exit;
use super::failure::Failure;
use super::held::HeldDrives;
use super::line_top::{LineTop, top};
use super::output::{Output, columns};
use super::params::{ParameterFile, params};
use super::port_bench::{PortBench, on, select};
use super::reading::{CellReading, show};
use super::rig_name::Use;
use super::watch::{WatchBench, WatchedCell, watch as show_again};
use crate::link::Line as _;
use crate::rig::session::RigSession;
use harness_proto::time::{Instant, Span};
use serde_json::{Map, Value, json};
use std::slice::from_ref;

/// What `info` shows of a drive, by its number: each value with its heading and with where it stands.
pub type DriveInfo = (u8, Vec<[String; 3]>);

/// Drives of a bus, as the commands use them that all buses behind `[port.1]` share.
pub trait CommandDrives: HeldDrives {
    /// What is read of a drive: a register or a parameter.
    type Cell;
    type Reading: CellReading;
    /// A value that a file has for a drive.
    type Parameter;

    const PARAMETERS: ParameterFile<Self, Self::Parameter>;
    /// The heading of `info` for where a value stands.
    const PLACE: &'static str;
    /// What `rig check` says of a drive that does not answer.
    const SILENT: &'static str;

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
        session: &mut RigSession<Self>,
        drives: &[Self::Drive],
        cells: &[Self::Cell],
    ) -> Result<Vec<Self::Reading>, Failure>;

    /// Reads what `info` shows. The exit code is that of the drives that were reported and left out.
    ///
    /// # Errors
    /// [`Failure`]: a drive does not answer as it must, or the port is lost.
    fn info(
        session: &mut RigSession<Self>,
        drives: &[Self::Drive],
        output: &mut Output,
    ) -> Result<(Vec<DriveInfo>, Exit), Failure>;

    /// What `top` shows of them.
    fn top(session: &RigSession<Self>) -> LineTop<Self>;

    /// Asks every drive for `rig check`, unless the bench only listens.
    fn check(session: &mut RigSession<Self>) -> Vec<CheckedDrive>;
}

/// Runs a command.
///
/// # Errors
/// [`Failure`].
pub(super) fn perform<D: CommandDrives>(
    bench: PortBench<'_, D>,
    command: &DriveCommand,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match command {
        DriveCommand::Read(arguments) => read(bench, arguments, output),
        DriveCommand::Info(arguments) => info(bench, arguments, output),
        DriveCommand::Watch(arguments) => watch(bench, arguments, output),
        DriveCommand::Top(arguments) => top(bench, arguments, output),
        DriveCommand::Params(command) => params(bench, command, output),
        _ => D::perform(bench, command, output),
    }
}

/// Reads cells and shows them.
fn read<D: CommandDrives>(
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

/// Lists drives.
fn info<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &InfoArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let look = Use::look("info");
    on(bench, &arguments.rig, look, output, |session, output| {
        let drives = select(from_ref(&arguments.drives), session)?;
        let (drives, exit) = D::info(session, &drives, output)?;
        let mut rows = Vec::new();
        let mut objects = Vec::new();
        for (number, values) in drives {
            let mut object = Map::new();
            object.insert(D::WORDS[0].to_owned(), json!(number));
            for [what, value, place] in values {
                let key = what.to_lowercase().replace([' ', '-'], "_");
                object.insert(key, json!(value));
                rows.push([number.to_string(), what, value, place]);
            }
            objects.push(Value::Object(object));
        }
        match arguments.format {
            OutputForm::Text => {
                let heading = [D::WORDS[0], "what", "value", D::PLACE];
                output.result(&output.fitted(&columns(&heading, &rows)))?;
            }
            OutputForm::Json => {
                let whole = json!({"schema": 1, "drives": objects});
                output.result(&format!("{whole}\n"))?;
            }
        }
        Ok(exit)
    })
}

/// Shows the values of cells repeatedly.
fn watch<D: CommandDrives>(
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
    session: &'a mut RigSession<D>,
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
