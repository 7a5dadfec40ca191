//! `drivebench sim`: simulated drives for anyone's master.

use super::novobus::cli::sim::{options, places, rings};
use super::{RIG_BUSES, serve_frames, serve_octets};
use crate::bus::BusName;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::output::Output;
use crate::command::sim::{SimArguments, SimSpeed};
use crate::medium::ErrorMarks;
use crate::scenario::source::Source;
use crate::serve::{ServeEnd, ServeError};

/// Serves simulated drives.
pub(crate) fn sim(arguments: &SimArguments, output: &mut Output) -> Result<Exit, Failure> {
    let only_page = arguments.tcp.is_empty()
        && arguments.pty.is_empty()
        && arguments.frames.places().is_empty();
    if arguments.once && only_page {
        return Err(Failure::refused(
            "--once ends when the last client has gone, and a page alone has no clients: --tcp, --pty or another place expected, or --for",
        ));
    }
    let end = match arguments.frames.bus {
        BusName::Novobus => rings(arguments, &RIG_BUSES, output)?,
        bus if bus.shares_octets() => octets(bus, arguments, output)?,
        bus => frames(bus, arguments, output)?,
    };
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

/// Options that a bus does not have, and what it has instead.
fn refuse(bus: BusName, given: &[(&str, bool)], expected: &str) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::refused(format!(
            "{option} is not for the bus {}; {expected} expected",
            bus.name()
        ))),
        None => Ok(()),
    }
}

/// The header of `--setup`.
fn header(arguments: &SimArguments) -> Result<Option<Source>, Failure> {
    let header = arguments.rig.setup.as_deref().map(Source::read).transpose();
    header.map_err(|error| Failure::File(error.into()))
}

/// Serves the drives of a shared line of octets: every place is a master's.
fn octets(
    bus: BusName,
    arguments: &SimArguments,
    output: &mut Output,
) -> Result<Result<ServeEnd, ServeError>, Failure> {
    let others = [
        ("--tap", !arguments.tap.is_empty()),
        ("--cut", !arguments.cut.is_empty()),
        ("--pace", arguments.pace != SimSpeed::Line),
        ("--drives", arguments.frames.drives.is_some()),
        (
            "--slcan and --socketcand",
            !arguments.frames.places().is_empty(),
        ),
        ("--rig", arguments.rig.rig.is_some()),
    ];
    refuse(
        bus,
        &others,
        "--tcp or --pty, a place for each master, and --slaves",
    )?;
    let options = options(arguments, places(arguments, 1).collect());
    let header = header(arguments)?;
    let slaves = (arguments.frames.slaves.as_deref(), header.as_ref());
    serve_octets(bus, slaves, arguments.marks, &options, output).map_err(Failure::from)
}

/// Serves the drives of a bus of frames.
fn frames(
    bus: BusName,
    arguments: &SimArguments,
    output: &mut Output,
) -> Result<Result<ServeEnd, ServeError>, Failure> {
    let rings = [
        ("--tcp", !arguments.tcp.is_empty()),
        ("--pty", !arguments.pty.is_empty()),
        ("--tap", !arguments.tap.is_empty()),
        ("--cut", !arguments.cut.is_empty()),
        ("--pace", arguments.pace != SimSpeed::Line),
        ("--marks", arguments.marks != ErrorMarks::None),
        ("--slaves", arguments.frames.slaves.is_some()),
        ("--rig", arguments.rig.rig.is_some()),
    ];
    refuse(
        bus,
        &rings,
        "--slcan, --slcan-pty or --socketcand, and --drives",
    )?;
    let options = options(arguments, arguments.frames.places());
    let header = header(arguments)?;
    let drives = (arguments.frames.drives, header.as_ref());
    Ok(serve_frames(bus, drives, &options, output)?)
}
