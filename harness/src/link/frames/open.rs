//! Opening a CAN adapter: the handshake of its language.

use super::adapter::{Adapter, Slcan, Socketcand};
use super::kernel::Kernel;
use super::transport::{Stream, Transport};
use crate::frames::slcan::{self, BitTiming, Report, SlcanCommand, rate_of};
use crate::frames::socketcand::{Messages, SocketcandAnswer, SocketcandRequest};
use crate::port::{OpenError, Outgoing, PortAddress, Wire, open_adapter};
use crate::trouble::Trouble;
use harness_proto::can::BitRate;
use rustix::event::{Timespec, poll};
use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How long an adapter may take to answer a command of the opening.
const PATIENCE: Duration = Duration::from_secs(2);

/// How long an adapter without a version is listened to, so that its late answers are not taken for others.
const QUIET: Duration = Duration::from_millis(100);

/// The longest sleep: a request to end is looked for at least this often.
const NAP: Duration = Duration::from_millis(50);

/// The rate of the serial line of adapters with a UART; those on USB ignore it.
pub const DEFAULT_BAUD: u32 = 115_200;

/// A CAN adapter, and how to reach it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AdapterPlace {
    /// An adapter that speaks SLCAN.
    Slcan {
        /// A serial port, a pseudo terminal or a socket.
        at: PortAddress,
        /// Bits a second on its serial line.
        baud: u32,
    },
    /// A server that speaks the protocol of socketcand.
    Socketcand {
        /// `host:port`.
        address: String,
        /// The bus, such as `can0`.
        channel: String,
    },
    /// An interface of Linux's SocketCAN, in builds with the feature `socketcan`. Never tried on a kernel with CAN.
    Kernel {
        /// Its name, such as `can0`.
        interface: String,
    },
}

impl AdapterPlace {
    /// An SLCAN adapter as rig files and options name it: a path is a serial port or a pseudo terminal, everything else `host:port`.
    #[must_use]
    pub fn slcan(place: &str) -> Self {
        let at = match place.contains('/') {
            true => PortAddress::Serial(place.into()),
            false => PortAddress::Tcp(place.to_owned()),
        };
        Self::Slcan {
            at,
            baud: DEFAULT_BAUD,
        }
    }
}

impl FromStr for AdapterPlace {
    type Err = String;

    /// `slcan:/dev/ttyACM0`, `slcan:host:port`, `socketcand:host:port/can0` or `socketcan:can0`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no CAN adapter; slcan:/dev/ttyACM0, slcan:HOST:PORT, socketcand:HOST:PORT/can0 or socketcan:can0 expected"
            )
        };
        let (kind, place) = text.split_once(':').ok_or_else(wrong)?;
        match kind {
            _ if place.is_empty() => Err(wrong()),
            "slcan" => Ok(Self::slcan(place)),
            "socketcand" => {
                let (address, channel) = place.split_once('/').unwrap_or((place, "can0"));
                Ok(Self::Socketcand {
                    address: address.to_owned(),
                    channel: channel.to_owned(),
                })
            }
            "socketcan" => Ok(Self::Kernel {
                interface: place.to_owned(),
            }),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for AdapterPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slcan { at, .. } => write!(f, "slcan:{at}"),
            Self::Socketcand { address, channel } => write!(f, "socketcand:{address}/{channel}"),
            Self::Kernel { interface } => write!(f, "socketcan:{interface}"),
        }
    }
}

/// A CAN adapter and the settings of its bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSettings {
    /// The adapter.
    pub place: AdapterPlace,
    /// The rate of the bus. A server of socketcand and an interface of the kernel have a rate of their own, which is not changed.
    pub rate: BitRate,
    /// Whether the adapter sends nothing: with SLCAN not even acknowledges.
    pub listen_only: bool,
}

/// Why a CAN adapter cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AdapterError {
    /// Its stream cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The stream ended or failed.
    #[error("{0}")]
    Trouble(Trouble),
    /// It does not answer.
    #[error(
        "{port} does not answer {command}: {expected} expected; check that it is one, and the rate of its serial line"
    )]
    Silent {
        /// The port.
        port: String,
        /// What was asked.
        command: &'static str,
        /// What should be there.
        expected: &'static str,
    },
    /// It answers something else.
    #[error("{port} is no {expected}: {received}")]
    Other {
        /// The port.
        port: String,
        /// What should be there.
        expected: &'static str,
        /// What was received.
        received: String,
    },
    /// It refuses a command.
    #[error("{port} refuses {what}: {remedy}")]
    Refused {
        /// The port.
        port: String,
        /// What it refuses.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
    /// An SLCAN adapter cannot have the rate.
    #[error(
        "an SLCAN adapter cannot run at {0}: its clock of 8 MHz is no multiple; S0 to S8 are 10, 20, 50, 100, 125, 250, 500, 800 and 1000 \
         kbit/s"
    )]
    Rate(BitRate),
    /// The program has no interfaces of the kernel.
    #[error(
        "{0}: this program is built without CAN interfaces of the kernel; build it with `cargo build --profile installed --features socketcan`, or \
         serve the interface with socketcand"
    )]
    NotBuilt(String),
    /// The program was interrupted.
    #[error("interrupted")]
    Interrupted,
}

const SLCAN: &str = "SLCAN adapter";
const SOCKETCAND: &str = "server of socketcand";

/// Opens an adapter: its stream, and the language on it.
pub(super) fn open(
    settings: &AdapterSettings,
    interrupt: &AtomicBool,
) -> Result<Box<dyn Transport>, AdapterError> {
    match &settings.place {
        AdapterPlace::Slcan { at, baud } => {
            let commands = rate_commands(settings.rate)?;
            let wire = open_adapter(at, *baud)?;
            let mut talk = Talk::new(wire, interrupt);
            let end = talk.open_slcan(commands, settings);
            if end.is_err() {
                talk.close();
            }
            end?;
            Ok(talk.opened(Adapter::Slcan(Slcan::new(settings.listen_only))))
        }
        AdapterPlace::Socketcand { address, channel } => {
            let wire = open_adapter(&PortAddress::Tcp(address.clone()), DEFAULT_BAUD)?;
            let mut talk = Talk::new(wire, interrupt);
            talk.open_socketcand(channel)?;
            Ok(talk.opened(Adapter::Socketcand(Socketcand::new())))
        }
        AdapterPlace::Kernel { interface } => {
            Ok(Box::new(Kernel::open(interface, settings.listen_only)?))
        }
    }
}

/// The command that chooses a rate: a code, or bit timing registers.
fn rate_commands(rate: BitRate) -> Result<SlcanCommand, AdapterError> {
    let code = (0..=8).find(|code| rate_of(*code) == Some(rate));
    let timing = || BitTiming::of(rate).map(SlcanCommand::Timing);
    let command = code.map(SlcanCommand::Rate).or_else(timing);
    command.ok_or(AdapterError::Rate(rate))
}

/// A conversation of questions and answers.
struct Talk<'a> {
    wire: Wire,
    interrupt: &'a AtomicBool,
    lines: slcan::Lines,
    messages: Messages,
    /// What has come and was not looked at.
    come: VecDeque<u8>,
}

impl<'a> Talk<'a> {
    fn new(wire: Wire, interrupt: &'a AtomicBool) -> Self {
        Self {
            wire,
            interrupt,
            lines: slcan::Lines::default(),
            messages: Messages::default(),
            come: VecDeque::new(),
        }
    }

    fn opened(self, adapter: Adapter) -> Box<dyn Transport> {
        Box::new(Stream {
            wire: self.wire,
            adapter,
            come: self.come,
        })
    }

    fn open_slcan(
        &mut self,
        rate: SlcanCommand,
        settings: &AdapterSettings,
    ) -> Result<(), AdapterError> {
        // Ends what another program has begun, and its channel.
        [
            SlcanCommand::Nothing,
            SlcanCommand::Nothing,
            SlcanCommand::Close,
            SlcanCommand::Version,
        ]
        .into_iter()
        .try_for_each(|command| self.say(command))?;
        let end = Instant::now() + PATIENCE;
        let mut answers = 0;
        loop {
            match self.report(end)? {
                Some(Report::Version(_)) => break,
                Some(Report::Done | Report::Refused) => answers += 1,
                Some(_) => {}
                // It has no version: it has answered the other commands.
                None if answers > 0 => break,
                None => return Err(self.silent("C and V", SLCAN)),
            }
        }
        while self.report(Instant::now() + QUIET)?.is_some() {}
        let speed = settings.rate;
        self.done(
            rate,
            &format!("the rate {speed} while its channel is closed"),
            RATE,
        )?;
        // Without time stamps the time of reading counts.
        let _stamps = self.ask(SlcanCommand::TimeStamps(true))?;
        match settings.listen_only {
            true => self.done(SlcanCommand::Listen, "to listen only (L)", LISTEN),
            false => self.done(SlcanCommand::Open, "to open its channel (O)", OPEN),
        }
    }

    /// A command that has to be done.
    fn done(
        &mut self,
        command: SlcanCommand,
        what: &str,
        remedy: &'static str,
    ) -> Result<(), AdapterError> {
        match self.ask(command)? {
            Some(true) => Ok(()),
            Some(false) => Err(AdapterError::Refused {
                port: self.wire.name().to_owned(),
                what: what.to_owned(),
                remedy,
            }),
            None => Err(self.silent("a command", SLCAN)),
        }
    }

    /// Whether a command was done; `None` where no answer comes.
    fn ask(&mut self, command: SlcanCommand) -> Result<Option<bool>, AdapterError> {
        self.say(command)?;
        let end = Instant::now() + PATIENCE;
        loop {
            match self.report(end)? {
                Some(Report::Done) => return Ok(Some(true)),
                Some(Report::Refused) => return Ok(Some(false)),
                None => return Ok(None),
                // A frame of the bus, or what only some adapters say.
                Some(_) => {}
            }
        }
    }

    fn say(&mut self, command: SlcanCommand) -> Result<(), AdapterError> {
        let mut bytes = Vec::new();
        command.write(&mut bytes);
        self.send(&bytes)
    }

    /// The next line of an SLCAN adapter; `None` where none comes.
    fn report(&mut self, end: Instant) -> Result<Option<Report>, AdapterError> {
        loop {
            let Some(character) = self.next(end)? else {
                return Ok(None);
            };
            if let Some(line) = self.lines.push(character) {
                let report = line.and_then(|(line, end)| Report::parse(&line, end));
                return report.map(Some).map_err(|error| self.other(SLCAN, error));
            }
        }
    }

    fn open_socketcand(&mut self, channel: &str) -> Result<(), AdapterError> {
        const CHANNEL: &str =
            "name a bus that the server has, such as can0, and let the server bring it up";
        self.expect("a greeting", &SocketcandAnswer::Hi, "")?;
        self.request(&SocketcandRequest::Open(channel.to_owned()))?;
        self.expect("< open >", &SocketcandAnswer::Ok, CHANNEL)?;
        self.request(&SocketcandRequest::RawMode)?;
        self.expect(
            "< rawmode >",
            &SocketcandAnswer::Ok,
            "use a server of socketcand with a raw mode",
        )
    }

    fn request(&mut self, request: &SocketcandRequest) -> Result<(), AdapterError> {
        let mut bytes = Vec::new();
        request.write(&mut bytes);
        self.send(&bytes)
    }

    fn expect(
        &mut self,
        command: &'static str,
        wanted: &SocketcandAnswer,
        remedy: &'static str,
    ) -> Result<(), AdapterError> {
        let end = Instant::now() + PATIENCE;
        loop {
            let Some(character) = self.next(end)? else {
                return Err(self.silent(command, SOCKETCAND));
            };
            let Some(message) = self.messages.push(character) else {
                continue;
            };
            let answer = message.and_then(|message| SocketcandAnswer::parse(&message));
            match answer.map_err(|error| self.other(SOCKETCAND, error))? {
                answer if answer == *wanted => return Ok(()),
                SocketcandAnswer::Error(text) => {
                    return Err(AdapterError::Refused {
                        port: self.wire.name().to_owned(),
                        what: format!("{command} ({text})"),
                        remedy,
                    });
                }
                _ => {}
            }
        }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), AdapterError> {
        for byte in bytes {
            let sent = self.wire.send(Outgoing::Byte(*byte));
            sent.map_err(AdapterError::Trouble)?;
        }
        self.wire.flush().map_err(AdapterError::Trouble)
    }

    /// The next character; `None` where none comes until `end`.
    fn next(&mut self, end: Instant) -> Result<Option<u8>, AdapterError> {
        loop {
            if let Some(character) = self.come.pop_front() {
                return Ok(Some(character));
            }
            if self.interrupt.load(Ordering::Relaxed) {
                return Err(AdapterError::Interrupted);
            }
            let mut read = Vec::new();
            let result = self.wire.receive(&mut read);
            self.come.extend(read.iter().map(|own| own.byte));
            if !self.come.is_empty() {
                continue;
            }
            result.map_err(AdapterError::Trouble)?;
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let nap = Timespec {
                tv_sec: 0,
                tv_nsec: i64::from(left.min(NAP).subsec_nanos()),
            };
            // An error shows when the stream is read.
            let _ready = poll(&mut [self.wire.poll_fd()], Some(&nap));
            self.wire.flush().map_err(AdapterError::Trouble)?;
        }
    }

    fn close(&mut self) {
        let _gone = self.say(SlcanCommand::Close);
    }

    fn silent(&self, command: &'static str, expected: &'static str) -> AdapterError {
        AdapterError::Silent {
            port: self.wire.name().to_owned(),
            command,
            expected,
        }
    }

    fn other(&self, expected: &'static str, received: impl ToString) -> AdapterError {
        AdapterError::Other {
            port: self.wire.name().to_owned(),
            expected,
            received: received.to_string(),
        }
    }
}

const RATE: &str = "use an adapter that has the rate";
const LISTEN: &str =
    "use an adapter that can; with `listen_only = false` in a rig's file it acknowledges frames";
const OPEN: &str = "check that no other program uses it";
