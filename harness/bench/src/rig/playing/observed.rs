//! A link that notes how late the computer is, and lets a bus note what is sent and received.

use crate::link::{Capability, Lead, Line, Link, Moment, PlacedFault, Trouble};
use crate::medium::{HeardPiece, Medium, Out};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What a bus notes of its link. LinkNotes follow from what the link shows, so that a record gives the same ones.
pub trait LinkNotes: Default + Send {
    /// Something was sent; it has left at `end`.
    fn sent(&mut self, what: Out<'_>, end: Instant);

    /// Something came over this medium at `at`, and was read at `now`.
    fn heard(&mut self, medium: Medium, at: Instant, now: Instant, heard: HeardPiece);

    /// A step of a scenario begins, at this place of its text.
    fn step(&mut self, _place: usize) {}

    /// A conversation begins, at this time of the one before.
    fn begin(&mut self, now: Instant);

    /// All that had come up to this time was read.
    fn quiet(&mut self, _until: Instant) {}

    /// Why nothing more is worth noting; `None` while something is.
    fn ended(&self) -> Option<&Trouble> {
        None
    }
}

/// A link to drives, observed.
pub struct Observed<'l, N> {
    link: &'l mut dyn Link,
    /// By how much a wait has ended late, at most.
    late: Span,
    /// When the last wait began: all that had come by then can be received.
    looked: Instant,
    /// Whether the link makes no queries of its own.
    unpaused: bool,
    /// What the bus has noted.
    pub noted: N,
}

/// The way to the drives and back, as it was in an attempt.
#[derive(Clone, Copy, Debug)]
pub struct LinkTimes {
    /// By how much a wait has ended late, at most.
    pub late: Span,
    /// The longest time that a reply took.
    pub longest: Span,
    /// How exact times are; zero where time is virtual.
    pub tolerance: Span,
}

/// The count by which a session's watchdog sees that the program works; none on a record and on simulated drives.
#[derive(Clone, Debug, Default)]
pub struct Beats(Option<Arc<AtomicU64>>);

impl Beats {
    /// Those of ports.
    pub const fn of(count: Arc<AtomicU64>) -> Self {
        Self(Some(count))
    }

    /// The program works.
    pub fn beat(&self) {
        if let Some(count) = &self.0 {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// How much was received, and a checksum of it (FNV-1a).
#[derive(Clone, Copy, Debug)]
pub struct ReceivedSum {
    /// How many frames or octets.
    pub pieces: usize,
    /// Their checksum.
    pub sum: u32,
}

impl Default for ReceivedSum {
    fn default() -> Self {
        Self {
            pieces: 0,
            sum: 0x811C_9DC5,
        }
    }
}

impl ReceivedSum {
    /// Adds a part of a piece to the checksum.
    pub const fn add(&mut self, bits: u32) {
        self.sum = (self.sum ^ bits).wrapping_mul(0x0100_0193);
    }
}

impl<'l, N: LinkNotes> Observed<'l, N> {
    /// Observes a link.
    pub fn new(link: &'l mut dyn Link) -> Self {
        Self {
            link,
            late: Span::ZERO,
            looked: Instant::START,
            unpaused: false,
            noted: N::default(),
        }
    }

    /// Keeps the link from queries of its own: they would change what drives do.
    pub const fn without_pauses(&mut self) {
        self.unpaused = true;
    }

    /// By how much a wait has ended late since the last call, at most.
    pub fn take_late(&mut self) -> Span {
        std::mem::take(&mut self.late)
    }
}

impl<N: LinkNotes> Line for Observed<'_, N> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let end = self.link.send(port, what);
        self.noted.sent(what, end);
        end
    }

    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        self.link.permits(port, what)
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        self.link.denied(port, what)
    }

    fn refused(&self) -> usize {
        self.link.refused()
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        let Some((at, heard)) = self.link.receive(port) else {
            self.noted.quiet(self.looked);
            return None;
        };
        let (medium, now) = (self.link.medium(port), self.link.now());
        self.noted.heard(medium, at, now, heard);
        Some((at, heard))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.looked = self.link.now();
        let more = self.link.wait(until);
        self.late = self.late.max(self.link.now().since(until));
        more
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.noted.ended().or_else(|| self.link.trouble())
    }

    fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due().filter(|_| !self.unpaused)
    }

    fn pause(&mut self) {
        if !self.unpaused {
            self.link.pause();
        }
    }

    fn lead(&self) -> Lead {
        self.link.lead()
    }
}

impl<N: LinkNotes> Link for Observed<'_, N> {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }

    fn begin(&mut self) {
        let now = self.link.now();
        self.link.begin();
        self.looked = Instant::START;
        self.noted.begin(now);
    }

    fn step(&mut self, place: usize) {
        self.noted.step(place);
        self.link.step(place);
    }

    fn busy(&self) -> bool {
        self.link.busy()
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(port, fault, moment);
    }

    fn reaches(&self, port: usize, link: usize) -> bool {
        self.link.reaches(port, link)
    }

    fn damages_parity(&self, port: usize, link: usize) -> bool {
        self.link.damages_parity(port, link)
    }

    fn listens(&self, port: usize, link: usize) -> bool {
        self.link.listens(port, link)
    }

    fn tapped(&mut self, port: usize, link: usize) -> Option<Vec<Received>> {
        self.link.tapped(port, link)
    }

    fn time_tolerance(&self) -> Span {
        self.link.time_tolerance()
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.link.beside()
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn record(&mut self, on: bool) {
        self.link.record(on);
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, port: usize) -> u8 {
        self.link.drives(port)
    }

    fn trace(&self, port: usize) -> Trace {
        self.link.trace(port)
    }
}
