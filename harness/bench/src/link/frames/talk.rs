//! The handshake with an adapter, before its channel is open.

use super::adapter::{Adapter, Slcan, closing};
use super::open::{AdapterError, AdapterSettings, Listening};
use super::transport::{FrameTransport, StreamTransport};
use crate::frames::BadMessage;
use crate::frames::slcan::{self, Report, SlcanCommand};
use crate::frames::socketcand::{Messages, SocketcandAnswer, SocketcandRequest};
use crate::port::{Outgoing, Wire};
use rustix::event::{Timespec, poll};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A line of an adapter, and what ended it.
type EndedLine = Result<(Vec<u8>, u8), BadMessage>;

/// How long an adapter may take to answer a command of the opening.
const PATIENCE: Duration = Duration::from_secs(2);

/// How long an adapter without a version is listened to, so that its late answers are not taken for others.
const QUIET: Duration = Duration::from_millis(100);

/// How long an adapter that answers nothing but `V` may take for it once more.
const AT_ONCE: Duration = Duration::from_millis(500);

/// The longest sleep: a request to end is polled at least this often.
const NAP: Duration = Duration::from_millis(50);

/// Characters that are read before the channel is open, at most: a bus without a pause brings fewer.
const MOST_READ: usize = 16 << 20;

/// 800 kbit/s with LAWICEL's adapters, and 750 kbit/s with the firmware of CANable.
const RATE_OF_ITS_OWN: SlcanCommand = SlcanCommand::Rate(7);

const SLCAN: &str = "SLCAN adapter";
const SOCKETCAND: &str = "server of socketcand";

const RATE: &str = "use an adapter that has the rate";
const NOT_ITS_RATE: &str = "the firmware of CANable has 10, 20, 50, 100, 125, 250, 500 and 1000 kbit/s; use another adapter";
const LISTEN: &str = "use an adapter that can; with `listen_only = false` in a rig's file, or `capture --may-acknowledge`, it acknowledges frames";
const OPEN: &str = "check that no other program uses it";

/// A conversation of questions and answers.
pub(super) struct Talk<'a> {
    wire: Wire,
    interrupt: &'a AtomicBool,
    lines: slcan::SlcanLines,
    messages: Messages,
    /// Characters received and not yet examined.
    come: VecDeque<u8>,
    /// What an SLCAN adapter says that it is; empty if it says nothing.
    name: String,
    /// Whether it says so in another form than LAWICEL's adapters.
    own_dialect: bool,
    /// Whether it answers commands.
    answers: bool,
    /// Whether it was told to be silent, which it is until a command lets it acknowledge.
    silenced: bool,
    /// How much was read.
    read: usize,
}

impl<'a> Talk<'a> {
    pub(super) fn new(wire: Wire, interrupt: &'a AtomicBool) -> Self {
        Self {
            wire,
            interrupt,
            lines: slcan::SlcanLines::default(),
            messages: Messages::default(),
            come: VecDeque::new(),
            name: String::new(),
            own_dialect: false,
            answers: false,
            silenced: false,
            read: 0,
        }
    }

    pub(super) fn opened(self, adapter: Adapter) -> Box<dyn FrameTransport> {
        Box::new(StreamTransport {
            wire: self.wire,
            adapter,
            come: self.come,
        })
    }

    /// Finds out what the adapter is, sets the rate and opens the channel.
    pub(super) fn open_slcan(
        &mut self,
        rate: SlcanCommand,
        settings: &AdapterSettings,
    ) -> Result<(Slcan, Listening), AdapterError> {
        self.find_slcan()?;
        let unknown = match rate {
            SlcanCommand::Timing(_) => !self.answers,
            rate => rate == RATE_OF_ITS_OWN && (self.is_canable() || !self.answers),
        };
        if unknown {
            return Err(self.refuses(&format!("the rate {}", settings.rate), NOT_ITS_RATE));
        }
        let what = format!("the rate {} while its channel is closed", settings.rate);
        self.done(rate, &what, RATE)?;
        // Without time stamps the time of reading counts. An adapter without answers cannot say whether it has them.
        if self.answers {
            let _stamps = self.ask(SlcanCommand::TimeStamps(true))?;
        }
        let listening = match settings.listen_only {
            true => self.listen(settings.may_acknowledge)?,
            false => {
                if self.own_dialect {
                    // Such an adapter keeps its silent mode while it has power.
                    self.ask(SlcanCommand::Silent(false))?;
                }
                self.done(SlcanCommand::Open, "to open its channel (O)", OPEN)?;
                Listening::MayAcknowledge
            }
        };
        let slcan = Slcan::new(settings.listen_only, self.answers, self.silenced);
        Ok((slcan, listening))
    }

    /// Ends what another program has begun, by a line that is none of a frame; ends its channel; then asks who is there. An empty line would
    /// do for the first, but the firmware of CANable takes it for the command before it, and sends the last frame again.
    ///
    /// An adapter answers each command with CR or BEL, and `V` with a line before. The firmware of CANable answers `V` only, with a line of
    /// its own form. What answers several times in another way is none.
    fn find_slcan(&mut self) -> Result<(), AdapterError> {
        for _ in 0..2 {
            [
                SlcanCommand::SerialNumber,
                SlcanCommand::Close,
                SlcanCommand::Version,
            ]
            .into_iter()
            .try_for_each(|command| self.say(command))?;
            let texts = self.greetings(PATIENCE)?;
            self.name = texts.first().cloned().unwrap_or_default();
            let lawicel = |text: &String| text.len() == 5 && text.starts_with('V');
            self.own_dialect = !texts.is_empty() && !texts.iter().any(lawicel);
            match texts.len() {
                _ if texts.iter().any(|text| text == "C" || text == "V") => {
                    return Err(self.other(SLCAN, "its own commands come back"));
                }
                _ if self.answers => return Ok(()),
                0 => return Err(self.silent("C and V", SLCAN)),
                // What says a line by itself now and then does not say it again at once.
                1 => {
                    self.say(SlcanCommand::Version)?;
                    if self.greetings(AT_ONCE)? == texts {
                        return Ok(());
                    }
                }
                // The tail of a frame of a channel that was open: asked again, only the version comes.
                _ => {}
            }
        }
        let name = self.name.clone();
        Err(self.other(SLCAN, format!("received \"{name}\", and no answer of one")))
    }

    /// Whether it names the firmware whose silent mode is `M1`.
    fn is_canable(&self) -> bool {
        self.name.to_ascii_lowercase().contains("canable")
    }

    /// The lines that are no frames of the bus and no bare answers, up to a pause after the first of them.
    fn greetings(&mut self, patience: Duration) -> Result<Vec<String>, AdapterError> {
        let mut texts = Vec::new();
        let mut end = Instant::now() + patience;
        let last = end + PATIENCE;
        while let Some(line) = self.line(end)? {
            let report = line.and_then(|(line, end)| Report::parse(&line, end));
            match report {
                Ok(Report::Done | Report::Refused | Report::Taken { .. }) => {
                    self.answers = true;
                    if texts.is_empty() {
                        continue;
                    }
                }
                Ok(Report::Frame(..) | Report::SerialNumber(_)) => continue,
                Ok(Report::Version(text)) => texts.push(format!("V{text}")),
                Ok(Report::Other(text)) => texts.push(text),
                Ok(Report::Flags(bits)) => texts.push(format!("F{bits:02X}")),
                Err(error) => texts.push(error.received().to_owned()),
            }
            end = last.min(Instant::now() + QUIET);
        }
        Ok(texts)
    }

    /// Opens the channel so that nothing is sent on the bus: by `L`, or in the firmware of CANable by `M1` and `O`.
    fn listen(&mut self, may_acknowledge: bool) -> Result<Listening, AdapterError> {
        const SILENT: SlcanCommand = SlcanCommand::Silent(true);
        const OPENING: (SlcanCommand, &str) = (SlcanCommand::Open, "to open its channel (O)");
        let (command, what) = OPENING;
        let refused = if self.answers {
            match self.ask(SlcanCommand::Listen)? {
                Some(true) => return Ok(Listening::Only("L")),
                None => return Err(self.silent("a command", SLCAN)),
                Some(false) => {}
            }
            if self.own_dialect {
                self.silenced = true;
                if self.ask(SILENT)? == Some(true) {
                    self.done(command, what, OPEN)?;
                    return Ok(Listening::Only("M1"));
                }
            }
            "to listen only (L)"
        } else {
            let known = self.is_canable();
            if known || may_acknowledge {
                self.silenced = true;
                self.ask(SILENT)?;
                self.done(command, what, OPEN)?;
                return Ok(match known {
                    true => Listening::Unconfirmed("M1"),
                    false => Listening::MayAcknowledge,
                });
            }
            "to confirm that it listens only: it answers no command but V"
        };
        if !may_acknowledge {
            return Err(self.refuses(refused, LISTEN));
        }
        self.done(command, what, OPEN)?;
        Ok(Listening::MayAcknowledge)
    }

    /// A command that has to be done, by an adapter that answers.
    fn done(
        &mut self,
        command: SlcanCommand,
        what: &str,
        remedy: &'static str,
    ) -> Result<(), AdapterError> {
        match self.ask(command)? {
            Some(true) => Ok(()),
            Some(false) => Err(self.refuses(what, remedy)),
            None if !self.answers => Ok(()),
            None => Err(self.silent("a command", SLCAN)),
        }
    }

    /// Whether a command was done; `None` where no answer comes.
    fn ask(&mut self, command: SlcanCommand) -> Result<Option<bool>, AdapterError> {
        self.say(command)?;
        let patience = if self.answers { PATIENCE } else { QUIET };
        let end = Instant::now() + patience;
        while let Some(line) = self.line(end)? {
            let report = line.and_then(|(line, end)| Report::parse(&line, end));
            match report.map_err(|error| self.other(SLCAN, error))? {
                Report::Done => return Ok(Some(true)),
                Report::Refused => return Ok(Some(false)),
                // A frame of the bus, or what only some adapters say.
                _ => {}
            }
        }
        Ok(None)
    }

    fn say(&mut self, command: SlcanCommand) -> Result<(), AdapterError> {
        let mut bytes = Vec::new();
        command.write(&mut bytes);
        self.send(&bytes)
    }

    /// The next line of an SLCAN adapter, and what ends it; `None` where none comes.
    fn line(&mut self, end: Instant) -> Result<Option<EndedLine>, AdapterError> {
        while let Some(character) = self.next(end)? {
            if let Some(line) = self.lines.push(character) {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }

    pub(super) fn open_socketcand(&mut self, channel: &str) -> Result<(), AdapterError> {
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
        )?;
        // A served drive reports frames late until its client has spoken after the answer.
        self.request(&SocketcandRequest::Echo)
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
                    return Err(self.refuses(&format!("{command} ({text})"), remedy));
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
            self.read += read.len();
            if self.read > MOST_READ {
                return Err(self.other("adapter", "a flood of characters"));
            }
            self.come.extend(read.iter().map(|received| received.byte));
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

    /// Closes the channel of an adapter that was not opened to the end.
    pub(super) fn close(&mut self) {
        for command in closing(self.silenced) {
            let _gone = self.say(*command);
        }
    }

    fn refuses(&self, what: &str, remedy: &'static str) -> AdapterError {
        AdapterError::Refused {
            port: self.wire.name().to_owned(),
            what: what.to_owned(),
            remedy,
        }
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
