//! The arguments of `drivebench sim`.

use super::drive::RigArguments;
use super::frames::FrameArguments;
use crate::bus_name::BusName;
use crate::command::failure::Failure;
use crate::file::values::LinkName;
use crate::medium::ErrorMarks;
use crate::scenario::argument::duration;
use crate::scenario::source::Source;
use crate::serve::{ControlPlace, ServeOptions, ServedAt};
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

/// Where lines of control come from.
fn control(arguments: &SimArguments) -> Option<ControlPlace> {
    arguments.control.as_deref().map(|place| match place {
        "-" => ControlPlace::Standard,
        address => ControlPlace::Tcp(address.to_owned()),
    })
}

/// Where `masters` are served: nowhere, if only a live page is asked for.
pub fn places(arguments: &SimArguments, masters: usize) -> impl Iterator<Item = ServedAt> {
    let tcp = arguments.tcp.iter().cloned().map(ServedAt::Tcp);
    let pty = arguments.pty.iter().cloned().map(ServedAt::Pty);
    let only_page = arguments.tcp.is_empty() && arguments.pty.is_empty();
    let nowhere = only_page.then(|| std::iter::repeat_n(ServedAt::Nowhere, masters));
    tcp.chain(pty).chain(nowhere.into_iter().flatten())
}

/// What the arguments say of serving at these places.
pub fn options<P>(arguments: &SimArguments, places: Vec<P>) -> ServeOptions<P> {
    ServeOptions {
        places,
        control: control(arguments),
        page: arguments.web.clone(),
        allow_remote: arguments.allow_remote,
        once: arguments.once,
        length: arguments.length,
    }
}

/// Options that a bus does not have, and what it has instead.
pub fn refuse(bus: BusName, given: &[(&str, bool)], expected: &str) -> Result<(), Failure> {
    match given.iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::refused(format!(
            "{option} is not for the bus {}; {expected} expected",
            bus.name()
        ))),
        None => Ok(()),
    }
}

/// The header of `--setup`.
pub fn header(arguments: &SimArguments) -> Result<Option<Source>, Failure> {
    let header = arguments.rig.setup.as_deref().map(Source::read).transpose();
    header.map_err(|error| Failure::File(error.into()))
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
    pub text: String,
    pub ring: usize,
    pub link: LinkName,
    pub places: Vec<ServedAt>,
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
