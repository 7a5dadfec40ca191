//! A link that remembers everything that happens at the master's end of its rings.
//!
//! What a recorded link shows is what a rig shows: bytes and times. Cells, the error mode and what stands outside the
//! bus are hidden, so that a record suffices to judge a conversation again.

use super::{Capability, Lead, Line, Link, Moment, PlacedFault, Shown, Stimulus, Trouble};
use harness_proto::line::Received;
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};
use harness_sim::trace::Trace;

/// Something that happened. Times are those of the conversation, but that of [`Event::Begin`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A conversation began, at this time of the one before.
    Begin(Instant),
    /// A step of the scenario began, that at this place of its text.
    Step(usize),
    /// Bytes were sent into a ring, counted from 0; the last one will have left at this time.
    Sent(usize, Instant, Vec<u8>),
    /// A byte was received from a ring.
    Received(usize, Instant, Received),
    /// A fault was asked for, at this time.
    Fault(usize, Instant, PlacedFault, Moment),
    /// The link carries nothing more.
    Trouble(Trouble),
    /// So many SYNCO were sent into a ring from this time on to let it spell out its address, and these bytes came.
    Probe(usize, Instant, usize, Vec<Received>),
}

/// Takes events as they happen.
pub trait Sink: Send {
    /// Takes one.
    fn take(&mut self, event: &Event);
}

impl Sink for Vec<Event> {
    fn take(&mut self, event: &Event) {
        self.push(event.clone());
    }
}

/// A link that is recorded.
pub struct Recording<'l, L: ?Sized> {
    link: &'l mut L,
    sink: &'l mut dyn Sink,
    capabilities: Vec<Capability>,
    told: bool,
    /// Whether what no rig shows is shown too.
    whole: bool,
    /// Whether a step of a scenario belongs to the present conversation.
    stepped: bool,
    /// What the links carried in the conversation of the scenario, ring by ring; empty while it lasts.
    scenario: Vec<Trace>,
}

impl<'l, L: Link + ?Sized> Recording<'l, L> {
    /// Records a link from now on.
    pub fn new(link: &'l mut L, sink: &'l mut dyn Sink) -> Self {
        let seen_beside_the_bus = [Capability::Tap, Capability::Simulator, Capability::Power];
        let own = link.capabilities().iter().copied();
        let capabilities = own
            .filter(|own| !seen_beside_the_bus.contains(own))
            .collect();
        Self {
            link,
            sink,
            capabilities,
            told: false,
            whole: false,
            stepped: false,
            scenario: Vec::new(),
        }
    }

    /// Records a link from now on and hides nothing of it: for simulated rings, which verify plays again instead of reading
    /// them from the record.
    pub fn whole(link: &'l mut L, sink: &'l mut dyn Sink) -> Self {
        let capabilities = link.capabilities().to_vec();
        Self {
            capabilities,
            whole: true,
            ..Self::new(link, sink)
        }
    }

    /// Tells of trouble once, where it shows.
    fn tell(&mut self) {
        if let Some(trouble) = self.link.trouble().filter(|_| !self.told) {
            self.told = true;
            self.sink.take(&Event::Trouble(trouble.clone()));
        }
    }
}

impl<L: Link + ?Sized> Line for Recording<'_, L> {
    fn byte_time(&self) -> Span {
        self.link.byte_time()
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, bytes: &[u8]) -> Instant {
        let end = self.link.send(ring, bytes);
        let taken = bytes.len().saturating_sub(self.link.refused());
        if taken > 0 {
            self.sink
                .take(&Event::Sent(ring, end, bytes[..taken].to_vec()));
        }
        self.tell();
        end
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, Received)> {
        let (at, byte) = self.link.receive(ring)?;
        self.sink.take(&Event::Received(ring, at, byte));
        Some((at, byte))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let more = self.link.wait(until);
        self.tell();
        more
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        self.link.attend(ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.link.trouble()
    }

    fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due()
    }

    fn pause(&mut self) {
        self.link.pause();
        self.tell();
    }

    fn lead(&self) -> Lead {
        self.link.lead()
    }
}

impl<L: Link + ?Sized> Link for Recording<'_, L> {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.sink.take(&Event::Begin(self.link.now()));
        if std::mem::take(&mut self.stepped) {
            let rings = (0..2).filter(|ring| self.link.drives(*ring) > 0);
            self.scenario = rings.map(|ring| self.link.trace(ring)).collect();
        }
        self.link.begin();
    }

    fn step(&mut self, place: usize) {
        self.stepped = true;
        self.scenario.clear();
        self.sink.take(&Event::Step(place));
        self.link.step(place);
    }

    fn busy(&self) -> bool {
        self.link.busy()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        let at = self.link.now();
        self.sink.take(&Event::Fault(ring, at, fault, moment));
        self.link.inject(ring, fault, moment);
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        self.link.reaches(ring, link)
    }

    fn time_tolerance(&self) -> Span {
        self.link.time_tolerance()
    }

    fn probe(&mut self, ring: usize, count: usize) -> Vec<Received> {
        let at = self.link.now();
        let bytes = self.link.probe(ring, count);
        self.sink
            .take(&Event::Probe(ring, at, count, bytes.clone()));
        bytes
    }

    fn stimulate(&mut self, ring: usize, drive: u8, stimulus: Stimulus) {
        self.inject(ring, PlacedFault::Stimulus(drive, stimulus), Moment::Now);
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.link.drives(ring)
    }

    /// That of the conversation of the scenario, if there has been one: cells are set back in another one.
    fn trace(&self, ring: usize) -> Trace {
        match self.scenario.get(ring) {
            Some(trace) => trace.clone(),
            None => self.link.trace(ring),
        }
    }

    fn error_of(&self, ring: usize, drive: u8) -> Option<Option<BusError>> {
        let shown = self.whole.then(|| self.link.error_of(ring, drive));
        shown.flatten()
    }

    fn shown(&self, ring: usize, drive: u8) -> Option<Shown> {
        let shown = self.whole.then(|| self.link.shown(ring, drive));
        shown.flatten()
    }

    fn peek(&self, ring: usize, drive: u8, address: u16) -> Option<u8> {
        let shown = self.whole.then(|| self.link.peek(ring, drive, address));
        shown.flatten()
    }
}
