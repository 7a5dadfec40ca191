//! A client's end of SLCAN and socketcand: frames out, what is heard in, without I/O.

use super::clock::AdapterClock;
use crate::frames::slcan::{self, STAMP_PERIOD, SlcanCommand, flags};
use crate::frames::socketcand::{Messages, SocketcandAnswer, SocketcandRequest};
use crate::medium::Pieces;
use crate::port::WireParts;
use harness_proto::can::{CanError, CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use harness_socketcan::{Report, decode_error};
use std::collections::VecDeque;

/// How long an answer may take; an adapter that does not answer every command is not waited for any longer.
const PATIENCE: Span = Span::from_millis(500);

/// How often the status of an SLCAN adapter is asked for.
const STATUS_EVERY: Span = Span::from_millis(250);

/// Unanswered commands of which the last one may still be a frame.
const MOST_UNANSWERED: usize = 4;

/// What an adapter reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Event {
    /// Something on the bus, and when.
    Heard(Instant, CanEvent),
    /// This many frames are lost, since the computer read too late.
    Late(u32),
    /// The adapter has lost frames, and does not say how many.
    Overrun,
    /// Something of which an adapter does not say whether frames were lost by it.
    MayBeLost,
    /// A message of the adapter that says nothing wrong.
    Message,
    /// Nothing more is carried, and why.
    Ended(String),
}

impl Event {
    /// What an interface has reported at `read`.
    pub(super) const fn of(report: Report, read: Instant) -> Self {
        match report {
            Report::Heard(heard) => Self::Heard(read, heard),
            Report::Late(count) => Self::Late(count),
            Report::Lost => Self::Overrun,
            Report::MayBeLost => Self::MayBeLost,
            Report::Message => Self::Message,
        }
    }
}

/// A language, and the state of a conversation in it.
#[derive(Debug)]
pub(super) enum Adapter {
    Slcan(Slcan),
    Socketcand(Socketcand),
}

impl Adapter {
    /// Writes a frame; false if the language has no such frame.
    pub(super) fn send(&mut self, now: Instant, frame: &Frame, out: &mut Vec<u8>) -> bool {
        match self {
            Self::Slcan(slcan) => slcan.command(now, SlcanCommand::Send(*frame), out),
            Self::Socketcand(_) if frame.is_remote() => return false,
            Self::Socketcand(_) => SocketcandRequest::Send(*frame).write(out),
        }
        true
    }

    /// Whether the language has such a frame.
    pub(super) const fn carries(&self, frame: &Frame) -> bool {
        matches!(self, Self::Slcan(_)) || !frame.is_remote()
    }

    /// How frames are written, beside the conversation.
    pub(super) fn parts(&self) -> WireParts {
        match self {
            Self::Slcan(_) => {
                |pieces| written(pieces, |frame, out| SlcanCommand::Send(frame).write(out))
            }
            Self::Socketcand(_) => |pieces| {
                written(pieces, |frame, out| {
                    SocketcandRequest::Send(frame).write(out)
                })
            },
        }
    }

    /// Whether the next frame may be handed over.
    pub(super) fn is_ready(&self) -> bool {
        match self {
            Self::Slcan(slcan) => slcan.unanswered.len() < MOST_UNANSWERED,
            Self::Socketcand(_) => true,
        }
    }

    /// Writes what ends the conversation.
    pub(super) fn close(&self, out: &mut Vec<u8>) {
        if let Self::Slcan(slcan) = self {
            let commands = closing(slcan.silenced).iter();
            commands.for_each(|command| command.write(out));
        }
    }

    /// Does what is due, and writes it.
    pub(super) fn attend(&mut self, now: Instant, out: &mut Vec<u8>) {
        if let Self::Slcan(slcan) = self {
            slcan.attend(now, out);
        }
    }

    /// When [`Self::attend`] is to be called again.
    pub(super) fn due(&self) -> Option<Instant> {
        match self {
            Self::Slcan(slcan) => slcan.due(),
            Self::Socketcand(_) => None,
        }
    }

    /// Takes a character that is read at `read`.
    pub(super) fn push(&mut self, character: u8, read: Instant) -> Vec<Event> {
        match self {
            Self::Slcan(slcan) => slcan.push(character, read),
            Self::Socketcand(socketcand) => socketcand.push(character, read),
        }
    }
}

/// Frames, each as an adapter's language writes it.
fn written(pieces: &Pieces, write: fn(Frame, &mut Vec<u8>)) -> Vec<Vec<u8>> {
    let frames = pieces.as_out().frames().iter();
    let write = |frame: &Frame| {
        let mut out = Vec::new();
        write(*frame, &mut out);
        out
    };
    frames.map(write).collect()
}

/// What closes a channel. An adapter that was told to be silent is put back.
pub(super) const fn closing(silenced: bool) -> &'static [SlcanCommand] {
    match silenced {
        true => &[SlcanCommand::Close, SlcanCommand::Silent(false)],
        false => &[SlcanCommand::Close],
    }
}

/// An SLCAN adapter whose channel is open.
#[derive(Debug)]
pub(super) struct Slcan {
    lines: slcan::SlcanLines,
    clock: AdapterClock,
    /// Commands that wait for an answer, and since when.
    unanswered: VecDeque<(SlcanCommand, Instant)>,
    /// When the status is asked for again; `None` with an adapter that has none.
    status: Option<Instant>,
    listen_only: bool,
    /// Whether it answers commands.
    answers: bool,
    /// Whether it was told not to send.
    silenced: bool,
    /// Number of lines in a row that no adapter sends.
    damaged: usize,
}

/// A serial line that has lost characters damages a line. After this many in a row, the other end is no adapter.
const MOST_DAMAGED: usize = 8;

impl Slcan {
    pub(super) fn new(listen_only: bool, answers: bool, silenced: bool) -> Self {
        let period = Span::from_millis(STAMP_PERIOD.into());
        Self {
            lines: slcan::SlcanLines::default(),
            clock: AdapterClock::new(Span::from_millis(1), Some(period)),
            unanswered: VecDeque::new(),
            status: answers.then_some(Instant::START),
            listen_only,
            answers,
            silenced,
            damaged: 0,
        }
    }

    fn command(&mut self, now: Instant, command: SlcanCommand, out: &mut Vec<u8>) {
        command.write(out);
        if self.answers {
            self.unanswered.push_back((command, now));
        }
    }

    fn attend(&mut self, now: Instant, out: &mut Vec<u8>) {
        while let Some(&(_, since)) = self.unanswered.front()
            && since + PATIENCE <= now
        {
            self.unanswered.pop_front();
        }
        if self.status.is_some_and(|at| at <= now) && self.unanswered.is_empty() {
            self.status = Some(now + STATUS_EVERY);
            self.command(now, SlcanCommand::Flags, out);
        }
    }

    fn due(&self) -> Option<Instant> {
        let front = self.unanswered.front().map(|(_, since)| *since + PATIENCE);
        let status = self.status.filter(|_| front.is_none());
        front.or(status)
    }

    fn push(&mut self, character: u8, read: Instant) -> Vec<Event> {
        let Some(line) = self.lines.push(character) else {
            return Vec::new();
        };
        let report = line.and_then(|(line, end)| slcan::Report::parse(&line, end));
        self.damaged = match report {
            Ok(_) => 0,
            Err(_) => self.damaged + 1,
        };
        match report {
            Ok(slcan::Report::Frame(frame, stamp)) => {
                let at = stamp.map_or(read, |stamp| {
                    self.clock.at(Span::from_millis(stamp.into()), read)
                });
                vec![Event::Heard(at, CanEvent::Frame(frame))]
            }
            Ok(slcan::Report::Refused) => self.refused(read),
            Ok(slcan::Report::Flags(bits)) => {
                self.answered(|command| command == SlcanCommand::Flags);
                status(bits, read)
            }
            Ok(slcan::Report::Done | slcan::Report::Taken { .. }) => {
                self.answered(|command| command != SlcanCommand::Flags);
                Vec::new()
            }
            // Answers to commands of the opening, and lines that only some adapters have.
            Ok(
                slcan::Report::Version(_)
                | slcan::Report::SerialNumber(_)
                | slcan::Report::Other(_),
            ) => Vec::new(),
            // What stood in it was lost between the adapter and the computer.
            Err(_) if self.damaged < MOST_DAMAGED => vec![Event::Overrun],
            Err(error) => vec![Event::Ended(error.to_string())],
        }
    }

    /// The oldest command of a kind was answered.
    fn answered(&mut self, of: impl Fn(SlcanCommand) -> bool) {
        let place = self.unanswered.iter().position(|(command, _)| of(*command));
        place.and_then(|place| self.unanswered.remove(place));
    }

    fn refused(&mut self, read: Instant) -> Vec<Event> {
        match self.unanswered.pop_front() {
            Some((SlcanCommand::Send(frame), _)) => vec![Event::Ended(format!(
                "the adapter has refused to send {frame}: its queue is full or it is bus-off; check rate, cable, termination and that \
                 a drive is on"
            ))],
            Some((SlcanCommand::Flags, _)) => {
                self.status = None;
                Vec::new()
            }
            // Not an answer of the conversation: some adapters report an error so.
            Some(_) | None if self.listen_only => Vec::new(),
            Some(_) | None => vec![Event::Heard(read, CanEvent::Error(CanError::ErrorFrame))],
        }
    }
}

/// What the status bits of an SLCAN adapter report.
fn status(bits: u8, read: Instant) -> Vec<Event> {
    let lost = bits & (flags::OVERRUN | flags::RECEIVE_FULL) != 0;
    let wrong = bits & (flags::BUS_ERROR | flags::PASSIVE) != 0;
    let error = Event::Heard(read, CanEvent::Error(CanError::ErrorFrame));
    let all = [(lost, Event::Overrun), (wrong, error)];
    all.into_iter()
        .filter(|(set, _)| *set)
        .map(|(_, event)| event)
        .collect()
}

/// A connection to socketcand in raw mode.
#[derive(Debug)]
pub(super) struct Socketcand {
    messages: Messages,
    clock: AdapterClock,
    /// Whether the answer to the `echo` of the opening is to come; some servers refuse it.
    echo: bool,
}

impl Socketcand {
    pub(super) fn new() -> Self {
        Self {
            messages: Messages::default(),
            clock: AdapterClock::new(Span::ZERO, None),
            echo: true,
        }
    }

    fn push(&mut self, character: u8, read: Instant) -> Vec<Event> {
        let Some(answer) = self.messages.push(character) else {
            return Vec::new();
        };
        let answer = answer.and_then(|message| SocketcandAnswer::parse(&message));
        match answer {
            Ok(SocketcandAnswer::Frame(frame, stamp)) => {
                let since = Span::from_micros(
                    (stamp.seconds % SECONDS) * 1_000_000 + u64::from(stamp.micros),
                );
                let at = self.clock.at(since, read);
                vec![Event::Heard(at, CanEvent::Frame(frame))]
            }
            Ok(SocketcandAnswer::ErrorFrame(bits, _)) => {
                let mut events = Vec::new();
                decode_error(bits, None, &mut |error| events.push(Event::of(error, read)));
                events
            }
            Ok(SocketcandAnswer::Hi | SocketcandAnswer::Ok | SocketcandAnswer::Echo) => {
                self.echo = false;
                Vec::new()
            }
            Ok(SocketcandAnswer::Error(_)) if std::mem::take(&mut self.echo) => Vec::new(),
            Ok(SocketcandAnswer::Error(text)) => {
                vec![Event::Ended(format!(
                    "the server of socketcand reports: {text}"
                ))]
            }
            Err(error) => vec![Event::Ended(error.to_string())],
        }
    }
}

/// Stamps are taken modulo this number of seconds, more than 24 years.
const SECONDS: u64 = 800_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::START + Span::from_millis(millis)
    }

    fn frame(text: &str) -> Frame {
        text.parse().expect("a frame")
    }

    fn events(adapter: &mut Adapter, text: &str, read: Instant) -> Vec<Event> {
        text.bytes()
            .flat_map(|character| adapter.push(character, read))
            .collect()
    }

    fn written(adapter: &mut Adapter, now: Instant, text: &str) -> String {
        let mut out = Vec::new();
        assert!(adapter.send(now, &frame(text), &mut out));
        String::from_utf8(out).expect("characters")
    }

    #[test]
    fn an_adapter_hears_and_is_asked_for_its_status() {
        let mut adapter = Adapter::Slcan(Slcan::new(false, true, false));
        let mut out = Vec::new();
        adapter.attend(at(1), &mut out);
        assert_eq!(out, b"F\r");
        assert_eq!(events(&mut adapter, "F00\r", at(2)), []);
        assert_eq!(adapter.due(), Some(at(251)));
        assert_eq!(written(&mut adapter, at(3), "201#3D4000"), "t20133D4000\r");
        assert_eq!(adapter.due(), Some(at(503)));
        let heard = events(&mut adapter, "z\rt181440810100\r", at(4));
        assert_eq!(
            heard,
            [Event::Heard(at(4), CanEvent::Frame(frame("181#40810100")))]
        );
        assert_eq!(adapter.due(), Some(at(251)));
        let flags = events(&mut adapter, "F89\r", at(5));
        assert_eq!(flags.len(), 2, "{flags:?}");
        assert_eq!(flags[0], Event::Overrun);
    }

    /// A buffer that overflows while the computer stalls leaves a line without its middle; the next one is complete.
    #[test]
    fn a_damaged_line_is_lost_and_several_end_the_conversation() {
        let mut adapter = Adapter::Slcan(Slcan::new(false, true, false));
        let text = "t1814408t1814408131005D59\rt181440810100\r";
        let frame = Event::Heard(at(4), CanEvent::Frame(frame("181#40810100")));
        assert_eq!(events(&mut adapter, text, at(4)), [Event::Overrun, frame]);
        let lines = "t1\r".repeat(MOST_DAMAGED);
        let all = events(&mut adapter, &lines, at(5));
        let (last, lost) = all.split_last().expect("an event");
        assert!(lost.iter().all(|event| *event == Event::Overrun));
        assert!(matches!(last, Event::Ended(_)), "{last:?}");
    }

    /// What is refused is the oldest command; an adapter without status is not asked again.
    #[test]
    fn refusals_belong_to_commands() {
        let mut adapter = Adapter::Slcan(Slcan::new(false, true, false));
        adapter.attend(at(1), &mut Vec::new());
        written(&mut adapter, at(1), "201#3D4000");
        assert_eq!(events(&mut adapter, "\x07", at(2)), []);
        assert_eq!(adapter.due(), Some(at(501)));
        let refused = events(&mut adapter, "\x07", at(2));
        assert!(
            matches!(&refused[..], [Event::Ended(why)] if why.contains("201#3D4000")),
            "{refused:?}"
        );
        assert_eq!(adapter.due(), None);
    }

    /// An adapter that does not answer frames is given further ones after a while.
    #[test]
    fn answers_that_do_not_come_are_not_waited_for() {
        let mut adapter = Adapter::Slcan(Slcan::new(false, true, false));
        for _ in 0..MOST_UNANSWERED {
            assert!(adapter.is_ready());
            written(&mut adapter, at(0), "201#3D4000");
        }
        assert!(!adapter.is_ready());
        adapter.attend(at(499), &mut Vec::new());
        assert!(!adapter.is_ready());
        adapter.attend(at(500), &mut Vec::new());
        assert!(adapter.is_ready());
    }

    /// An adapter that answers nothing is not waited for, and not asked for its status.
    #[test]
    fn no_answers_are_expected_of_an_adapter_without() {
        let mut adapter = Adapter::Slcan(Slcan::new(false, false, false));
        let mut out = Vec::new();
        adapter.attend(at(1), &mut out);
        assert_eq!((out, adapter.due()), (Vec::new(), None));
        for _ in 0..=MOST_UNANSWERED {
            assert!(adapter.is_ready());
            written(&mut adapter, at(0), "201#3D4000");
        }
        assert_eq!(adapter.due(), None);
    }

    #[test]
    fn a_daemon_reports_frames_and_errors() {
        let mut adapter = Adapter::Socketcand(Socketcand::new());
        assert_eq!(
            written(&mut adapter, at(0), "201#3D4000"),
            "< send 201 3 3d 40 0 >"
        );
        assert!(!adapter.send(at(0), &frame("201#R3"), &mut Vec::new()));
        let heard = events(&mut adapter, "< frame 181 1700000000.000100 AA >", at(9));
        assert_eq!(
            heard,
            [Event::Heard(at(9), CanEvent::Frame(frame("181#AA")))]
        );
        let errors = events(
            &mut adapter,
            "< error 040 1.0 >< error 020 1.0 >< error 088 1.0 >< error 100 1.0 >< error 002 1.0 >< error 004 1.0 >",
            at(9),
        );
        let error = |error| Event::Heard(at(9), CanEvent::Error(error));
        assert_eq!(
            errors,
            [
                error(CanError::BusOff),
                error(CanError::NoAcknowledge),
                error(CanError::ErrorFrame),
                Event::Message,
                Event::Message,
                // The language does not carry whether the controller's memory was full.
                Event::MayBeLost,
            ]
        );
        // A server without `echo`.
        assert_eq!(events(&mut adapter, "< error unknown command >", at(9)), []);
        for text in ["< error no bus >", "hello >"] {
            let ended = events(&mut adapter, text, at(9));
            assert!(matches!(&ended[..], [Event::Ended(_)]), "{text}: {ended:?}");
        }
    }
}
