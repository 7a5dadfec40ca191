//! A port in use: it listens, is taken up again when it was away, and gives what it hears as pieces of a capture.

use super::CaptureArguments;
use super::place::{TapAt, TapPort};
use crate::buses::carrier;
use crate::capture::live::LiveText;
use crate::capture::senders::TelegramCutter;
use crate::capture::{AWAY, Piece, RecordedPlace};
use crate::command::exit::Exit;
use crate::counted::counted;
use crate::link::Line as _;
use crate::link::frames::{
    AdapterError, AdapterPlace, AdapterSettings, FrameLink, Listening, Reports,
};
use crate::medium;
use crate::port::{Counts, OpenError, SilentTap, TapState};
use crate::trouble::Trouble;
use harness_proto::can::{CanError, CanEvent, Frame};
use harness_proto::line::{Format, Received};
use harness_proto::time::{Instant as LineInstant, Span};
use harness_proto::unitek::sender_of;
use harness_sim::record::{FrameEnd, LineByte, LineFrame};
use rustix::event::{PollFd, PollFlags};
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often a port that is away is tried again, and counts of the kernel are read.
const AGAIN: Duration = Duration::from_millis(500);

/// Why a port cannot be listened to.
#[derive(Debug, thiserror::Error)]
pub(super) enum ListenError {
    #[error(transparent)]
    Tap(#[from] OpenError),
    #[error(transparent)]
    Adapter(#[from] AdapterError),
    #[error(
        "{0}: whether the server's controller listens only cannot be read back, so it may acknowledge frames; use an SLCAN adapter, or permit it \
         with --may-acknowledge"
    )]
    Unknown(String),
}

impl ListenError {
    pub(super) fn exit(&self) -> Exit {
        match self {
            Self::Tap(OpenError::InUse { .. })
            | Self::Adapter(AdapterError::Open(OpenError::InUse { .. })) => Exit::Busy,
            _ => Exit::RigError,
        }
    }
}

/// What listens.
enum Ear {
    Octets(SilentTap),
    Frames(Box<FrameLink>),
    /// Opening an adapter takes seconds, and the other taps go on.
    Opening(JoinHandle<Result<FrameLink, AdapterError>>),
    Away,
}

/// A tap in use.
pub(super) struct Tap {
    pub(super) at: TapAt,
    pub(super) place: RecordedPlace,
    pub(super) text: Box<dyn LiveText>,
    /// What is known of a CAN adapter's acknowledgements; the least, where it was opened several times.
    listening: Option<Listening>,
    ear: Ear,
    settings: TapSettings,
    cutter: Option<TelegramCutter>,
    /// What the kernel had counted when the port was opened.
    before: Option<Counts>,
    looked: Instant,
    /// The time of the last octet.
    last: u64,
    pub(super) pieces: u64,
    pub(super) damaged: u64,
    /// What CAN adapters have reported beside frames and errors.
    reports: Reports,
}

/// How a port is opened.
#[derive(Clone)]
struct TapSettings {
    in_band: bool,
    may_acknowledge: bool,
    /// The format of rings.
    ring: Format,
    stop: Arc<AtomicBool>,
}

/// Opens a CAN adapter, which listens only.
fn adapter(at: &TapAt, settings: &TapSettings) -> Result<FrameLink, AdapterError> {
    let TapPort::Frames(place, rate) = &at.port else {
        return Err(AdapterError::Interrupted);
    };
    let adapter = AdapterSettings {
        place: place.clone(),
        rate: *rate,
        listen_only: true,
        may_acknowledge: settings.may_acknowledge,
    };
    let mut link = FrameLink::open(&adapter, Vec::new(), Arc::clone(&settings.stop))?;
    link.keep_no_trace();
    Ok(link)
}

impl TapSettings {
    fn open(&self, at: &TapAt) -> Result<Ear, ListenError> {
        let tap = |path, format| SilentTap::open(path, format, self.in_band);
        Ok(match &at.port {
            TapPort::Link(path) => Ear::Octets(tap(path, self.ring)?),
            TapPort::Line(path, format) => Ear::Octets(tap(path, *format)?),
            TapPort::Frames(AdapterPlace::Socketcand { .. }, _) if !self.may_acknowledge => {
                return Err(ListenError::Unknown(at.port.to_string()));
            }
            TapPort::Frames(..) => Ear::Frames(Box::new(adapter(at, self)?)),
        })
    }
}

impl Tap {
    /// Opens a port. `drives` is the size of the ring, where it is known.
    pub(super) fn open(
        at: &TapAt,
        arguments: &CaptureArguments,
        drives: Option<u8>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Self, ListenError> {
        let place = at.place(arguments.line);
        let settings = TapSettings {
            in_band: arguments.in_band,
            may_acknowledge: arguments.may_acknowledge,
            ring: Format::from(arguments.line),
            stop: Arc::clone(stop),
        };
        let cutter = match &at.port {
            TapPort::Line(_, format) => Some(TelegramCutter::new(format.octet_time())),
            TapPort::Link(_) | TapPort::Frames(..) => None,
        };
        let ear = settings.open(at)?;
        let mut tap = Self {
            at: at.clone(),
            text: (carrier(place.carries).live)(&place, drives),
            place,
            listening: None,
            ear,
            settings,
            cutter,
            before: None,
            looked: Instant::now(),
            last: 0,
            pieces: 0,
            damaged: 0,
            reports: Reports::default(),
        };
        tap.note_listening();
        tap.before = tap.counts();
        Ok(tap)
    }

    fn note_listening(&mut self) {
        if let Ear::Frames(link) = &self.ear {
            let now = Some(link.listening());
            self.listening = self.listening.max(now);
        }
    }

    fn counts(&self) -> Option<Counts> {
        match &self.ear {
            Ear::Octets(tap) => tap.counts(),
            Ear::Frames(_) | Ear::Opening(_) | Ear::Away => None,
        }
    }

    /// For waiting; `None` while the port is away.
    pub(super) fn poll_fd(&self) -> Option<PollFd<'_>> {
        match &self.ear {
            Ear::Octets(tap) => Some(PollFd::new(tap, PollFlags::IN)),
            Ear::Frames(link) => Some(PollFd::from_borrowed_fd(link.fd(), PollFlags::IN)),
            Ear::Opening(_) | Ear::Away => None,
        }
    }

    /// What was heard until now, in nanoseconds since 1970.
    pub(super) fn hear(&mut self, now: u64) -> io::Result<Vec<Piece>> {
        let mut pieces = Vec::new();
        match &mut self.ear {
            Ear::Octets(tap) => {
                let mut heard = Vec::new();
                let state = tap.read(&mut heard)?;
                self.octets(now, heard, &mut pieces);
                if state == TapState::Gone {
                    self.leave(now, AWAY.to_owned(), &mut pieces);
                }
            }
            Ear::Frames(_) => self.frames(now, &mut pieces),
            Ear::Opening(_) | Ear::Away => self.look_for_it(now, &mut pieces),
        }
        if let Ear::Octets(tap) = &mut self.ear
            && self.looked.elapsed() >= AGAIN
        {
            self.looked = Instant::now();
            let lost = tap.take_lost();
            if lost > 0 {
                let words = format!(
                    "{lost} or more bytes lost: the port's queue was full, or another program reads the port"
                );
                pieces.push(Piece::Event(now, words));
            }
        }
        Ok(pieces)
    }

    /// Octets that were read now: the last one has just arrived, and those before it came one behind the other.
    fn octets(&mut self, now: u64, heard: Vec<Received>, pieces: &mut Vec<Piece>) {
        let octet = match &self.at.port {
            TapPort::Line(_, format) => format.octet_time(),
            TapPort::Link(_) | TapPort::Frames(..) => self.settings.ring.octet_time(),
        };
        let count = heard.len() as u64;
        for (received, place) in heard.into_iter().zip(1..) {
            let behind = octet.as_nanos().saturating_mul(count - place);
            let nanos = now.saturating_sub(behind).max(self.last);
            self.last = nanos;
            self.pieces += 1;
            self.damaged += u64::from(received.error.is_some());
            match &mut self.cutter {
                Some(cutter) => cutter.push(now, received),
                None => {
                    let at = instant(nanos);
                    let byte = LineByte::seen(
                        at,
                        Some(received.byte),
                        Some(received.byte),
                        received.error,
                    );
                    pieces.push(Piece::Octet(byte));
                }
            }
        }
        let cut = self.cutter.as_mut().map(|cutter| cutter.cut(now));
        let telegrams = cut.into_iter().flatten();
        pieces.extend(telegrams.map(|(from, octets)| Piece::Telegram(from, octets)));
    }

    /// Frames that an adapter has heard.
    fn frames(&mut self, now: u64, pieces: &mut Vec<Piece>) {
        let Ear::Frames(link) = &mut self.ear else {
            return;
        };
        let rate = match &self.at.port {
            TapPort::Frames(_, rate) => *rate,
            TapPort::Link(_) | TapPort::Line(..) => return,
        };
        // Reads what has come, without waiting.
        let sound = link.wait(LineInstant::START);
        let present = link.now();
        while let Some((at, heard)) = link.receive(0) {
            let nanos = now.saturating_sub(present.since(at).as_nanos());
            match heard {
                medium::HeardPiece::Frame(CanEvent::Frame(frame)) => {
                    self.pieces += 1;
                    let lasted = rate.time_of(frame.wire_bits());
                    pieces.push(Piece::Frame(line_frame(nanos, lasted, frame)));
                }
                medium::HeardPiece::Frame(CanEvent::Error(error)) => {
                    self.damaged += 1;
                    pieces.push(Piece::Event(nanos, error_words(error).to_owned()));
                }
                medium::HeardPiece::Octet(_) => {}
            }
        }
        let reports = link.take_reports();
        let words = losses(&reports);
        pieces.extend(words.map(|sentence| Piece::Event(now, sentence)));
        self.reports.add(&reports);
        let trouble = link.trouble().cloned();
        if !sound && trouble != Some(Trouble::Interrupted) {
            let of_kernel = matches!(
                self.at.port,
                TapPort::Frames(AdapterPlace::Kernel { .. }, _)
            );
            let why = match trouble {
                Some(trouble) if of_kernel => format!("frames may be lost: {trouble}"),
                _ => AWAY.to_owned(),
            };
            self.leave(now, why, pieces);
        }
    }

    fn leave(&mut self, now: u64, why: String, pieces: &mut Vec<Piece>) {
        self.ear = Ear::Away;
        self.looked = Instant::now();
        pieces.push(Piece::Event(now, why));
    }

    /// Takes a port up again when it has come back.
    fn look_for_it(&mut self, now: u64, pieces: &mut Vec<Piece>) {
        match std::mem::replace(&mut self.ear, Ear::Away) {
            Ear::Opening(thread) if !thread.is_finished() => self.ear = Ear::Opening(thread),
            Ear::Opening(thread) => {
                if let Ok(Ok(link)) = thread.join() {
                    self.ear = Ear::Frames(Box::new(link));
                }
            }
            Ear::Away if self.looked.elapsed() < AGAIN => {}
            Ear::Away => {
                self.looked = Instant::now();
                let (at, settings) = (self.at.clone(), self.settings.clone());
                match at.port {
                    TapPort::Frames(..) => {
                        self.ear =
                            Ear::Opening(std::thread::spawn(move || adapter(&at, &settings)));
                    }
                    TapPort::Link(_) | TapPort::Line(..) => {
                        self.ear = settings.open(&at).unwrap_or(Ear::Away);
                        // The driver of an adapter that is plugged in again counts from 0.
                        self.before = self.counts();
                    }
                }
            }
            other => self.ear = other,
        }
        self.note_listening();
        if matches!(self.ear, Ear::Octets(_) | Ear::Frames(_)) {
            pieces.push(Piece::Event(now, "the adapter is back".to_owned()));
        }
    }

    /// How the capture at this place went, and whether the kernel sent anything.
    pub(super) fn summary(&self) -> (String, bool) {
        let mut spoke = false;
        let silent = match &self.at.port {
            TapPort::Frames(AdapterPlace::Socketcand { .. }, _) => {
                "whether the server's controller acknowledges is not known".to_owned()
            }
            TapPort::Frames(..) => match self.listening {
                Some(Listening::Only(mode)) => format!(
                    "the adapter took the listen-only mode ({mode}), in which it sends nothing on the bus"
                ),
                Some(Listening::Unconfirmed(mode)) => format!(
                    "the adapter was set to its listen-only mode ({mode}), which its firmware never confirms"
                ),
                Some(Listening::MayAcknowledge) | None => {
                    "the adapter does not listen only: it may have acknowledged frames".to_owned()
                }
            },
            TapPort::Link(_) | TapPort::Line(..) => match self.before.zip(self.counts()) {
                None => "bytes sent: not counted by the driver".to_owned(),
                Some((before, now)) => {
                    spoke = now.sent != before.sent;
                    format!("bytes sent: {}", now.since(before).sent)
                }
            },
        };
        let (pieces, errors) = match &self.at.port {
            TapPort::Frames(..) => ("frames", "errors"),
            TapPort::Link(_) | TapPort::Line(..) => ("bytes", "damaged"),
        };
        let text = format!(
            "  {} at {}: {} {pieces}, {} {errors}{}; {silent}\n",
            self.at.name,
            self.at.port,
            self.pieces,
            self.damaged,
            beside(&self.reports)
        );
        (text, spoke)
    }
}

/// Events for losses. The words mark a capture as one of which frames are missing.
fn losses(reports: &Reports) -> impl Iterator<Item = String> {
    let late = (reports.late > 0).then(|| {
        let frames = counted(reports.late, "frame");
        format!("{frames} lost: the computer read too late")
    });
    let [full, may_be] = [
        (
            reports.overruns,
            "frames lost: the adapter's queue was full",
        ),
        (
            reports.doubtful,
            "frames may be lost: the adapter does not say which message its controller sent",
        ),
    ]
    .map(|(count, words)| (count > 0).then(|| words.to_owned()));
    [late, full, may_be].into_iter().flatten()
}

/// The same for a summary, with the messages that say nothing wrong.
fn beside(reports: &Reports) -> String {
    let lost = match (reports.late, reports.overruns) {
        (0, 0) if reports.doubtful > 0 => ", some may be lost".to_owned(),
        (0, 0) => String::new(),
        (late, 0) => format!(", {late} lost"),
        (0, _) => ", some lost".to_owned(),
        (late, _) => format!(", {late} and more lost"),
    };
    match reports.messages {
        0 => lost,
        count => format!("{lost}, {count} other messages of the controller"),
    }
}

fn instant(nanos: u64) -> LineInstant {
    LineInstant::START + Span::from_nanos(nanos)
}

fn line_frame(nanos: u64, lasted: Span, frame: Frame) -> LineFrame {
    let at = instant(nanos);
    LineFrame {
        from: sender_of(&frame),
        start: at - lasted,
        at,
        frame,
        ended: FrameEnd::Good,
    }
}

const fn error_words(error: CanError) -> &'static str {
    match error {
        CanError::ErrorFrame => "an error on the bus",
        CanError::NoAcknowledge => "a frame without an acknowledge",
        CanError::BusOff => "the adapter is bus-off",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every loss is an event that keeps the capture from accusing a drive, and stands in the summary.
    #[test]
    fn losses_are_events_and_stand_in_the_summary() {
        let of = |late, overruns, doubtful, messages| Reports {
            late,
            overruns,
            doubtful,
            messages,
        };
        for (reports, events, words) in [
            (of(0, 0, 0, 0), 0, ""),
            (of(0, 0, 0, 9), 0, ", 9 other messages of the controller"),
            (of(2721, 0, 0, 0), 1, ", 2721 lost"),
            (of(2, 1, 0, 0), 2, ", 2 and more lost"),
            (of(0, 3, 1, 0), 2, ", some lost"),
            (
                of(0, 0, 1, 2),
                1,
                ", some may be lost, 2 other messages of the controller",
            ),
        ] {
            let all: Vec<_> = losses(&reports).collect();
            assert!(
                all.len() == events && all.iter().all(|sentence| sentence.contains(" lost: ")),
                "{all:?}"
            );
            assert_eq!(beside(&reports), words);
        }
    }
}
