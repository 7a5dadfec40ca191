//! The buses: a crate each. Only this room names them all.

pub use harness_nordac as nordac;
pub use harness_novobus as novobus;
pub use harness_unitek as unitek;

pub(crate) use crate::bus::Bus;

use crate::bus::SharedLine;
use crate::bus_name::BusName;
use crate::capture::Carries;
use crate::rig::buses::RigBuses;
use crate::rig::playing::{RecordJudge, RigRun};
use crate::rig::{FindError, Rig, SessionError, UseOptions, check, find};
use crate::scenario::problem::Problems;
use crate::scenario::source::Source;
use crate::serve::{ServeEnd, ServeError};
use crate::shown::SegmentReport;
use harness_bench::command::drive::DriveCommand;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::fuzz::FuzzCommands;
use harness_bench::command::held::HeldBench;
use harness_bench::command::output::Output;
use harness_bench::command::rig_commands::RigCommands;
use harness_bench::command::rig_failure;
use harness_bench::command::rig_name::RigName;
use harness_bench::command::sim::SimArguments;
use harness_sim::record::Trace;
use std::path::Path;
use std::rc::Rc;

/// The buses; that of [`BusName::DEFAULT`] first.
pub static BUSES: [&Bus; 3] = [&novobus::BUS, &unitek::BUS, &nordac::BUS];

/// The bus of this name.
pub fn named(name: BusName) -> &'static Bus {
    BUSES[name as usize]
}

/// The bus whose channels carry this.
pub(crate) fn carrier(carries: Carries) -> &'static Bus {
    let found = BUSES.iter().find(|bus| bus.carries == carries);
    found.unwrap_or(&BUSES[0])
}

/// The same where it is a line that stations share; `None` for links of a ring.
pub(crate) fn carrying(carries: Carries) -> Option<&'static SharedLine> {
    carrier(carries).shared.as_ref()
}

/// The bus of a rig.
pub(crate) fn bus_of(rig: &Rig) -> &'static Bus {
    named(rig.port().map_or(BusName::DEFAULT, |port| port.bus.bus()))
}

/// The buses, as the files of rigs know them.
pub static RIG_BUSES: RigBuses = RigBuses {
    rings: novobus::BUS.rings.expect("rings"),
    ports: [line(&unitek::BUS).port, line(&nordac::BUS).port],
};

const fn line(bus: &'static Bus) -> &'static SharedLine {
    bus.shared.as_ref().expect("a shared line")
}

/// Finds and reads a rig; see [`find::find`].
///
/// # Errors
/// There is no such rig, or its file has mistakes.
pub fn find_rig_in(name: &str, folder: &Path) -> Result<Rig, FindError> {
    find::find(name, folder, &RIG_BUSES)
}

/// Reads a rig's file.
///
/// # Errors
/// All its mistakes, each with its place.
pub fn parse_rig(source: &Source) -> Result<Rig, Problems> {
    check::parse(source, &RIG_BUSES)
}

/// Finds the rig of this name, whatever its bus; reports what is wrong with it.
pub(crate) fn find_any_rig(name: &str, output: &mut Output) -> Option<Rig> {
    rig_failure::find_any_rig(name, &RIG_BUSES, output)
}

/// What the commands ask of the bus of a rig.
fn commands_of(rig: &Rig) -> Option<&'static RigCommands> {
    bus_of(rig).rigs.as_ref()
}

/// Whether every scenario on a rig may bring drives of its own.
pub(crate) fn is_bare(rig: &Rig) -> bool {
    commands_of(rig).is_some_and(|commands| (commands.is_bare)(rig))
}

/// A bus that is not built serves no rig.
fn no_rigs(rig: &Rig) -> String {
    format!(
        "{}: the bus {} has no rigs",
        rig.id(),
        bus_of(rig).name.name()
    )
}

/// Takes a rig to play scenarios on it.
///
/// # Errors
/// [`SessionError`]; nothing is left locked or open.
pub(crate) fn run_on(rig: &Rig, options: &UseOptions) -> Result<Box<dyn RigRun>, SessionError> {
    match commands_of(rig) {
        Some(commands) => (commands.run)(rig, options),
        None => Err(SessionError::Drives {
            rig: rig.id().to_owned(),
            why: no_rigs(rig),
        }),
    }
}

/// Judges what was played on a rig again, by a qualification or by a run.
///
/// # Errors
/// The rig's file describes no drives, in a sentence.
pub(crate) fn judge_of(rig: &Rig, qualifies: bool) -> Result<Box<dyn RecordJudge>, String> {
    match commands_of(rig) {
        Some(commands) => (commands.judge)(rig, qualifies),
        None => Err(no_rigs(rig)),
    }
}

/// How traces are shown.
pub(crate) fn report_of(traces: &[Trace]) -> &'static dyn SegmentReport {
    carrier(Carries::of(traces)).report
}

/// Runs a command on drives, in the words of the bus of its bench.
pub(crate) fn drive(command: DriveCommand, output: &mut Output) -> std::io::Result<Exit> {
    if let DriveCommand::Sim(arguments) = &command {
        return told(sim(arguments, output), output);
    }
    let named = command.rig().and_then(|arguments| arguments.rig.as_ref());
    let rig = match named {
        Some(RigName::Named(name)) => match find_any_rig(name, output) {
            Some(rig) => Some(Rc::new(rig)),
            None => return Ok(Exit::Usage),
        },
        _ => None,
    };
    let bus = rig.as_deref().map_or(BUSES[0], bus_of);
    let Some(commands) = &bus.rigs else {
        return Ok(Exit::Usage);
    };
    told((commands.command)(rig, command, output), output)
}

/// Takes a rig for a session.
///
/// # Errors
/// [`Failure`]; nothing is left locked or open.
pub(crate) fn hold(
    rig: &Rig,
    options: &UseOptions,
    output: &mut Output,
) -> Result<Box<dyn HeldBench>, Failure> {
    let commands = commands_of(rig).ok_or_else(|| Failure::refused(no_rigs(rig)))?;
    (commands.hold)(rig, options, output)
}

/// Runs `rig check`, as text or for tools.
pub(crate) fn check_rig(
    rig: &Rig,
    options: &UseOptions,
    for_tools: bool,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let end = match commands_of(rig) {
        Some(commands) => (commands.check)(rig, options, for_tools, output),
        None => Err(Failure::refused(no_rigs(rig))),
    };
    told(end, output)
}

/// How drives of a bus are explored.
pub(crate) fn fuzz_of(bus: BusName) -> Option<&'static FuzzCommands> {
    Some(&named(bus).rigs.as_ref()?.fuzz)
}

/// Serves simulated drives.
fn sim(arguments: &SimArguments, output: &mut Output) -> Result<Exit, Failure> {
    let only_page = arguments.tcp.is_empty()
        && arguments.pty.is_empty()
        && arguments.frames.places().is_empty();
    if arguments.once && only_page {
        return Err(Failure::refused(
            "--once ends when the last client has gone, and a page alone has no clients: --tcp, --pty or another place expected, or --for",
        ));
    }
    let bus = named(arguments.frames.bus);
    let end = (bus.sim)(arguments, &RIG_BUSES, output)?;
    let end = end.map_err(|error| match error {
        ServeError::Output(error) => Failure::Output(error),
        ServeError::Wait(_) => Failure::Said(Exit::RigError, error.to_string()),
        error => Failure::refused(error.to_string()),
    })?;
    Ok(match end {
        ServeEnd::Interrupted => Exit::Interrupted,
        ServeEnd::TimeOver | ServeEnd::ClientsGone => Exit::Passed,
    })
}

/// Reports the error of a command.
fn told(end: Result<Exit, Failure>, output: &mut Output) -> std::io::Result<Exit> {
    match end {
        Ok(exit) => Ok(exit),
        Err(Failure::Output(error)) => Err(error),
        Err(failure) => Ok(failure.tell(output)),
    }
}
