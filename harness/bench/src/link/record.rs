//! A link that remembers everything that happens at the master's end of its rings.
//!
//! What a recorded link shows is what a rig shows: bytes and times. Cells, the error mode and what stands outside the
//! bus are hidden, so that a record suffices to judge a conversation again.
//!
//! Where time is real, a recorded link shows its state as of the last [`Look`], and each look is an event. The caller sees nothing that is
//! not in the record, so that [`Replay`](super::Replay) repeats the conversation exactly, decisions that depend on time included.

use super::pump::HELD_UP;
use super::{Capability, Lead, Line, Link, Moment, PlacedFault, Trouble};
use crate::medium::{HeardPiece, Medium, Out, Pieces};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::{BTreeMap, VecDeque};

/// The most ports of a line: the two rings of a bench (ND21 8.4).
const PORTS: usize = 2;

/// State of a link in real time, as the caller sees it until the next look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// The time of the look.
    pub at: Instant,
    /// Whether bytes were still on their way round.
    pub busy: bool,
    /// How far ahead of the line bytes may be handed over; `None` where that has not changed.
    pub lead: Option<Lead>,
    /// When the line wants a pause; `None` where it wants none.
    pub pause: Option<Instant>,
    /// The previous look, if it was long ago: what follows came between then and this look.
    pub since: Option<Instant>,
}

/// Something that happened. Times are those of the conversation, but that of [`LinkEvent::Begin`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LinkEvent {
    /// A conversation began, at this time of the one before.
    Begin(Instant),
    /// A step of the scenario began, that at this place of its text.
    Step(usize),
    /// Pieces were sent through a port, counted from 0; the last one will have left at this time.
    Sent(usize, Instant, Pieces),
    /// A piece was received at a port.
    Received(usize, Instant, HeardPiece),
    /// A fault was asked for, at this time.
    Fault(usize, Instant, PlacedFault, Moment),
    /// The link carries nothing more.
    Trouble(Trouble),
    /// The bench looked at its ports; only where time is real. Bytes that had come since the last look follow it.
    Look(Look),
    /// A probe through a port: its start time, the octets sent, and those received.
    Probe(usize, Instant, Vec<u8>, Vec<Received>),
    /// What had arrived at the end of a link of a ring by this time, and had not been asked for before in this conversation.
    Tapped(usize, usize, Instant, Vec<Received>),
}

/// Takes events as they happen.
pub trait Sink: Send {
    /// Takes one.
    fn take(&mut self, event: &LinkEvent);

    /// A wait begins, in which nothing need happen.
    fn waits(&mut self) {}
}

impl Sink for Vec<LinkEvent> {
    fn take(&mut self, event: &LinkEvent) {
        self.push(event.clone());
    }
}

/// A link that is recorded.
pub struct Recording<'l, L: ?Sized> {
    link: &'l mut L,
    sink: &'l mut dyn Sink,
    capabilities: Vec<Capability>,
    /// Whether what no rig shows is shown too.
    whole: bool,
    /// Whether a step of a scenario belongs to the present conversation.
    stepped: bool,
    /// How many bytes of a link are recorded in the present conversation, by ring and link.
    tapped: BTreeMap<(usize, usize), usize>,
    /// What the links carried in the conversation of the scenario, ring by ring; empty while it lasts.
    scenario: Vec<Trace>,
    /// Trouble that has been recorded.
    trouble: Option<Trouble>,
    /// What the caller knows; `None` where time is virtual, as nothing changes between two calls there.
    known: Option<CallerView>,
}

/// What the caller knows of a link in real time.
struct CallerView {
    now: Instant,
    busy: bool,
    lead: Lead,
    pause: Option<Instant>,
    /// Bytes that are recorded and not yet fetched.
    came: [VecDeque<(Instant, HeardPiece)>; PORTS],
}

impl CallerView {
    fn new() -> Self {
        Self {
            now: Instant::START,
            busy: false,
            lead: Lead::NONE,
            pause: None,
            came: Default::default(),
        }
    }
}

impl<'l, L: Link + ?Sized> Recording<'l, L> {
    /// Records a link from now on.
    pub fn new(link: &'l mut L, sink: &'l mut dyn Sink) -> Self {
        let seen_beside_the_bus = match link.capabilities().contains(&Capability::Simulator) {
            true => &[Capability::Tap, Capability::Simulator, Capability::Power][..],
            false => &[Capability::Power],
        };
        let all = link.capabilities().iter().copied();
        let capabilities = all
            .filter(|capability| !seen_beside_the_bus.contains(capability))
            .collect();
        let real = link.lead() != Lead::NONE;
        Self {
            link,
            sink,
            capabilities,
            whole: false,
            stepped: false,
            tapped: BTreeMap::new(),
            scenario: Vec::new(),
            trouble: None,
            known: real.then(CallerView::new),
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

    /// Whether the present trouble of the link is recorded.
    pub fn trouble_is_told(&mut self) {
        self.trouble = self.link.trouble().cloned();
    }

    /// Records trouble once, where it shows.
    fn tell(&mut self) {
        if self.trouble.is_none()
            && let Some(trouble) = self.link.trouble()
        {
            self.trouble = Some(trouble.clone());
            self.sink.take(&LinkEvent::Trouble(trouble.clone()));
        }
    }

    /// Fetches what the link has received.
    fn take_arrived(&mut self) -> Vec<(usize, Instant, HeardPiece)> {
        let mut came = Vec::new();
        for port in 0..PORTS {
            while let Some((at, byte)) = self.link.receive(port) {
                came.push((port, at, byte));
            }
        }
        came
    }

    /// Records the state of the link and what was received, where time is real.
    fn look(&mut self, came: Vec<(usize, Instant, HeardPiece)>) {
        let Some(known) = &mut self.known else {
            return;
        };
        known.now = self.link.now();
        known.busy = self.link.busy();
        known.pause = self.link.pause_due();
        let lead = self.link.lead();
        let since = self.link.unwatched_since();
        let look = Look {
            at: known.now,
            busy: known.busy,
            lead: (lead != known.lead).then_some(lead),
            pause: known.pause,
            since: since.filter(|since| known.now.since(*since) > HELD_UP && !came.is_empty()),
        };
        known.lead = lead;
        self.sink.take(&LinkEvent::Look(look));
        for (port, at, byte) in came {
            self.sink.take(&LinkEvent::Received(port, at, byte));
            known.came[port].push_back((at, byte));
        }
    }

    /// The same, including what was received by now.
    fn look_now(&mut self) {
        if self.known.is_some() {
            let came = self.take_arrived();
            self.look(came);
        }
        self.tell();
    }
}

impl<L: Link + ?Sized> Line for Recording<'_, L> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        let known = self.known.as_ref();
        known.map_or_else(|| self.link.now(), |known| known.now)
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        self.tell();
        if self.trouble.is_some() {
            return self.now();
        }
        let end = self.link.send(port, what);
        let taken = what.len().saturating_sub(self.link.refused());
        if taken > 0 {
            self.sink
                .take(&LinkEvent::Sent(port, end, what.first(taken).to_pieces()));
            if let Some(known) = &mut self.known {
                known.busy = true;
            }
        }
        self.tell();
        if taken > 0 { end } else { self.now() }
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        if let Some(known) = &mut self.known {
            return known.came.get_mut(port)?.pop_front();
        }
        let (at, byte) = self.link.receive(port)?;
        self.sink.take(&LinkEvent::Received(port, at, byte));
        self.tell();
        Some((at, byte))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.sink.waits();
        let Some(busy) = self.known.as_ref().map(|known| known.busy) else {
            let more = self.link.wait(until);
            self.tell();
            return more;
        };
        // A wake-up without anything new is not an event.
        let came = loop {
            let more = self.link.wait(until);
            let came = self.take_arrived();
            let trouble = self.link.trouble().is_some() && self.trouble.is_none();
            let changed = trouble || !more || self.link.busy() != busy;
            if changed || !came.is_empty() || self.link.now() >= until {
                break came;
            }
        };
        self.look(came);
        self.tell();
        !self.trouble.as_ref().is_some_and(Trouble::stops_the_line)
    }

    fn attend(&mut self, port: usize, at: Instant) {
        self.link.attend(port, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.trouble.as_ref()
    }

    fn pause_due(&self) -> Option<Instant> {
        let known = self.known.as_ref();
        known.map_or_else(|| self.link.pause_due(), |known| known.pause)
    }

    fn pause(&mut self) {
        self.link.pause();
        self.look_now();
    }

    fn lead(&self) -> Lead {
        let known = self.known.as_ref();
        known.map_or_else(|| self.link.lead(), |known| known.lead)
    }
}

impl<L: Link + ?Sized> Link for Recording<'_, L> {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.sink.take(&LinkEvent::Begin(self.link.now()));
        if std::mem::take(&mut self.stepped) {
            let ports = (0..PORTS).filter(|port| self.link.drives(*port) > 0);
            self.scenario = ports.map(|port| self.link.trace(port)).collect();
        }
        self.link.begin();
        self.tapped.clear();
        if let Some(known) = &mut self.known {
            known.came = Default::default();
        }
        self.look_now();
    }

    fn step(&mut self, place: usize) {
        self.stepped = true;
        self.scenario.clear();
        self.sink.take(&LinkEvent::Step(place));
        self.link.step(place);
    }

    fn busy(&self) -> bool {
        let known = self.known.as_ref();
        known.map_or_else(|| self.link.busy(), |known| known.busy)
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        let at = self.now();
        self.sink.take(&LinkEvent::Fault(port, at, fault, moment));
        self.link.inject(port, fault, moment);
        self.tell();
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
        let all = self.link.tapped(port, link)?;
        let at = self.now();
        let known = self.tapped.insert((port, link), all.len()).unwrap_or(0);
        let new = all.get(known..).unwrap_or_default().to_vec();
        self.sink.take(&LinkEvent::Tapped(port, link, at, new));
        Some(all)
    }

    fn time_tolerance(&self) -> Span {
        self.link.time_tolerance()
    }

    fn probe(&mut self, port: usize, octets: &[u8]) -> Vec<Received> {
        let at = self.now();
        let came = self.link.probe(port, octets);
        self.sink
            .take(&LinkEvent::Probe(port, at, octets.to_vec(), came.clone()));
        self.look_now();
        came
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.link.beside().filter(|_| self.whole)
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, port: usize) -> u8 {
        self.link.drives(port)
    }

    /// The trace of the conversation of the scenario, if there was one: cells are restored in a later one.
    fn trace(&self, port: usize) -> Trace {
        match self.scenario.get(port) {
            Some(trace) => trace.clone(),
            None => self.link.trace(port),
        }
    }
}
