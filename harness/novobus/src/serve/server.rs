//! Simulated rings behind streams of bytes, without I/O: bytes and the time are arguments, the deadline is a return value.

use super::recorder::Recorder;
use crate::language::plan::Plan;
use crate::link::SimulatedLink;
use harness_bench::counted::counted;
use harness_bench::link::{Line, Link, LinkFault, Moment, Octets, PlacedFault, link_name};
use harness_bench::medium::ErrorMarks;
use harness_bench::serve::{ClientRole, ControlAnswer, Inner, Pace, ServedBus};
use harness_bench::web::LiveView;
use harness_proto::line::{LineError, Received};
use harness_proto::marks::{BadMark, Unmark, mark};
use harness_proto::time::{Instant, Span};
use harness_sim::fault::Flips;
use harness_sim::record::LineByte;
use std::collections::VecDeque;

/// How long the rings have been at work when the clock starts: the drives' regulators (ND21 4.1) have seen their inputs.
const SETTLED: Span = Span::from_millis(1);

/// How much of a client's bytes waits for the line at most: the rest stays with the client.
const WAITING: Span = Span::from_millis(500);

/// While a client has sent far ahead: how long bytes that reach the master are collected into a batch.
const BATCH: Span = Span::from_millis(1);

/// How much counts as far ahead. A client that has sent less may be waiting for an answer, so its bytes are not collected.
const AHEAD: Span = Span::from_millis(4);

/// While nothing reaches the master: how often the drives are advanced, so that the work does not pile up before the next byte.
const IDLE: Span = Span::from_millis(20);

/// The most time that is made up for at once. A program that was stopped for longer resumes where it was.
const CATCH_UP: Span = Span::from_millis(1_000);

/// The longest leap, in byte times; after it the clock is read again.
const LEAP: u64 = 2_000;

/// How many byte times a leap goes on where the master has nothing more to send.
const STRIDE: u64 = 4;

/// What is taken at a time from a client that only listens, and dropped.
const DROPPED: usize = 4096;

/// Maximum number of bytes that wait for a client. Further bytes are lost, as in a serial port that is not read.
const UNREAD: usize = 64 << 10;

/// Simulated rings with seats for clients: first the master's place of each ring, then the inner links.
#[derive(Clone, Debug)]
pub(crate) struct Server {
    pub(super) plan: Plan,
    pub(super) link: SimulatedLink,
    pace: Pace,
    marks: ErrorMarks,
    seats: Vec<Seat>,
    /// The rings' time `base.1` is the clock's time `base.0`.
    base: (Instant, Instant),
    clock: Instant,
    /// What a live page shows, while one is open.
    pub(super) recorder: Option<Recorder>,
}

/// Where a client sits.
#[derive(Clone, Copy, Debug)]
enum At {
    /// At the master's place of a ring.
    Master(usize),
    /// Between two stations.
    Inner(Inner),
}

/// A place for a client.
#[derive(Clone, Debug)]
struct Seat {
    at: At,
    taken: bool,
    unmark: Unmark,
    /// Bytes sent since the start, by all clients.
    sent: u64,
    /// When the line will have carried them.
    sent_by: Instant,
    /// For the client.
    outbox: VecDeque<u8>,
    lost: u64,
}

impl Seat {
    fn new(at: At) -> Self {
        Self {
            at,
            taken: false,
            unmark: Unmark::default(),
            sent: 0,
            sent_by: Instant::START,
            outbox: VecDeque::new(),
            lost: 0,
        }
    }

    /// Has a byte for the client.
    fn give(&mut self, read: Received, marks: ErrorMarks) {
        let marked = mark(read);
        let bytes = match marks {
            ErrorMarks::None => std::slice::from_ref(&read.byte),
            ErrorMarks::InBand => marked.as_bytes(),
        };
        if !self.taken {
            return;
        }
        if self.outbox.len() + bytes.len() > UNREAD {
            self.lost += 1;
        } else {
            self.outbox.extend(bytes);
        }
    }
}

impl Server {
    /// Serves the rings of a plan, without clients at first. The clock starts at [`Instant::START`].
    ///
    /// Without marks every byte of a client's is a good one, and a byte that comes back damaged is given as it was read (a break as 00).
    /// With marks, as of [`harness_proto::marks`], a byte with an error of the client's reaches the first drive with a parity error, a 00
    /// with an error as a break.
    #[must_use]
    pub(crate) fn new(plan: Plan, mut link: SimulatedLink, pace: Pace, marks: ErrorMarks) -> Self {
        link.stop_recording();
        link.run_until(link.now() + SETTLED);
        Self {
            base: (Instant::START, link.now()),
            seats: (0..plan.rings.len())
                .map(|ring| Seat::new(At::Master(ring)))
                .collect(),
            clock: Instant::START,
            recorder: None,
            plan,
            link,
            pace,
            marks,
        }
    }

    /// Adds a seat at an inner link, behind the existing ones. A link that is cut is open from now on, with or without a client.
    pub(crate) fn add(&mut self, inner: Inner) {
        match inner.role {
            ClientRole::Tap => self.link.tap(inner.ring, inner.link),
            ClientRole::Cut | ClientRole::Upstream | ClientRole::Downstream => {
                self.link.open(inner.ring, inner.link);
            }
        }
        self.seats.push(Seat::new(At::Inner(inner)));
    }

    /// How many rings there are: one or two.
    #[must_use]
    pub(crate) fn rings(&self) -> usize {
        self.plan.rings.len()
    }

    /// How many drives ring `ring` has, rings counted from 0.
    #[must_use]
    pub(crate) fn drives(&self, ring: usize) -> u8 {
        self.link.drives(ring)
    }

    /// The time in the rings: ahead of the clock by what leaps have gained.
    #[cfg(test)]
    pub(crate) fn time(&self) -> Instant {
        self.link.now()
    }

    /// Lets the rings go on until nothing of the masters' is under way.
    fn leap(&mut self) {
        let byte = self.link.byte_time();
        let end = self.link.now() + byte * LEAP;
        while self.link.busy() && self.link.now() < end {
            // While the master sends, no drive is idle; behind that, a stride is far from a time-out.
            let sent_by = self.seats.iter().map(|seat| seat.sent_by).max();
            let stride = self.link.now() + byte * STRIDE;
            let step = sent_by.map_or(stride, |sent_by| stride.max(sent_by));
            self.link.run_until(step.min(end));
            self.base = (self.clock, self.link.now());
        }
    }

    /// Whether a link is cut open.
    pub(super) fn is_open(&self, ring: usize, link: usize) -> bool {
        self.seats.iter().any(|seat| {
            matches!(seat.at, At::Inner(inner) if inner.role != ClientRole::Tap && (inner.ring, inner.link) == (ring, link))
        })
    }

    /// Whether a client has the master's place of a ring.
    pub(super) fn has_master(&self, ring: usize) -> bool {
        self.seats.get(ring).is_some_and(|seat| seat.taken)
    }

    /// Sends octets from the master's place of a ring where no client has it.
    pub(super) fn send_unattended(&mut self, ring: usize, octets: &[u8]) {
        let read: Vec<_> = octets.iter().copied().map(Received::good).collect();
        if let Some(seat) = self.seats.get_mut(ring) {
            send(&mut self.link, seat, ring, &read);
        }
    }

    /// Records every link that is not cut open, or only the taps.
    pub(super) fn record_all(&mut self, all: bool) {
        self.fetch();
        self.recorder = None;
        self.link.stop_recording();
        for seat in &self.seats {
            if let At::Inner(Inner {
                ring,
                link,
                role: ClientRole::Tap,
            }) = seat.at
            {
                self.link.tap(ring, link);
            }
        }
        if all {
            let sizes: Vec<_> = (0..self.rings()).map(|ring| self.drives(ring)).collect();
            for (ring, drives) in sizes.iter().enumerate() {
                for link in 0..=usize::from(*drives) {
                    if !self.is_open(ring, link) {
                        self.link.tap(ring, link);
                    }
                }
            }
            let mut recorder = Recorder::new(&sizes, self.link.byte_time());
            self.link.record_remarks();
            recorder.count_from(&self.link);
            self.recorder = Some(recorder);
        }
    }

    /// Takes what all links have carried into the recorder, and gives taps their part.
    fn record(&mut self) {
        let Some(mut recorder) = self.recorder.take() else {
            return;
        };
        for ring in 0..self.rings() {
            recorder.remark(ring, &self.link.take_remarks(ring));
            for link in 0..=usize::from(self.drives(ring)) {
                if self.is_open(ring, link) {
                    continue;
                }
                let record = self.link.take_record(ring, link);
                let taps = self.seats.iter_mut().filter(|seat| {
                    matches!(seat.at, At::Inner(inner) if (inner.ring, inner.link) == (ring, link))
                });
                for seat in taps {
                    for read in record.iter().filter_map(LineByte::arrival) {
                        seat.give(read, self.marks);
                    }
                }
                recorder.carry(ring, link, &record);
            }
        }
        self.recorder = Some(recorder);
    }

    fn fetch(&mut self) {
        self.record();
        for seat in &mut self.seats {
            match seat.at {
                At::Master(ring) => {
                    while let Some((_, read)) = self.link.receive_octet(ring) {
                        seat.give(read, self.marks);
                    }
                }
                At::Inner(Inner { ring, link, role })
                    if role.hears() && (role != ClientRole::Tap || self.recorder.is_none()) =>
                {
                    for read in self.link.fetch(ring, link) {
                        seat.give(read, self.marks);
                    }
                }
                At::Inner(_) => {}
            }
        }
    }
}

impl ServedBus for Server {
    /// How many seats there are: a ring each, and those added.
    fn seats(&self) -> usize {
        self.seats.len()
    }

    fn masters(&self) -> usize {
        self.plan.rings.len()
    }

    /// What a seat is called: `ring 1`, `tap 2->1`, `cut 2->1`.
    fn name(&self, seat: usize) -> String {
        match self.seats.get(seat).map(|seat| seat.at) {
            None => String::new(),
            Some(At::Master(ring)) => format!("ring {}", ring + 1),
            Some(At::Inner(Inner { ring, link, role })) => {
                let link = link_name(ring, self.drives(ring), link);
                match role {
                    ClientRole::Tap => format!("tap {link}"),
                    ClientRole::Cut => format!("cut {link}"),
                    ClientRole::Upstream => format!("cut {link} upstream"),
                    ClientRole::Downstream => format!("cut {link} downstream"),
                }
            }
        }
    }

    fn title(&self, seat: usize) -> String {
        let name = self.name(seat);
        match self.seats.get(seat).map(|seat| seat.at) {
            Some(At::Master(ring)) => format!("{name}: {}", counted(self.drives(ring), "drive")),
            _ => name,
        }
    }

    /// A client takes a seat.
    fn come(&mut self, seat: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.taken = true;
            seat.unmark = Unmark::default();
        }
    }

    /// The client has gone: what it has not fetched is dropped, and half a mark is forgotten. The ring lives on, and what is
    /// under way there goes its way.
    fn go(&mut self, seat: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.taken = false;
            seat.outbox.clear();
            seat.lost = 0;
        }
    }

    /// How many bytes of its client's stream a seat takes now: none while half a second of them waits for the line.
    fn room(&self, seat: usize) -> usize {
        let Some(seat) = self.seats.get(seat) else {
            return 0;
        };
        if matches!(seat.at, At::Inner(inner) if !inner.role.feeds()) {
            return DROPPED;
        }
        let byte = self.link.byte_time().units().max(1);
        let waiting = seat.sent_by.since(self.link.now());
        let room = WAITING.saturating_sub(waiting).units() / byte;
        usize::try_from(room).unwrap_or(usize::MAX)
    }

    /// Takes bytes of a client's stream, which leave one after another behind those still to be sent. Of a client that
    /// only listens they are dropped.
    ///
    /// # Errors
    /// The first byte that is no mark where one must stand; it is dropped, and the others are taken.
    fn receive(&mut self, seat: usize, bytes: &[u8]) -> Result<(), BadMark> {
        let Some(seat) = self.seats.get_mut(seat) else {
            return Ok(());
        };
        let mut read = Vec::with_capacity(bytes.len());
        let mut wrong = Ok(());
        for &byte in bytes {
            match self.marks {
                ErrorMarks::None => read.push(Received::good(byte)),
                ErrorMarks::InBand => match seat.unmark.push(byte) {
                    None => {}
                    Some(Err(bad)) => wrong = wrong.and(Err(bad)),
                    Some(Ok(byte)) => read.push(byte),
                },
            }
        }
        match seat.at {
            At::Master(ring) => send(&mut self.link, seat, ring, &read),
            At::Inner(Inner { ring, link, role }) if role.feeds() => {
                for byte in read {
                    seat.sent_by = self.link.feed(ring, link, byte);
                }
            }
            At::Inner(_) => {}
        }
        wrong
    }

    /// Lets time pass up to the clock's time `clock`, in the rings as their pace is.
    fn advance(&mut self, clock: Instant) {
        self.clock = self.clock.max(clock);
        let (from, to) = self.base;
        let due = to + self.clock.since(from);
        let most = self.link.now() + CATCH_UP;
        self.link.run_until(due.min(most));
        if due > most {
            self.base = (self.clock, self.link.now());
        }
        if self.pace == Pace::Free {
            self.leap();
        }
        self.fetch();
    }

    /// What a seat has for its client.
    fn transmit(&mut self, seat: usize) -> &[u8] {
        self.seats
            .get_mut(seat)
            .map_or(&[], |seat| seat.outbox.make_contiguous())
    }

    /// The first `count` bytes of that have been passed on.
    fn transmitted(&mut self, seat: usize, count: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            let count = count.min(seat.outbox.len());
            seat.outbox.drain(..count);
        }
    }

    /// How many bytes the client has lost because it did not read.
    fn lost(&self, seat: usize) -> u64 {
        self.seats.get(seat).map_or(0, |seat| seat.lost)
    }

    /// When, by the clock, the next byte arrives at a master that may be waiting for it. The client cannot know what to send before it has
    /// this byte, so any delay in handing it over leaves the line idle.
    fn awaited(&self) -> Option<Instant> {
        let (from, to) = self.base;
        let soon = self.link.now() + AHEAD;
        let homes = self.seats.iter().filter_map(|seat| match seat.at {
            At::Master(ring) if seat.taken && seat.sent_by <= soon => self.link.next_home(ring),
            At::Master(_) | At::Inner(_) => None,
        });
        homes.min().map(|home| from + home.since(to))
    }

    /// When, by the clock, [`Self::advance`] is to be called again if nothing comes before.
    fn deadline(&self) -> Instant {
        if self.pace == Pace::Free && self.link.busy() {
            return self.clock;
        }
        let (from, to) = self.base;
        let on_clock = |at: Instant| from + at.since(to);
        let idle = self.clock + IDLE;
        let soon = self.link.now() + AHEAD;
        let mut batch = BATCH;
        let mut next = self.link.next_event();
        let mut exact = self.awaited().unwrap_or(idle);
        for seat in &self.seats {
            match seat.at {
                // A byte that is not yet on the last link is there in a byte time.
                At::Master(_) if seat.taken && seat.sent_by <= soon => {
                    batch = batch.min(self.link.byte_time());
                }
                At::Master(_) if seat.taken => {
                    exact = exact.min(on_clock(seat.sent_by - AHEAD));
                }
                At::Inner(inner) if inner.role.hears() => {
                    let fetch = self.link.next_fetch(inner.ring, inner.link);
                    next = next.into_iter().chain(fetch).min();
                }
                At::Master(_) | At::Inner(_) => {}
            }
        }
        let next = next.map_or(idle, |next| on_clock(next).clamp(self.clock + batch, idle));
        next.min(exact).max(self.clock)
    }

    fn control(&mut self, line: &str) -> Option<ControlAnswer> {
        Self::control(self, line)
    }

    fn live(&mut self) -> &mut dyn LiveView {
        self
    }
}

/// Lets the master send what its client has sent.
fn send(link: &mut SimulatedLink, seat: &mut Seat, ring: usize, read: &[Received]) {
    let byte_time = link.byte_time();
    for (number, read) in (seat.sent + 1..).zip(read) {
        if let Some(error) = read.error {
            let fault = PlacedFault::Link(0, damage(error, byte_time));
            link.inject(ring, fault, Moment::Byte(number));
        }
    }
    if !read.is_empty() {
        let bytes: Vec<_> = read.iter().map(|read| read.byte).collect();
        seat.sent += bytes.len() as u64;
        seat.sent_by = link.send_octets(ring, &bytes);
    }
}

/// What makes a byte arrive with this error.
fn damage(error: LineError, byte_time: Span) -> LinkFault {
    match error {
        LineError::Parity => LinkFault::Flip(Flips {
            parity: true,
            ..Flips::default()
        }),
        LineError::Framing => LinkFault::Flip(Flips {
            stop: true,
            ..Flips::default()
        }),
        LineError::Overrun => LinkFault::Overrun,
        // No longer than the byte: the next one is whole.
        LineError::Break => LinkFault::Break(byte_time),
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
