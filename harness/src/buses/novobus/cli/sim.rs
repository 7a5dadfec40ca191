//! `drivebench sim`: simulated rings for anyone's master.

use super::args::RigArguments;
use super::rig;
use crate::buses::{self, Bus};
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::frames::FrameArguments;
use crate::command::output::Output;
use crate::file::values::LinkName;
use crate::medium::ErrorMarks;
use crate::scenario::argument::duration;
use crate::scenario::source::Source;
use crate::serve::{
    ClientRole, ControlPlace, Inner, Pace, ServeEnd, ServeError, ServeHost, ServeOptions, ServedAt,
    Server, serve,
};
use clap::{ArgGroup, Args, ValueEnum};
use harness_proto::time::Span;
use std::path::PathBuf;
use std::str::FromStr;

pub(crate) const SIM_HELP: &str = "\
Once all places are ready, standard output has one line per ring, such as `ring 1: 3 drives at 127.0.0.1:40123`, or per
place of a CAN bus, such as `slcan: 1 drive, 500 kbit/s at 127.0.0.1:40123`, and with --control ADDRESS a line
`control at 127.0.0.1:40124`; with --control - the answers follow. With --web a line `page at http://127.0.0.1:8090/#TOKEN`
is the address to open in a browser, token included. Standard error reports what clients do.

Drives on CAN: `sim --bus unitek --drives 2 --slcan 127.0.0.1:4100 --socketcand 127.0.0.1:29536`. All clients share the
bus: each frame goes through the arbitration and reaches the other clients. With SLCAN a client opens its channel with
the rate of the bus (S6 is 500 kbit/s) or none; with socketcand any name of a bus is taken. The header lines of --setup
describe the drives: `rate 250`, `drive 1 profile fw472`, `drive 3 rx 210 tx 190`, `drive 1 input run low`.

Slaves on PROFIBUS: `sim --bus nordac --slaves 8,9 --tcp 127.0.0.1:4200`, or --pty /tmp/master. Each --tcp or --pty is the
place of a master; all share the segment and hear each other. A telegram of a client leaves behind 33 idle bits and
without a gap, however the stream cuts it; octets that are no telegram leave as they are. The header lines of --setup
describe the slaves: `rate 1500`, `slave 8 ppo 2`, `slave 8 parameter 1205 = 70.0Hz`, `slave 8 property ext-diag = always`.

A control line is a line of the scenario language that sends no byte of the master. It takes effect at once:
  ! 1->0: flip 0                  a fault; `byte n` and times count from the start; if that byte has passed, the
                                  next byte is meant
  drive 0 input GPIN5 low         an event outside the bus
  ? drive 0 nist = 0rpm +-5rpm    a check of drives or of the error mode
  state 0                         mode, outputs, bus error; `state 2:0 nist FF08:2`: these cells
On CAN:
  ! frame 3: lost                 a fault of a frame; frames count from the start
  drive 1 input limit1 high       an event outside the bus
  ? drive 1 register 6E = 0       a check of a register
  state 1                         what the drive shows; `state 1 SPEED_ACTUAL 6E`: these registers
On PROFIBUS:
  ! slave 8 telegram 3: lost      a fault; bytes and telegrams count from the start
  slave 8 fault on                an event outside the bus
  ? slave 8 parameter 1202 = 100  a check of a parameter
  state 8                         states of slave and inverter, and its frequency in 0.1 Hz
The answer to each is one line: `ok` (and the state), `no: ` and what was found, or `error: ` and the reason.

--tap and --cut take a link, `=`, and a place: a path (with a `/` in it) for a pseudo terminal, HOST:PORT for a socket.
Links of the second ring begin with `2:`, as in `2:2->1`. Standard output has one line per place: `tap 2->1 at /tmp/tap`.

A pseudo terminal carries no parity and no bit rate, and cannot refuse a second program. Without --marks in-band every
byte of the client counts as good, and a damaged byte arrives at the client as its eight bits.

Ends on SIGINT, SIGTERM, SIGHUP or SIGQUIT (exit code 130), after --for, or with --once when the clients have gone.";

/// For `sim`.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("place").required(true).multiple(true)))]
pub struct SimArguments {
    /// Serve a ring on a socket: HOST:PORT, port 0 for a free one. Only one client at a time. Give it twice for two rings, in their
    /// order. On PROFIBUS it is the place of a master.
    #[arg(long, value_name = "ADDRESS", group = "place")]
    pub tcp: Vec<String>,
    /// Serve a ring on a pseudo terminal; this path is a symbolic link to it. Give it twice for two rings. On PROFIBUS it is
    /// the place of a master.
    #[arg(long, value_name = "PATH", group = "place", conflicts_with = "tcp")]
    pub pty: Vec<PathBuf>,
    /// Let a client listen on a link: `2->1=ADDRESS` or `2->1=PATH`. Bytes from the client are dropped.
    #[arg(long, value_name = "LINK=PLACE")]
    pub tap: Vec<InnerPlace>,
    /// Cut a link open: the client receives from the drive in front and sends to the drive behind. With two places,
    /// `2->1=PLACE,PLACE`, the first receives and the second sends.
    #[arg(long, value_name = "LINK=PLACE")]
    pub cut: Vec<InnerPlace>,
    /// Speed of the simulation.
    #[arg(long, value_enum, default_value_t = SimSpeed::Line)]
    pub pace: SimSpeed,
    /// How the stream carries line errors.
    #[arg(long, value_enum, default_value_t = ErrorMarks::None)]
    pub marks: ErrorMarks,
    /// Take control lines from standard input (-) or from a listening socket (HOST:PORT).
    #[arg(long, value_name = "-|ADDRESS")]
    pub control: Option<String>,
    /// Serve a live page for a browser: HOST:PORT, port 0 for a free one. Its address with a token is printed. Without another place, no
    /// master can connect, and the page has some conversations to play.
    #[arg(long, value_name = "ADDRESS", group = "place")]
    pub web: Option<String>,
    /// Allow sockets that other machines can reach.
    #[arg(long)]
    pub allow_remote: bool,
    /// End when the last client has gone.
    #[arg(long)]
    pub once: bool,
    /// Time after which it ends.
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    pub length: Option<Span>,
    /// Drives on CAN.
    #[command(flatten)]
    pub frames: FrameArguments,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// How fast time passes in a served ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimSpeed {
    /// As on the line: a byte takes 286 us at 38400 bit/s.
    Line,
    /// As fast as possible while bytes of the client are on the ring.
    Free,
}

/// A link and its places, as written.
#[derive(Clone, Debug)]
pub struct InnerPlace {
    text: String,
    ring: usize,
    link: LinkName,
    places: Vec<ServedAt>,
}

impl FromStr for InnerPlace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "a link and a place expected: 2->1=/tmp/link or 2->1=127.0.0.1:4001";
        let (link, places) = text.split_once('=').ok_or(expected)?;
        let (ring, link) = match link.split_once(':') {
            None | Some(("1", _)) => (0, link.trim_start_matches("1:")),
            Some(("2", link)) => (1, link),
            Some((ring, _)) => return Err(format!("there is no ring {ring}: 1 or 2 expected")),
        };
        let link: LinkName = link.parse().map_err(|error| format!("{error}"))?;
        let place = |text: &str| match text {
            "" => Err(expected.to_owned()),
            path if path.contains('/') => Ok(ServedAt::Pty(path.into())),
            address => Ok(ServedAt::Tcp(address.to_owned())),
        };
        let places = places.split(',').map(place).collect::<Result<_, _>>()?;
        Ok(Self {
            text: text.to_owned(),
            ring,
            link,
            places,
        })
    }
}

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
        bus if buses::shares_octets(bus) => octets(bus, arguments, output)?,
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

impl ServeHost for Output {
    fn tell(&mut self, line: &str) -> std::io::Result<()> {
        self.result(&format!("{line}\n"))
    }

    fn say(&mut self, line: &str) {
        Output::say(self, &format!("{line}\n"));
    }
}
