//! A conversation with a client, without I/O: requests in; answers, and what the client's station hears, out.

use crate::frames::slcan::{self, BitTiming, Report, SlcanCommand, flags, rate_of};
use crate::frames::socketcand::{Messages, SocketcandAnswer, SocketcandRequest, Stamp, class};
use harness_proto::can::{BitRate, CanError, CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use std::time::Duration;

/// The version that an SLCAN client reads: hardware 1.0, software 1.0.
const VERSION: &str = "1010";

/// The serial number that an SLCAN client reads.
const SERIAL_NUMBER: &str = "SIM1";

/// How long the daemon reports nothing after the answer to `rawmode`, unless the client says more. A client may take the answer for the only
/// message of its segment: the constructor of python-can refuses a frame there.
const HOLD: Span = Span::from_millis(100);

/// Frames that an adapter takes which runs at another rate than the bus, and so never sends them.
const STUCK: usize = 64;

/// The language of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// Lines of a serial CAN adapter.
    Slcan,
    /// Messages of the daemon socketcand.
    Socketcand,
}

impl Protocol {
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Slcan => "slcan",
            Self::Socketcand => "socketcand",
        }
    }
}

/// What a client wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Act {
    /// To be a station of the bus.
    Join {
        listen_only: bool,
    },
    /// To be none any more, once its frames are sent.
    Leave,
    Send(Frame),
    /// Nothing: a mistake, for people.
    Say(String),
}

#[derive(Clone, Debug)]
pub(super) enum Session {
    Slcan(ServedAdapter),
    Socketcand(Daemon),
}

impl Session {
    /// A conversation about a bus with this rate. `started` is when its time began, since 1970.
    pub(super) fn new(protocol: Protocol, rate: BitRate, started: Duration) -> Self {
        match protocol {
            Protocol::Slcan => Self::Slcan(ServedAdapter::new(rate)),
            Protocol::Socketcand => Self::Socketcand(Daemon::new(started)),
        }
    }

    /// What the client receives before it has said anything.
    pub(super) fn greet(&self, out: &mut Vec<u8>) {
        if let Self::Socketcand(_) = self {
            SocketcandAnswer::Hi.write(out);
        }
    }

    /// Takes bytes of the client at `now`, and writes the answers.
    pub(super) fn receive(&mut self, now: Instant, bytes: &[u8], out: &mut Vec<u8>) -> Vec<Act> {
        let mut acts = Vec::new();
        for &byte in bytes {
            match self {
                Self::Slcan(adapter) => adapter.receive(byte, out, &mut acts),
                Self::Socketcand(daemon) => daemon.receive(now, byte, out, &mut acts),
            }
        }
        acts
    }

    /// Until when nothing that the station hears is reported to the client.
    pub(super) const fn holds_until(&self) -> Instant {
        match self {
            Self::Slcan(_) => Instant::START,
            Self::Socketcand(daemon) => daemon.holds_until,
        }
    }

    /// The client's station has heard something that ended at `at`.
    pub(super) fn hear(&mut self, at: Instant, heard: CanEvent, out: &mut Vec<u8>) {
        match self {
            Self::Slcan(adapter) => adapter.hear(at, heard, out),
            Self::Socketcand(daemon) => daemon.hear(at, heard, out),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct ServedAdapter {
    lines: slcan::SlcanLines,
    bus: BitRate,
    /// The rate that the client has chosen; `None` takes that of the bus.
    rate: Option<BitRate>,
    channel: Channel,
    stamps: bool,
    flags: u8,
}

/// The state of an adapter's channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    Closed,
    Open,
    Listening,
    /// Open at another rate than the bus, with this number of frames that are never sent.
    OffRate(usize),
}

impl ServedAdapter {
    fn new(bus: BitRate) -> Self {
        Self {
            lines: slcan::SlcanLines::default(),
            bus,
            rate: None,
            channel: Channel::Closed,
            stamps: false,
            flags: 0,
        }
    }

    fn receive(&mut self, byte: u8, out: &mut Vec<u8>, acts: &mut Vec<Act>) {
        let Some(line) = self.lines.push(byte) else {
            return;
        };
        let command = line.and_then(|(line, end)| match end {
            slcan::CR => SlcanCommand::parse(&line),
            // No host ends a command with BEL.
            _ => SlcanCommand::parse(&[&line[..], &[end]].concat()),
        });
        let report = match command {
            Ok(command) => self.obey(command, acts),
            Err(error) => {
                acts.push(Act::Say(error.to_string()));
                Report::Refused
            }
        };
        report.write(out);
    }

    fn obey(&mut self, command: SlcanCommand, acts: &mut Vec<Act>) -> Report {
        let closed = self.channel == Channel::Closed;
        match command {
            SlcanCommand::Nothing | SlcanCommand::ReportAll => Report::Done,
            SlcanCommand::Version => Report::Version(VERSION.to_owned()),
            SlcanCommand::SerialNumber => Report::SerialNumber(SERIAL_NUMBER.to_owned()),
            SlcanCommand::Flags if !closed => Report::Flags(std::mem::take(&mut self.flags)),
            SlcanCommand::Send(frame) => self.send(frame, acts),
            SlcanCommand::Rate(code) if closed => self.choose(rate_of(code), acts),
            SlcanCommand::Timing(timing) if closed => self.choose(BitTiming::rate(timing), acts),
            SlcanCommand::TimeStamps(on) if closed => {
                self.stamps = on;
                Report::Done
            }
            SlcanCommand::Open if closed => self.open(false, acts),
            SlcanCommand::Listen if closed => self.open(true, acts),
            SlcanCommand::Close if !closed => {
                self.channel = Channel::Closed;
                self.flags = 0;
                acts.push(Act::Leave);
                Report::Done
            }
            // As adapters do: the rate and the stamps of an open channel stay, and what is open or closed cannot be that again.
            SlcanCommand::Rate(_)
            | SlcanCommand::Timing(_)
            | SlcanCommand::TimeStamps(_)
            | SlcanCommand::Open
            | SlcanCommand::Listen
            | SlcanCommand::Close
            | SlcanCommand::Flags
            | SlcanCommand::Silent(_) => Report::Refused,
        }
    }

    fn choose(&mut self, rate: Option<BitRate>, acts: &mut Vec<Act>) -> Report {
        if rate.is_none() {
            let text = "received a bit timing above 1 Mbit/s or without a whole number of bits a second; S0 to S8, or s with \
                        BTR0 and BTR1 of an SJA1000 at 16 MHz expected";
            acts.push(Act::Say(text.to_owned()));
            return Report::Refused;
        }
        self.rate = rate;
        Report::Done
    }

    fn open(&mut self, listen_only: bool, acts: &mut Vec<Act>) -> Report {
        let bus = self.bus;
        match self.rate.filter(|rate| *rate != bus) {
            Some(rate) => {
                self.channel = Channel::OffRate(0);
                acts.push(Act::Say(format!(
                    "the client has opened its channel at {rate}, and the bus runs at {bus}: it hears nothing and its frames are \
                     not sent; choose the rate of the bus"
                )));
            }
            None => {
                self.channel = match listen_only {
                    true => Channel::Listening,
                    false => Channel::Open,
                };
                acts.push(Act::Join { listen_only });
            }
        }
        Report::Done
    }

    fn send(&mut self, frame: Frame, acts: &mut Vec<Act>) -> Report {
        let extended = frame.id().is_extended();
        match &mut self.channel {
            Channel::Open => acts.push(Act::Send(frame)),
            Channel::OffRate(stuck) if *stuck < STUCK => {
                *stuck += 1;
                self.flags |= flags::BUS_ERROR | flags::PASSIVE;
            }
            Channel::OffRate(_) => {
                self.flags |= flags::BUS_ERROR | flags::PASSIVE | flags::TRANSMIT_FULL;
                return Report::Refused;
            }
            Channel::Closed | Channel::Listening => return Report::Refused,
        }
        Report::Taken { extended }
    }

    fn hear(&mut self, at: Instant, heard: CanEvent, out: &mut Vec<u8>) {
        if !matches!(self.channel, Channel::Open | Channel::Listening) {
            return;
        }
        match heard {
            CanEvent::Frame(frame) => {
                let millis = at.since_start().as_nanos() / 1_000_000;
                let stamp = (millis % u64::from(slcan::STAMP_PERIOD)) as u16;
                Report::Frame(frame, self.stamps.then_some(stamp)).write(out);
            }
            CanEvent::Error(CanError::ErrorFrame) => self.flags |= flags::BUS_ERROR,
            CanEvent::Error(CanError::NoAcknowledge | CanError::BusOff) => {
                self.flags |= flags::BUS_ERROR | flags::PASSIVE;
            }
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Daemon {
    messages: Messages,
    mode: Mode,
    started: Duration,
    holds_until: Instant,
}

/// Modes of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    NoBus,
    Bcm,
    Raw,
}

impl Daemon {
    fn new(started: Duration) -> Self {
        Self {
            messages: Messages::default(),
            mode: Mode::NoBus,
            started,
            holds_until: Instant::START,
        }
    }

    fn receive(&mut self, now: Instant, byte: u8, out: &mut Vec<u8>, acts: &mut Vec<Act>) {
        let Some(message) = self.messages.push(byte) else {
            return;
        };
        self.holds_until = Instant::START;
        let request = match message.and_then(|message| SocketcandRequest::parse(&message)) {
            Ok(request) => request,
            Err(error) => {
                // The daemon answers no `send`, not even one with a mistake, and clients expect no answer to it.
                if !error.concerns("< send ") {
                    SocketcandAnswer::Error(error.to_string()).write(out);
                }
                acts.push(Act::Say(error.to_string()));
                return;
            }
        };
        let refusal = match (self.mode, request) {
            (_, SocketcandRequest::Echo) => return SocketcandAnswer::Echo.write(out),
            (Mode::NoBus, SocketcandRequest::Open(_)) => {
                self.mode = Mode::Bcm;
                acts.push(Act::Join { listen_only: false });
                return SocketcandAnswer::Ok.write(out);
            }
            (Mode::NoBus, _) => "no bus is open; < open can0 > expected first",
            (_, SocketcandRequest::RawMode) => {
                self.mode = Mode::Raw;
                self.holds_until = now + HOLD;
                return SocketcandAnswer::Ok.write(out);
            }
            (_, SocketcandRequest::BcmMode) => {
                self.mode = Mode::Bcm;
                return SocketcandAnswer::Ok.write(out);
            }
            (_, SocketcandRequest::Send(frame)) => return acts.push(Act::Send(frame)),
            (_, SocketcandRequest::Open(_)) => {
                "a bus is open already; connect again for another one"
            }
        };
        SocketcandAnswer::Error(refusal.to_owned()).write(out);
        acts.push(Act::Say(refusal.to_owned()));
    }

    fn hear(&mut self, at: Instant, heard: CanEvent, out: &mut Vec<u8>) {
        if self.mode != Mode::Raw {
            return;
        }
        let time = self.started + Duration::from_nanos(at.since_start().as_nanos());
        let stamp = Stamp {
            seconds: time.as_secs(),
            micros: time.subsec_micros(),
        };
        let answer = match heard {
            CanEvent::Frame(frame) => SocketcandAnswer::Frame(frame, stamp),
            CanEvent::Error(error) => {
                let class = match error {
                    CanError::ErrorFrame => class::PROTOCOL | class::BUS_ERROR,
                    CanError::NoAcknowledge => class::NO_ACKNOWLEDGE,
                    CanError::BusOff => class::BUS_OFF,
                };
                SocketcandAnswer::ErrorFrame(class, stamp)
            }
        };
        answer.write(out);
    }
}
