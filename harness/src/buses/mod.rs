//! The buses: one folder each. Only this file names them all.

mod contents;
#[cfg(test)]
mod interrupt_tests;
#[cfg(test)]
mod live_tests;
pub use harness_nordac as nordac;
pub use harness_novobus as novobus;
mod sim;
#[cfg(test)]
mod toy;
pub use harness_unitek as unitek;

pub use novobus::language::{plan, syntax};
pub use novobus::link::SimulatedLink;

pub(crate) use contents::{cell_names, cells, deviations};
pub(crate) use nordac::GSD;
pub(crate) use unitek::dbc::dbc;

pub(crate) use novobus::cli::shrink::shrink as shrink_rings;
pub(crate) use novobus::{cli as commands, driver, twin};

use crate::bus::BusName;
use crate::campaign::line::LineCampaign;
use crate::capture::live::LiveText;
use crate::capture::{Carries, JudgedFrames, RecordedPlace, ends};
use crate::command::args::ListFormat;
use crate::command::drive::DriveCommand;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::fuzz::{LineFuzz, verify};
use crate::command::held::HeldBench;
use crate::command::output::Output;
use crate::command::port_row::PortCommands;
use crate::command::rig_failure::{self, exit_of};
use crate::command::rig_name::RigName;
use crate::evidence::Signer;
use crate::explore::read_as;
use crate::manual::Manual;
use crate::medium::ErrorMarks;
use crate::rig::buses::RigBuses;
use crate::rig::segment::{SegmentJudge, SegmentRun};
use crate::rig::{FindError, Rig, SessionError, UseOptions, check, find};
use crate::scenario::problem::Problems;
use crate::scenario::settled::{self, Settled};
use crate::scenario::source::Source;
use crate::serve::frames::FramePlace;
use crate::serve::{ServeEnd, ServeError, ServeHost, ServeOptions, ServedAt, serve};
use crate::traffic::SegmentReport;
pub(crate) use crate::traffic::SharedForm;
use commands::rig_check::CheckRigArguments;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::fuzz::{FuzzTarget, Noting};
use harness_sim::record::Trace;
use novobus::language::syntax::Scenario;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

/// The manuals of the buses; that of [`BusName::DEFAULT`] first.
pub const MANUALS: [Manual; 3] = [
    novobus::manual::MANUAL,
    unitek::manual::MANUAL,
    nordac::manual::MANUAL,
];

/// The names of the built-in campaigns on buses whose stations share one line, in order.
pub(crate) fn line_campaigns() -> Vec<String> {
    [nordac::campaign::names(), unitek::campaign::names()].concat()
}

/// Finds and reads a campaign on such a bus: a file that names the bus, or a built-in one by its name. `None` where it is neither.
///
/// # Errors
/// What is wrong with it, with file, place and remedy.
pub(crate) fn line_campaign(name: &Path) -> Option<Result<Box<dyn LineCampaign>, String>> {
    fn boxed<C: LineCampaign + 'static>(
        own: Result<C, String>,
    ) -> Result<Box<dyn LineCampaign>, String> {
        own.map(|own| -> Box<dyn LineCampaign> { Box::new(own) })
    }
    let unitek = || unitek::campaign::find(name).map(boxed);
    nordac::campaign::find(name).map(boxed).or_else(unitek)
}

/// A scenario in the words of every bus, and settled in those of its own; or its mistakes.
type Found = Result<(Scenario, Arc<dyn Settled>), Problems>;

/// The fuzz targets of the buses.
pub(crate) fn fuzz_targets() -> impl Iterator<Item = FuzzTarget> {
    let rings = harness_sim::novobus::fuzz::TARGETS.into_iter();
    rings
        .chain(harness_sim::unitek::fuzz::TARGETS)
        .chain(harness_sim::nordac::fuzz::TARGETS)
}

/// What the inputs of those reach.
pub(crate) fn fuzz_noting() -> impl Iterator<Item = Noting> {
    let rings = harness_sim::novobus::fuzz::NOTING.into_iter();
    rings
        .chain(harness_sim::unitek::fuzz::NOTING)
        .chain(harness_sim::nordac::fuzz::NOTING)
}

/// The buses, as the files of rigs know them.
pub static RIG_BUSES: RigBuses = RigBuses {
    rings: novobus::rig::RINGS,
    ports: [&unitek::rig::PORT, &nordac::rig::PORT],
};

/// Commands on rigs with ports.
static PORT_COMMANDS: [PortCommands; 2] = [unitek::rig::COMMANDS, nordac::rig::COMMANDS];

/// What serves the port of a rig; `None` for rings.
fn commands_of(rig: &Rig) -> Option<&'static PortCommands> {
    let bus = rig.port()?.bus;
    PORT_COMMANDS.iter().find(|own| own.bus == bus)
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

/// Takes a rig with a port, to play scenarios on it.
///
/// # Errors
/// [`SessionError`]; nothing is left locked or open.
pub(crate) fn run_on(rig: &Rig, options: &UseOptions) -> Result<Box<dyn SegmentRun>, SessionError> {
    match commands_of(rig) {
        Some(own) => (own.run)(rig, options),
        None => Err(SessionError::Drives {
            rig: rig.id().to_owned(),
            why: "it has no [port.1]".to_owned(),
        }),
    }
}

/// Judges what was played on a rig with a port again, with or without `--allow-motion`, by a qualification or by a run; `None` for a bench
/// with rings.
pub(crate) fn judge_of(
    rig: &Rig,
    allow_motion: bool,
    qualifies: bool,
) -> Option<Box<dyn SegmentJudge>> {
    let own = commands_of(rig)?;
    Some((own.judge)(rig, allow_motion, qualifies))
}

/// How traces of a shared line are shown, by what the channels carried; `None` for a ring.
pub(crate) fn report_of(traces: &[Trace]) -> Option<&'static dyn SegmentReport> {
    match Carries::of(traces) {
        Carries::Frames => Some(&unitek::report::FrameReport),
        Carries::Line => Some(&nordac::report::TelegramReport),
        Carries::Link => None,
    }
}

/// What these are traces of.
pub(crate) fn carried(traces: &[Trace]) -> &'static str {
    report_of(traces).map_or("bytes of a ring", SegmentReport::carries)
}

/// Text of what a place of a capture carries, while it arrives. Of a link of a ring, its rate, and the number of drives where it is known.
pub(crate) fn live_text(place: &RecordedPlace, drives: Option<u8>) -> Box<dyn LiveText> {
    match (place.carries, ends(&place.name)) {
        (Carries::Link, Some((_, from, to))) => {
            let rate = Rate::from_bits_per_second(place.bits_per_second).unwrap_or_default();
            Box::new(novobus::report::live::LinkText::new(from, to, rate, drives))
        }
        (Carries::Link | Carries::Line, _) => Box::<nordac::report::live::TelegramText>::default(),
        (Carries::Frames, _) => Box::new(unitek::report::table::FrameText),
    }
}

/// The frames or telegrams of a shared line, a row each: the rows that are wanted, counted from 0, and of them `at_most`. `None` for a
/// ring, which has tables of its own.
pub(crate) fn rows(
    trace: &Trace,
    wanted: Option<Range<usize>>,
    at_most: Option<usize>,
) -> Option<String> {
    let report = report_of(std::slice::from_ref(trace))?;
    Some(report.rows(trace, wanted, at_most))
}

/// A scenario that replays a capture of a shared line; `setup` describes the drives. `None` for a ring.
///
/// # Errors
/// It does not say enough of the drives, in a sentence.
pub(crate) fn shared_scenario(
    traces: &[Trace],
    title: &str,
    setup: Option<&Source>,
) -> Option<Result<String, String>> {
    match Carries::of(traces) {
        Carries::Frames => Some(unitek::capture::scenario(traces, title, setup)),
        Carries::Line => Some(nordac::capture::scenario(traces, title, setup)),
        Carries::Link => None,
    }
}

/// Judges a capture of a shared line; `setup` describes the drives, `named` are those that are judged, where the user names some, and
/// times may be off by `tolerance`.
///
/// # Errors
/// It does not say enough of the drives, in a sentence.
pub(crate) fn judge_shared(
    traces: &[Trace],
    setup: Option<&Source>,
    (named, tolerance): (&[u8], Span),
) -> Result<JudgedFrames, String> {
    match Carries::of(traces) {
        Carries::Line if setup.is_some() => Err(
            "--setup changes nothing where telegrams are judged: a slave is accused only of what no right slave does, whatever its settings; \
             leave it out"
                .to_owned(),
        ),
        Carries::Line => Ok(nordac::capture::judged(traces, (named, tolerance))),
        _ => unitek::capture::judged(traces, setup, (named, tolerance)),
    }
}

/// How many frames or telegrams a capture of a shared line has, and what they are called.
pub(crate) fn counted_pieces(traces: &[Trace]) -> (usize, &'static str) {
    match Carries::of(traces) {
        Carries::Line => (nordac::report::count(traces), "telegram"),
        _ => {
            let channels = traces.iter().flat_map(|trace| &trace.channels);
            (
                channels.map(|channel| channel.frames().len()).sum(),
                "frame",
            )
        }
    }
}

/// The dissector of a bus for Wireshark.
pub(crate) fn dissector(bus: BusName) -> String {
    match bus {
        BusName::Novobus => novobus::report::DISSECTOR.to_owned(),
        BusName::Unitek => unitek::dissector::dissector(),
        BusName::Nordac => nordac::dissector::dissector(),
    }
}

/// Writes traces of a shared line. Only frames have a log of candump.
///
/// # Errors
/// Those of `out`.
pub(crate) fn write_shared(
    traces: &[Trace],
    form: SharedForm,
    mut out: impl Write,
) -> std::io::Result<()> {
    report_of(traces).map_or(Ok(()), |report| report.write(traces, form, &mut out))
}

/// The built-in scenario that shows a bus at work.
pub(crate) const fn example(bus: BusName) -> &'static str {
    match bus {
        BusName::Novobus => "9.8-check-sequence",
        BusName::Unitek => "unitek-ex-11-speed-routine",
        BusName::Nordac => "nordac-3.3-start-up",
    }
}

/// Compares the telegrams of two runs, and says whether they are the same, and how they differ; `None` unless both are octets of a shared
/// line. Times may differ by `tolerance`.
pub(crate) fn telegram_difference(
    [left, right]: [&[Trace]; 2],
    tolerance: Span,
    names: [&str; 2],
) -> Option<(bool, String)> {
    let telegrams = [left, right].map(|own| Carries::of(own) == Carries::Line);
    let found = nordac::report::diff::difference(left, right, tolerance);
    (telegrams == [true; 2]).then(|| (found.is_none(), found.show(names)))
}

/// Runs a command on drives, in the words of the bus of its bench.
pub(crate) fn drive(mut command: DriveCommand, output: &mut Output) -> std::io::Result<Exit> {
    if let DriveCommand::Sim(arguments) = &command {
        return told(sim::sim(arguments, output), output);
    }
    let Some(RigName::Named(name)) = command.rig().and_then(|own| own.rig.as_ref()) else {
        return novobus::cli::drive(&command, output);
    };
    let Some(rig) = find_any_rig(name, output) else {
        return Ok(Exit::Usage);
    };
    let Some(own) = commands_of(&rig) else {
        if let Some(arguments) = command.rig_mut() {
            arguments.found = Some(Rc::new(rig));
        }
        return novobus::cli::drive(&command, output);
    };
    let end = (own.command)(&rig, &command, output);
    told(end, output)
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
    match commands_of(rig) {
        None => novobus::cli::held::hold(rig, options, output),
        Some(own) => (own.hold)(rig, options)
            .map_err(|error| Failure::Said(exit_of(&error), error.to_string())),
    }
}

/// Runs `rig check`.
pub(crate) fn check_rig(
    arguments: &CheckRigArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let Some(rig) = find_any_rig(&arguments.rig, output) else {
        return Ok(Exit::Usage);
    };
    let for_tools = arguments.format == ListFormat::Json;
    match commands_of(&rig) {
        None => novobus::cli::rig_check::check(&rig, arguments, output),
        Some(own) => {
            let end = (own.check)(&rig, &arguments.options(), for_tools, output);
            told(end, output)
        }
    }
}

/// How drives of a shared line are explored; `None` for rings.
pub(crate) fn line_fuzz(bus: BusName) -> Option<&'static LineFuzz> {
    let own = PORT_COMMANDS.iter().find(|own| own.bus.bus() == bus)?;
    Some(&own.fuzz)
}

/// Judges the findings of a run on drives of a shared line again; `None` if the folder has no such run.
pub(crate) fn verify_shared(
    folder: &Path,
    signer: Option<Signer<'_>>,
    output: &mut Output,
) -> Option<std::io::Result<Exit>> {
    if let Ok((kept, _)) = read_as::<unitek::explore::FrameTalk>(folder) {
        return Some(verify(folder, &kept, signer, output));
    }
    let (kept, _) = read_as::<nordac::explore::TelegramTalk>(folder).ok()?;
    Some(verify(folder, &kept, signer, output))
}

/// Reports the error of a command.
fn told(end: Result<Exit, Failure>, output: &mut Output) -> std::io::Result<Exit> {
    match end {
        Ok(exit) => Ok(exit),
        Err(Failure::Output(error)) => Err(error),
        Err(failure) => Ok(failure.tell(output)),
    }
}

/// Serves simulated drives of a bus of frames: as many, with what a header says of them.
///
/// # Errors
/// The header has mistakes, or the bus carries no frames.
fn serve_frames(
    bus: BusName,
    (drives, header): (Option<u8>, Option<&Source>),
    options: &ServeOptions<FramePlace>,
    host: &mut dyn ServeHost,
) -> Result<Result<ServeEnd, ServeError>, Problems> {
    match bus {
        BusName::Unitek => {
            let plan = unitek::serve::bench(drives, header)?;
            Ok(unitek::serve::serve(plan, options, host))
        }
        BusName::Novobus | BusName::Nordac => Ok(Err(ServeError::Medium)),
    }
}

/// Serves simulated drives of a shared line of octets, those with these addresses and those of a header, to a master at each place of the options.
///
/// # Errors
/// The header has mistakes, or the bus has no such line.
fn serve_octets(
    bus: BusName,
    (slaves, header): (Option<&[u8]>, Option<&Source>),
    marks: ErrorMarks,
    options: &ServeOptions<ServedAt>,
    host: &mut dyn ServeHost,
) -> Result<Result<ServeEnd, ServeError>, Problems> {
    match bus {
        BusName::Nordac => {
            let plan = nordac::serve::bench(slaves, header)?;
            let server = nordac::serve::SegmentServer::new(plan, options.places.len(), marks);
            Ok(serve(server, options, host))
        }
        BusName::Novobus | BusName::Unitek => Ok(Err(ServeError::Medium)),
    }
}

/// Makes the languages of buses known: a line a bus.
macro_rules! languages {
    ($($bus:ident => $language:ty),+ $(,)?) => {
        /// Reads and settles a scenario in the words of its bus.
        pub(crate) fn settle(bus: BusName, source: &Source, size: Option<u8>) -> Found {
            match bus {
                $(BusName::$bus => settled::settle::<$language, _>(source, size),)+
            }
        }
    };
}

languages! {
    Novobus => novobus::language::Novobus,
    Unitek => unitek::language::Unitek,
    Nordac => nordac::language::Nordac,
}
