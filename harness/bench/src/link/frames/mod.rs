//! Frames over a CAN adapter in real time: SLCAN behind a serial port, a pseudo terminal or a socket, socketcand, and an interface of Linux.
//!
//! Time is the computer's monotonic clock. A frame is stamped by the adapter where it has stamps, and with the time of reading where it
//! has none. When a frame of the bench itself was on the bus is not reported by either language: it counts as sent as soon as the bus can
//! have been free for it.
//!
//! Nothing here decides what may be sent: the guard in front of this link does.

pub mod adapter;
pub mod clock;
pub mod kernel;
pub mod open;
pub mod talk;
pub mod transport;

pub use open::{AdapterError, AdapterPlace, AdapterSettings, Listening};

use super::port_end::MOST_RECORDED;
use super::{Capability, InnerLink, Lead, Line, Link, Moment, PlacedFault, PortLink, Trouble};
use crate::medium::{HeardPiece, Medium, Out};
use crate::port::{LastWords, Switch, wake_on_time};
use adapter::Event;
use harness_proto::can::{self, BitRate, CanError, Frame};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, FrameEnd, LineFrame, Trace};
use rustix::event::{Timespec, poll};
use rustix::fd::BorrowedFd;
use std::cell::Cell;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time;
use transport::FrameTransport;

/// How far ahead of the bus frames are handed to the adapter.
const AHEAD: Span = Span::from_millis(2);

/// How long after the bench's last frame an answer to it may come through an adapter and a busy computer.
pub const SLACK: Span = Span::from_millis(30);

/// The longest sleep: a request to end is polled at least this often.
const NAP: Span = Span::from_millis(50);

/// Counts of what an adapter reports besides frames and errors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reports {
    /// Frames lost since the computer read too late.
    pub late: u64,
    /// Losses of which the adapter does not say how many frames.
    pub overruns: u64,
    /// Messages of which the adapter does not say whether frames were lost.
    pub doubtful: u64,
    /// Messages that say nothing wrong: lost arbitration, back in the state error-active.
    pub messages: u64,
}

impl Reports {
    pub const fn add(&mut self, more: &Self) {
        self.late += more.late;
        self.overruns += more.overruns;
        self.doubtful += more.doubtful;
        self.messages += more.messages;
    }
}

/// A link over a CAN adapter, with one port.
#[derive(Debug)]
pub struct FrameLink {
    transport: Box<dyn FrameTransport>,
    rate: BitRate,
    listen_only: bool,
    listening: Listening,
    /// The identifier with which each drive sends.
    senders: Vec<(can::Id, u8)>,
    /// When the conversation started, and that on the adapter's clock, which starts with the link.
    start: time::Instant,
    opened: time::Instant,
    /// The last time that `now` returned.
    told: Cell<Instant>,
    /// What has not been handed to the adapter.
    queue: VecDeque<Frame>,
    /// When the bus is free for the next frame.
    free: Instant,
    /// Pieces of the last `send` that were not taken.
    refused: usize,
    received: VecDeque<(Instant, can::CanEvent)>,
    /// Input was reported and is still unread.
    lying: bool,
    log: Vec<LineFrame>,
    /// Frames in the log at most.
    most_recorded: usize,
    carried: u64,
    reports: Reports,
    interrupt: Arc<AtomicBool>,
    beats: Arc<AtomicU64>,
    trouble: Option<Trouble>,
}

impl FrameLink {
    /// Opens an adapter and its channel. `senders` says which drive sends with which identifier; what comes with another one counts as
    /// from station 0. When `interrupt` is set, the link stops with [`Trouble::Interrupted`].
    ///
    /// # Errors
    /// [`AdapterError`]; the channel is closed again.
    pub fn open(
        settings: &AdapterSettings,
        senders: Vec<(can::Id, u8)>,
        interrupt: Arc<AtomicBool>,
    ) -> Result<Self, AdapterError> {
        wake_on_time();
        let (transport, listening) = open::open(settings, &interrupt)?;
        let mut link = Self::over(transport, settings, senders, interrupt);
        link.listening = listening;
        Ok(link)
    }

    fn over(
        transport: Box<dyn FrameTransport>,
        settings: &AdapterSettings,
        senders: Vec<(can::Id, u8)>,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        let now = time::Instant::now();
        Self {
            transport,
            rate: settings.rate,
            listen_only: settings.listen_only,
            listening: Listening::MayAcknowledge,
            senders,
            start: now,
            opened: now,
            told: Cell::new(Instant::START),
            queue: VecDeque::new(),
            free: Instant::START,
            refused: 0,
            received: VecDeque::new(),
            lying: false,
            log: Vec::new(),
            most_recorded: MOST_RECORDED,
            carried: 0,
            reports: Reports::default(),
            interrupt,
            beats: Arc::default(),
            trouble: None,
        }
    }

    /// What is known of the adapter's acknowledgements.
    pub const fn listening(&self) -> Listening {
        self.listening
    }

    /// What the adapter has reported since the last call.
    pub fn take_reports(&mut self) -> Reports {
        std::mem::take(&mut self.reports)
    }

    /// Keeps no trace from now on: a capture takes what is received.
    pub fn keep_no_trace(&mut self) {
        self.most_recorded = 0;
    }

    /// The descriptor of its stream, for locks.
    #[must_use]
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.transport.fd()
    }

    /// A time of the computer's clock, in the conversation.
    fn at(&self, time: time::Instant) -> Instant {
        Instant::START + span(time.saturating_duration_since(self.start))
    }

    /// The time on the adapter's clock, which goes on when a conversation begins.
    fn adapter_now(&self) -> Instant {
        Instant::START + span(self.opened.elapsed())
    }

    /// The start of the conversation on that clock.
    fn begun(&self) -> Span {
        span(self.start.saturating_duration_since(self.opened))
    }

    fn clock_now(&self) -> Instant {
        self.at(time::Instant::now())
    }

    fn is_sound(&self) -> bool {
        self.trouble.is_none()
    }

    fn end(&mut self, trouble: Trouble) {
        self.queue.clear();
        self.trouble.get_or_insert(trouble);
    }

    /// Hands over what is due, and reads what was received.
    fn look(&mut self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
        if self.interrupt.load(Ordering::Relaxed) {
            self.end(Trouble::Interrupted);
        }
        let given = self.give();
        let took = self.take();
        if let Err(trouble) = given.and(took) {
            self.end(trouble);
        }
    }

    fn give(&mut self) -> Result<(), Trouble> {
        if !self.is_sound() {
            return Ok(());
        }
        let (now, begun) = (self.clock_now(), self.begun());
        while let Some(&frame) = self.queue.front()
            && self.free <= now + AHEAD
            && self.transport.is_ready()
        {
            self.queue.pop_front();
            self.transport.send(now + begun, &frame)?;
            let start = self.free.max(now);
            self.free = start + self.rate.time_of(frame.wire_bits());
            self.keep(None, start, self.free, frame);
        }
        self.transport.attend(now + begun)
    }

    fn take(&mut self) -> Result<(), Trouble> {
        if self.trouble.as_ref().is_some_and(Trouble::stops_the_line) {
            return Ok(());
        }
        let mut events = Vec::new();
        let (now, begun) = (self.adapter_now(), self.begun());
        let result = self.transport.receive(now, &mut events);
        for event in events {
            match event {
                Event::Heard(at, heard) => self.hear(at - begun, heard),
                Event::Late(count) => self.reports.late += u64::from(count),
                Event::Overrun => self.reports.overruns += 1,
                Event::MayBeLost => self.reports.doubtful += 1,
                Event::Message => self.reports.messages += 1,
                Event::Ended(why) => {
                    let why = format!("{}: {why}", self.transport.name());
                    self.end(Trouble::Lost(why));
                }
            }
        }
        result
    }

    fn hear(&mut self, at: Instant, heard: can::CanEvent) {
        let last = self.received.back();
        let again = last.is_some_and(|(_, last)| *last == heard);
        let repeats = again && matches!(heard, can::CanEvent::Error(_));
        if !repeats {
            self.received.push_back((at, heard));
        }
        match heard {
            can::CanEvent::Frame(frame) => {
                let from = self.senders.iter().find(|(id, _)| *id == frame.id());
                let from = from.map_or(0, |(_, drive)| *drive);
                let start = at - self.rate.time_of(frame.wire_bits());
                self.keep(Some(from), start, at, frame);
            }
            // Until the kernel has restarted it, it hears nothing.
            can::CanEvent::Error(CanError::BusOff) if self.transport.restarts() => {
                self.reports.overruns += 1;
            }
            can::CanEvent::Error(CanError::BusOff) => {
                let why = format!(
                    "{}: the adapter is bus-off: check rate, cable and termination, and start it again",
                    self.transport.name()
                );
                self.end(Trouble::Lost(why));
            }
            can::CanEvent::Error(_) => {}
        }
    }

    fn keep(&mut self, from: Option<u8>, start: Instant, at: Instant, frame: Frame) {
        self.carried += 1;
        if self.log.len() < self.most_recorded {
            self.log.push(LineFrame {
                from,
                start,
                at,
                frame,
                ended: FrameEnd::Good,
            });
        }
    }

    fn listen(&mut self, until: Instant) {
        let due = match self.queue.is_empty() {
            true => self.transport.due().map(|due| due - self.begun()),
            false => Some(self.free - AHEAD),
        };
        let now = self.clock_now();
        let until = due.map_or(until, |due| until.min(due)).min(now + NAP);
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::try_from(until.since(now).as_nanos()).unwrap_or(0),
        };
        // An error shows when the stream is read.
        let _ready = poll(&mut [self.transport.poll_fd()], Some(&timeout));
    }
}

fn span(duration: time::Duration) -> Span {
    Span::from_nanos(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX))
}

impl Line for FrameLink {
    fn medium(&self, _port: usize) -> Medium {
        Medium::Frames(self.rate)
    }

    fn now(&self) -> Instant {
        let now = self.clock_now();
        self.told.set(now);
        now
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let now = self.now();
        self.refused = 0;
        if !self.permits(port, what) {
            self.refused = what.len();
            return now;
        }
        self.queue.extend(what.frames());
        self.look();
        let waiting = self.queue.iter().map(Frame::wire_bits).sum();
        self.free.max(now) + self.rate.time_of(waiting)
    }

    /// Nothing while the bench only listens, and only what the adapter's language carries.
    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        let mut frames = what.frames().iter();
        let carried = what.octets().is_empty() && frames.all(|frame| self.transport.carries(frame));
        let speaks = !self.listen_only || what.is_empty();
        carried && speaks && port == 0 && self.is_sound()
    }

    fn refused(&self) -> usize {
        self.refused
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        if port > 0 {
            return None;
        }
        let (at, heard) = self.received.pop_front()?;
        self.lying = false;
        Some((at, HeardPiece::Frame(heard)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.look();
        if (self.lying || self.received.is_empty()) && self.is_sound() && self.clock_now() < until {
            self.listen(until);
            self.look();
        }
        self.lying = !self.received.is_empty();
        self.is_sound()
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.trouble.as_ref()
    }

    fn lead(&self) -> Lead {
        Lead {
            far: AHEAD,
            near: Span::ZERO,
        }
    }
}

impl Link for FrameLink {
    /// What the limits of a rig can permit, and what can be set over the bus.
    fn capabilities(&self) -> &[Capability] {
        &[Capability::Memory, Capability::Motion, Capability::Eeprom]
    }

    fn begin(&mut self) {
        self.look();
        let now = self.clock_now();
        self.free = Instant::START + self.free.since(now);
        self.start += time::Duration::from_nanos(now.since_start().as_nanos());
        self.told.set(Instant::START);
        self.queue.clear();
        self.received.clear();
        self.lying = false;
        self.log.clear();
        self.carried = 0;
    }

    fn busy(&self) -> bool {
        let answers = self.free + SLACK;
        let waits = !self.queue.is_empty() || self.transport.waits();
        let sent = self.log.iter().any(|frame| frame.from.is_none());
        self.is_sound() && (waits || (sent && self.clock_now() < answers))
    }

    fn inject(&mut self, _port: usize, _fault: PlacedFault, _moment: Moment) {}

    fn reaches(&self, _ring: usize, _link: usize) -> bool {
        false
    }

    fn time_tolerance(&self) -> Span {
        SLACK
    }

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn record(&mut self, _on: bool) {
        self.log.clear();
    }

    fn carried(&self) -> u64 {
        self.carried
    }

    fn drives(&self, _port: usize) -> u8 {
        u8::try_from(self.senders.len()).unwrap_or(u8::MAX)
    }

    fn trace(&self, port: usize) -> Trace {
        Trace {
            channels: vec![Channel::of_frames(self.log.clone())],
            ..Trace::empty(self.drives(port))
        }
    }
}

impl PortLink for FrameLink {
    fn beats(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.beats)
    }

    fn last_words(&self) -> io::Result<Vec<LastWords>> {
        self.transport.last_words().map(|words| vec![words])
    }

    fn resume(&mut self) {
        match self.trouble {
            Some(Trouble::Interrupted) => self.interrupt = Arc::default(),
            Some(Trouble::Lost(_)) if self.transport.revive() => {}
            _ => return,
        }
        self.trouble = None;
    }

    fn take_unplaced(&mut self) -> u64 {
        std::mem::take(&mut self.reports.late) + std::mem::take(&mut self.reports.overruns)
    }

    fn take_doubtful(&mut self) -> u64 {
        std::mem::take(&mut self.reports.doubtful)
    }

    fn take_switches(&mut self) -> Vec<Switch> {
        Vec::new()
    }

    fn inner_links(&self) -> &[InnerLink] {
        &[]
    }
}

#[cfg(test)]
mod tests;
