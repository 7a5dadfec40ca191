//! `drivebench sim`: simulated rings for anyone's master.

use super::rig;
use crate::bus::Bus;
use crate::buses::novobus::serve::Server;
use crate::buses::{self};
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::output::Output;
use crate::command::sim::{SimArguments, SimSpeed};
use crate::medium::ErrorMarks;
use crate::scenario::source::Source;
use crate::serve::{
    ClientRole, ControlPlace, Inner, Pace, ServeEnd, ServeError, ServeOptions, ServedAt, serve,
};

/// The seats at inner links with their places, in the order of the command line: taps first.
fn inner(arguments: &SimArguments, sizes: &[u8]) -> Result<Vec<(Inner, ServedAt)>, Failure> {
    let mut all: Vec<(Inner, ServedAt)> = Vec::new();
    let taps = arguments
        .tap
        .iter()
        .map(|place| (place, &[ClientRole::Tap][..]));
    let cuts = arguments.cut.iter().map(|place| match place.places.len() {
        1 => (place, &[ClientRole::Cut][..]),
        _ => (place, &[ClientRole::Upstream, ClientRole::Downstream][..]),
    });
    for (given, roles) in taps.chain(cuts) {
        let text = &given.text;
        let refused = |why: &str| Failure::refused(format!("{text}: {why}"));
        let drives = *sizes
            .get(given.ring)
            .ok_or_else(|| refused("the bench has one ring"))?;
        let Some(from) = given.link.from.filter(|_| given.link.to.is_some()) else {
            return Err(refused(
                "the master's own links are the ring's port; a link between two drives expected",
            ));
        };
        if !given.link.is_in(drives) {
            return Err(refused(&format!(
                "a ring of {drives} has no such link; bytes go from a drive to the next lower one"
            )));
        }
        let link = usize::from(drives - from);
        if all
            .iter()
            .any(|(other, _)| (other.ring, other.link) == (given.ring, link))
        {
            return Err(refused("another --tap or --cut uses this link already"));
        }
        if given.places.len() != roles.len() {
            return Err(refused(
                "one place expected for a tap, one or two for a cut",
            ));
        }
        for (&role, place) in roles.iter().zip(&given.places) {
            let ring = given.ring;
            all.push((Inner { ring, link, role }, place.clone()));
        }
    }
    Ok(all)
}

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
        Bus::Novobus => rings(arguments, output)?,
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

/// Where lines of control come from.
fn control(arguments: &SimArguments) -> Option<ControlPlace> {
    arguments.control.as_deref().map(|place| match place {
        "-" => ControlPlace::Standard,
        address => ControlPlace::Tcp(address.to_owned()),
    })
}

/// Options that a bus does not have, and what it has instead.
fn refuse(bus: Bus, given: &[(&str, bool)], expected: &str) -> Result<(), Failure> {
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

/// Where `masters` are served: nowhere, if only a live page is asked for.
fn places(arguments: &SimArguments, masters: usize) -> impl Iterator<Item = ServedAt> {
    let tcp = arguments.tcp.iter().cloned().map(ServedAt::Tcp);
    let pty = arguments.pty.iter().cloned().map(ServedAt::Pty);
    let only_page = arguments.tcp.is_empty() && arguments.pty.is_empty();
    let nowhere = only_page.then(|| std::iter::repeat_n(ServedAt::Nowhere, masters));
    tcp.chain(pty).chain(nowhere.into_iter().flatten())
}

/// Serves the drives of a shared line of octets: every place is a master's.
fn octets(
    bus: Bus,
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
    buses::serve_octets(bus, slaves, arguments.marks, &options, output).map_err(Failure::from)
}

/// What the arguments say of serving at these places.
fn options<P>(arguments: &SimArguments, places: Vec<P>) -> ServeOptions<P> {
    ServeOptions {
        places,
        control: control(arguments),
        page: arguments.web.clone(),
        allow_remote: arguments.allow_remote,
        once: arguments.once,
        length: arguments.length,
    }
}

/// Serves the drives of a bus of frames.
fn frames(
    bus: Bus,
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
    Ok(buses::serve_frames(bus, drives, &options, output)?)
}

/// Serves the rings of a simulated bench.
fn rings(
    arguments: &SimArguments,
    output: &mut Output,
) -> Result<Result<ServeEnd, ServeError>, Failure> {
    if !arguments.frames.places().is_empty() {
        return Err(Failure::refused(
            "--slcan, --slcan-pty and --socketcand serve a CAN bus; --bus unitek expected with them",
        ));
    }
    if arguments.frames.slaves.is_some() {
        return Err(Failure::refused(
            "--slaves are those of a PROFIBUS segment; --bus nordac expected with it",
        ));
    }
    let (plan, link) = rig::link(&arguments.rig, output)?;
    let pace = match arguments.pace {
        SimSpeed::Line => Pace::Line,
        SimSpeed::Free => Pace::Free,
    };
    let sizes: Vec<u8> = plan.rings.iter().map(|ring| ring.drives()).collect();
    let inner = inner(arguments, &sizes)?;
    let mut server = Server::new(plan, link, pace, arguments.marks);
    inner.iter().for_each(|(inner, _)| server.add(*inner));
    let inner = inner.into_iter().map(|(_, place)| place);
    let places = places(arguments, sizes.len()).chain(inner);
    let options = options(arguments, places.collect());
    Ok(serve(server, &options, output))
}
