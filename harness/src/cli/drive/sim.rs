//! `drivebench sim`: simulated rings for anyone's master.

use super::args::RigArguments;
use super::failure::Failure;
use super::rig;
use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::scenario::argument::duration;
use crate::serve::{ControlPlace, End, Host, Job, Marks, Pace, Place, ServeError, Server, serve};
use clap::{ArgGroup, Args, ValueEnum};
use harness_proto::time::Span;
use std::path::PathBuf;

pub(super) const SIM_HELP: &str = "\
On standard output stands a line for each ring once all are ready, `ring 1: 3 drives at 127.0.0.1:40123`, then with
--control ADDRESS a line `control at 127.0.0.1:40124`; with --control - the answers follow. What clients do is told on
standard error.

Lines of control are lines of the scenario language that need no byte of the master's, done at once:
  ! 1->0: flip 0                  a fault; `byte n` and times are counted from the start, and a byte that has passed
                                  means the next one
  drive 0 input GPIN5 low         something happens to drives from outside the bus
  ? drive 0 nist = 0rpm +-5rpm    a check that looks at drives or at the error mode
  state 0                         mode, outputs, error of the bus; `state 2:0 nist FF08:2`: these cells
Each is answered by a line: `ok` (and the state), `no: ` and what was found, or `error: ` and why.

A pseudo terminal carries no parity and no rate, and cannot turn a second program away. Without --marks in-band every
byte of the client's is a good one, and of a damaged one that comes back only its eight bits are left.

Ends at SIGINT or SIGTERM (exit code 130), after --for, or with --once when the clients have gone.";

/// For `sim`.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("place").required(true)))]
pub struct SimArguments {
    /// Serve a ring on a socket: HOST:PORT, port 0 for a free one. One client at a time; a second one is turned
    /// away. Twice for two rings, in their order.
    #[arg(long, value_name = "ADDRESS", group = "place")]
    pub tcp: Vec<String>,
    /// Serve a ring on a pseudo terminal, with a link to it at this path while it is served. Twice for two rings.
    #[arg(long, value_name = "PATH", group = "place", conflicts_with = "tcp")]
    pub pty: Vec<PathBuf>,
    /// How fast time passes.
    #[arg(long, value_enum, default_value_t = Speed::Line)]
    pub pace: Speed,
    /// How the stream carries line errors.
    #[arg(long, value_enum, default_value_t = MarksForm::None)]
    pub marks: MarksForm,
    /// Take lines of control from standard input (-) or from a socket that listens (HOST:PORT).
    #[arg(long, value_name = "-|ADDRESS")]
    pub control: Option<String>,
    /// Let sockets listen at addresses that other machines reach.
    #[arg(long)]
    pub allow_remote: bool,
    /// End when the client has gone (with two rings, when none is left).
    #[arg(long)]
    pub once: bool,
    /// How long it goes on.
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    pub length: Option<Span>,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// How fast time passes in a served ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Speed {
    /// As on the line: a byte takes 286 us at 38400 bit/s.
    Line,
    /// As fast as possible while bytes of the client's are under way.
    Free,
}

/// How a stream carries line errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MarksForm {
    /// Not at all.
    None,
    /// As PARMRK does: FF 00 x is x with an error, FF FF a good FF.
    InBand,
}

/// Serves the rings of a simulated bench.
pub(super) fn sim(arguments: &SimArguments, output: &mut Output) -> Result<Exit, Failure> {
    let (plan, link) = rig::link(&arguments.rig)?;
    let pace = match arguments.pace {
        Speed::Line => Pace::Line,
        Speed::Free => Pace::Free,
    };
    let marks = match arguments.marks {
        MarksForm::None => Marks::None,
        MarksForm::InBand => Marks::InBand,
    };
    let tcp = arguments.tcp.iter().cloned().map(Place::Tcp);
    let pty = arguments.pty.iter().cloned().map(Place::Pty);
    let job = Job {
        places: tcp.chain(pty).collect(),
        control: arguments.control.as_deref().map(|place| match place {
            "-" => ControlPlace::Standard,
            address => ControlPlace::Tcp(address.to_owned()),
        }),
        allow_remote: arguments.allow_remote,
        once: arguments.once,
        length: arguments.length,
    };
    let server = Server::new(plan, link, pace, marks);
    let end = serve(server, &job, output).map_err(|error| match error {
        ServeError::Output(error) => Failure::Output(error),
        ServeError::Wait(_) => Failure::Said(Exit::RigError, error.to_string()),
        error => Failure::refused(error.to_string()),
    })?;
    Ok(match end {
        End::Interrupted => Exit::Interrupted,
        End::TimeOver | End::ClientsGone => Exit::Passed,
    })
}

impl Host for Output {
    fn tell(&mut self, line: &str) -> std::io::Result<()> {
        self.result(&format!("{line}\n"))
    }

    fn say(&mut self, line: &str) {
        Output::say(self, &format!("{line}\n"));
    }
}
