//! A link that gives again what was recorded.
//!
//! The order of the record decides: a byte comes where it came before, after the same bytes sent. Time is that of the record. A caller
//! that does something else finds the link in trouble. From then on the record is not read any further: nothing comes, every wait lasts until
//! its end, and no pause is due, so that every loop of a caller ends, whatever the record holds.
//!
//! A record of a ring with ports holds every [`Look`], so that the caller sees the same at each call and must do the same. Records of
//! schema 1 have no looks: of these only the order is repeated, and a driver that depends on the time may send something else.

use super::port_end::{AHEAD, LONGEST_SILENCE};
use super::{
    Capability, Lead, Line, Link, LinkEvent, LinkFault, Look, Moment, PlacedFault, Trouble,
    is_wrong_parity,
};
use crate::counted::counted;
use crate::medium::{HeardPiece, Medium, Out, Pieces};
use harness_proto::can;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::collections::{BTreeMap, VecDeque};

/// The most waits in a row without an event and without time passing. A caller that fetches its input and looks where the record looks needs a few.
const IDLE_WAITS: u32 = 16;

#[derive(Clone, Debug)]
pub struct Replay {
    events: VecDeque<LinkEvent>,
    now: Instant,
    medium: Medium,
    tolerance: Span,
    drives: Vec<u8>,
    capabilities: Vec<Capability>,
    reaches: Vec<(usize, usize)>,
    /// Links on which no byte gets a wrong parity bit.
    keeps_parity: Vec<(usize, usize)>,
    /// Links on which bytes are seen.
    listens: Vec<(usize, usize)>,
    /// What was seen on them in this conversation.
    tapped: BTreeMap<(usize, usize), Vec<Received>>,
    trouble: Option<Trouble>,
    /// The first difference between the record and what the caller does.
    strayed: Option<String>,
    /// Waits since the last event that was taken, or since time has passed.
    idle: (u32, usize),
    /// The state as of the last look; `None` where the record has no looks.
    known: Option<ReplayState>,
}

/// What the caller knows of a link in real time.
#[derive(Clone, Debug)]
struct ReplayState {
    busy: bool,
    lead: Lead,
    pause: Option<Instant>,
    came: [VecDeque<(Instant, HeardPiece)>; 2],
    /// When each line is free.
    free: [Instant; 2],
    /// For how long faults of this conversation may hold bytes.
    held: Span,
    /// For how long a byte with a wrong parity bit may wait for a silent line.
    silence: Span,
}

impl Default for ReplayState {
    fn default() -> Self {
        Self {
            busy: false,
            lead: Lead::NONE,
            pause: None,
            came: Default::default(),
            free: [Instant::START; 2],
            held: Span::ZERO,
            silence: Span::ZERO,
        }
    }
}

impl Replay {
    /// Replays events recorded at ports of this medium with these numbers of stations, on a link with these capabilities.
    #[must_use]
    pub fn new(
        events: Vec<LinkEvent>,
        medium: impl Into<Medium>,
        tolerance: Span,
        drives: Vec<u8>,
        capabilities: Vec<Capability>,
    ) -> Self {
        let reached = events.iter().filter_map(|event| match event {
            LinkEvent::Fault(ring, _, PlacedFault::Link(link, _), _) => Some((*ring, *link)),
            _ => None,
        });
        let tapped = events.iter().filter_map(|event| match event {
            LinkEvent::Tapped(ring, link, ..) => Some((*ring, *link)),
            _ => None,
        });
        let listens = tapped.collect();
        let looks = events
            .iter()
            .any(|event| matches!(event, LinkEvent::Look(_)));
        Self {
            reaches: reached.collect(),
            keeps_parity: Vec::new(),
            listens,
            tapped: BTreeMap::new(),
            // Without looks it is not known which step came when.
            events: events
                .into_iter()
                .filter(|event| looks || !matches!(event, LinkEvent::Step(_)))
                .collect(),
            now: Instant::START,
            medium: medium.into(),
            tolerance,
            drives,
            capabilities,
            trouble: None,
            strayed: None,
            idle: (0, 0),
            known: looks.then(ReplayState::default),
        }
    }

    /// Lets faults be asked for on more links than the record has faults on.
    #[must_use]
    pub fn reaching(mut self, links: impl IntoIterator<Item = (usize, usize)>) -> Self {
        self.reaches.extend(links);
        self
    }

    /// Lets no byte get a wrong parity bit on these links.
    #[must_use]
    pub fn keeping_parity(mut self, links: impl IntoIterator<Item = (usize, usize)>) -> Self {
        self.keeps_parity.extend(links);
        self
    }

    /// Allows looking at bytes on more links than the record shows.
    #[must_use]
    pub fn listening(mut self, links: impl IntoIterator<Item = (usize, usize)>) -> Self {
        self.listens.extend(links);
        self
    }

    /// Whether the record holds all that the caller saw, so that it must do the same again.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.known.is_some()
    }

    /// The first thing that was recorded and not played back, or what differed after trouble of the record; `None` where all was played
    /// back. Without looks, bytes that were not fetched do not count. After trouble the caller asks for nothing.
    #[must_use]
    pub fn left(&self) -> Option<String> {
        let exact = self.known.is_some();
        let words = |event: &LinkEvent| match event {
            LinkEvent::Trouble(_) => None,
            LinkEvent::Received(..) | LinkEvent::Step(_) | LinkEvent::Look(_) if !exact => None,
            LinkEvent::Received(_, at, byte) => {
                Some(format!("{} received at {at}", words_of(*byte)))
            }
            LinkEvent::Step(place) => Some(format!("a step at byte {place} of the scenario")),
            LinkEvent::Look(look) => Some(format!("a look at {}", look.at)),
            LinkEvent::Begin(_) => Some("another conversation".to_owned()),
            LinkEvent::Sent(_, at, sent) => {
                Some(format!("sending {} until {at}", pieces_of(sent.as_out())))
            }
            LinkEvent::Fault(_, at, ..) => Some(format!("a fault at {at}")),
            LinkEvent::Tapped(_, link, at, _) => Some(format!("a look at link {link} at {at}")),
            LinkEvent::Probe(_, at, sent, _) => Some(format!(
                "a probe with {} from {at} on",
                pieces_of(Out::Octets(sent))
            )),
        };
        let strayed = self
            .strayed
            .as_ref()
            .filter(|why| !matches!(&self.trouble, Some(Trouble::Garbled(text)) if text == *why));
        match (&self.trouble, strayed) {
            (Some(_), _) if !exact => None,
            (_, Some(why)) => Some(why.clone()),
            _ => self.events.iter().find_map(words),
        }
    }

    fn differs(&mut self, what: &str) {
        self.fails(format!(
            "the record holds something else than {what}: the scenario was changed"
        ));
    }

    fn fails(&mut self, text: String) {
        self.strayed.get_or_insert_with(|| text.clone());
        self.trouble.get_or_insert(Trouble::Garbled(text));
    }

    /// Whether this wait is one of too many that have taken no event and no time.
    fn idles(&mut self) -> bool {
        let left = self.events.len();
        let (count, before) = self.idle;
        let count = if before == left { count + 1 } else { 0 };
        self.idle = (count, left);
        count > IDLE_WAITS
    }

    /// Lets time pass where nothing more comes.
    fn pass(&mut self, until: Instant) -> bool {
        self.now = self.now.max(until);
        false
    }

    /// Whether the second event is a denial.
    fn denied_behind(&self) -> bool {
        let behind = self.events.get(1);
        matches!(behind, Some(LinkEvent::Trouble(Trouble::Denied(_))))
    }

    fn trouble_comes(&mut self) {
        if let Some(LinkEvent::Trouble(trouble)) = self.events.front() {
            self.trouble.get_or_insert(trouble.clone());
            self.events.pop_front();
        }
    }

    /// The time of the next look; `None` where there is none.
    fn next_look(&self) -> Option<Instant> {
        self.events.iter().find_map(|event| match event {
            LinkEvent::Look(look) => Some(look.at),
            _ => None,
        })
    }

    /// Takes the next look with the input that it reports; `until` is when a wait was to end.
    fn look(&mut self, until: Option<Instant>) {
        if self.strayed.is_some() {
            return;
        }
        let Some(known) = &mut self.known else {
            return;
        };
        let Some(LinkEvent::Look(look)) = self.events.front() else {
            return self.differs("a look at the ports");
        };
        let Look {
            at,
            busy,
            lead,
            pause,
            since: _,
        } = *look;
        self.events.pop_front();
        let before = (self.now, known.busy);
        self.now = at.max(before.0);
        known.busy = busy;
        known.lead = lead.unwrap_or(known.lead);
        known.pause = pause;
        let held = known.held;
        let mut came = 0;
        let mut wrong = (at < before.0).then(|| format!("{at} stands behind {}", before.0));
        while let Some(LinkEvent::Received(ring, arrived, byte)) = self.events.front() {
            let (ring, arrived, byte) = (*ring, *arrived, *byte);
            // An adapter stamps a frame before the bench has read it.
            let earliest = match self.medium {
                Medium::Octets(_) => before.0,
                Medium::Frames(_) => Instant::START,
            };
            let known_times = earliest..=at;
            if held == Span::ZERO && !known_times.contains(&arrived) {
                wrong.get_or_insert(format!(
                    "{} came at {arrived}, between looks at {} and {at}",
                    words_of(byte),
                    before.0
                ));
            }
            self.events.pop_front();
            came += 1;
            known.came[ring.min(1)].push_back((arrived, byte));
        }
        let trouble = matches!(self.events.front(), Some(LinkEvent::Trouble(_)));
        let stopped = self.trouble.as_ref().is_some_and(Trouble::stops_the_line);
        let news = came > 0 || trouble || stopped || busy != before.1;
        if let Some(until) = until.filter(|until| at < *until && !news) {
            wrong.get_or_insert(format!("nothing ends the wait until {until} at {at}"));
        }
        self.trouble_comes();
        if let Some(wrong) = wrong {
            self.fails(format!("the times of the record cannot be: {wrong}"));
        }
    }

    /// Whether pieces that were sent now can have left at `end`.
    fn can_leave(&mut self, port: usize, what: Out<'_>, end: Instant) {
        // A record without looks is not searched for one.
        let next = self.known.as_ref().and_then(|_| self.next_look());
        let took = self.medium.time_of(what);
        let now = self.now;
        // A frame waits for those of other stations, so that only a line of the bench's own says when it has left at the latest.
        let shared = matches!(self.medium, Medium::Frames(_));
        let Some(known) = &mut self.known else {
            return;
        };
        let free = std::mem::replace(&mut known.free[port.min(1)], end);
        let earliest = free.max(now) + took;
        // Bytes of the conversation before may still occupy the line.
        let free = match free {
            Instant::START => Instant::START + AHEAD,
            free => free,
        };
        let latest = next.map(|next| free.max(next) + took + known.held + known.silence);
        if end < earliest || latest.is_some_and(|latest| !shared && end > latest) {
            let pieces = pieces_of(what);
            self.fails(format!(
                "the times of the record cannot be: {pieces} sent at {now} have not left at {end}"
            ));
        }
    }
}

impl Line for Replay {
    fn medium(&self, _port: usize) -> Medium {
        self.medium
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        if self.trouble.is_some() || self.strayed.is_some() || what.is_empty() {
            return self.now;
        }
        match self.events.front() {
            // What was denied was not sent.
            Some(LinkEvent::Sent(at_port, end, sent))
                if *at_port == port
                    && (sent.as_out() == what
                        || begins_with(what, sent) && self.denied_behind()) =>
            {
                let (end, count) = (*end, sent.as_out().len());
                self.events.pop_front();
                self.can_leave(port, what.first(count), end);
                if let Some(known) = &mut self.known {
                    known.busy = true;
                }
                self.trouble_comes();
                end
            }
            // With trouble nothing is carried, and what was sent all the same is not in the record.
            Some(LinkEvent::Trouble(_)) => {
                self.trouble_comes();
                self.now
            }
            _ => {
                self.differs("what is sent");
                self.now
            }
        }
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        if let Some(known) = &mut self.known {
            return known.came.get_mut(port)?.pop_front();
        }
        // In real time a wait until a time may have ended later, and what came meanwhile was fetched.
        let late = self.tolerance > Span::ZERO;
        if self.strayed.is_some() {
            return None;
        }
        match self.events.front() {
            Some(LinkEvent::Received(at_port, at, byte))
                if *at_port == port && (late || *at <= self.now) =>
            {
                let byte = (*at, *byte);
                self.events.pop_front();
                self.now = self.now.max(byte.0);
                Some(byte)
            }
            _ => None,
        }
    }

    fn wait(&mut self, until: Instant) -> bool {
        if self.known.is_some() && self.strayed.is_none() {
            self.look(Some(until));
        }
        if self.strayed.is_some() {
            return self.pass(until);
        }
        if self.known.is_some() {
            return !self.trouble.as_ref().is_some_and(Trouble::stops_the_line);
        }
        self.trouble_comes();
        if self.trouble.is_some() {
            return self.idles() && self.pass(until);
        }
        if until > self.now && self.idles() {
            self.differs("a wait");
            return self.pass(until);
        }
        // The next byte that comes, after those that have come and are not fetched; or the time of the next look at an inner link.
        let mut next = self.events.iter().map_while(|event| match event {
            LinkEvent::Received(_, at, _) => Some((*at, false)),
            LinkEvent::Tapped(_, _, at, _) => Some((*at, true)),
            _ => None,
        });
        let now = self.now;
        let next = next.find(|(at, is_look)| *is_look || *at > now);
        self.now = next.map_or(until, |(at, _)| at.min(until)).max(now);
        if self.now > now {
            self.idle = (0, self.events.len());
        }
        !self.events.is_empty()
    }

    fn trouble(&self) -> Option<&Trouble> {
        // Nothing was done on the link between the event before and the trouble, so it may show at once: the last step of a scenario
        // may let no time pass after it.
        let next = match self.events.front() {
            Some(LinkEvent::Trouble(trouble)) => Some(trouble),
            _ => None,
        };
        self.trouble.as_ref().or(next)
    }

    fn pause_due(&self) -> Option<Instant> {
        let known = self.known.as_ref().filter(|_| self.strayed.is_none());
        known.and_then(|known| known.pause)
    }

    fn pause(&mut self) {
        self.look(None);
    }

    fn lead(&self) -> Lead {
        let known = self.known.as_ref();
        known.map_or(Lead::NONE, |known| known.lead)
    }
}

impl Link for Replay {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        if self.strayed.is_some() {
            return;
        }
        while self.known.is_none() && matches!(self.events.front(), Some(LinkEvent::Received(..))) {
            self.events.pop_front();
        }
        self.tapped.clear();
        match self.events.pop_front() {
            Some(LinkEvent::Begin(at)) => {
                if self.known.is_some() && at < self.now {
                    self.fails(format!(
                        "the times of the record cannot be: a conversation begins at {at}, the one before lasted until {}",
                        self.now
                    ));
                }
                self.now = Instant::START;
                if let Some(known) = &mut self.known {
                    let lead = known.lead;
                    *known = ReplayState {
                        lead,
                        ..ReplayState::default()
                    };
                    self.look(None);
                }
                self.trouble_comes();
            }
            Some(other) => {
                self.events.push_front(other);
                self.differs("the beginning of a conversation");
            }
            None => self.differs("the beginning of a conversation"),
        }
    }

    fn step(&mut self, place: usize) {
        if self.known.is_none() || self.strayed.is_some() {
            return;
        }
        match self.events.front() {
            Some(LinkEvent::Step(marked)) if *marked == place => {
                self.events.pop_front();
            }
            _ => self.differs("the steps of the scenario"),
        }
    }

    fn busy(&self) -> bool {
        if self.strayed.is_some() {
            return false;
        }
        let byte = || matches!(self.events.front(), Some(LinkEvent::Received(..)));
        let known = self.known.as_ref();
        known.map_or_else(byte, |known| known.busy)
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        if self.strayed.is_some() {
            return;
        }
        match self.events.front() {
            Some(LinkEvent::Fault(at_port, at, what, then))
                if (*at_port, *what, *then) == (port, fault, moment)
                    && (self.known.is_none() || *at == self.now) =>
            {
                self.events.pop_front();
                if let (Some(known), PlacedFault::Link(_, what)) = (&mut self.known, fault) {
                    known.held = known.held + held_by(what, self.medium.octet_time());
                    if is_wrong_parity(what) {
                        known.silence = LONGEST_SILENCE.min(self.tolerance);
                    }
                }
                self.trouble_comes();
            }
            Some(LinkEvent::Trouble(_)) => self.trouble_comes(),
            _ => self.differs("the fault that is asked for"),
        }
    }

    fn reaches(&self, port: usize, link: usize) -> bool {
        self.reaches.contains(&(port, link))
    }

    fn damages_parity(&self, port: usize, link: usize) -> bool {
        !self.keeps_parity.contains(&(port, link))
    }

    fn listens(&self, port: usize, link: usize) -> bool {
        self.listens.contains(&(port, link))
    }

    fn tapped(&mut self, port: usize, link: usize) -> Option<Vec<Received>> {
        if self.strayed.is_some() {
            return None;
        }
        match self.events.pop_front() {
            Some(LinkEvent::Tapped(at_port, place, _, bytes))
                if (at_port, place) == (port, link) =>
            {
                let all = self.tapped.entry((port, link)).or_default();
                all.extend(bytes);
                Some(all.clone())
            }
            other => {
                if let Some(other) = other {
                    self.events.push_front(other);
                }
                self.differs("a look at an inner link");
                None
            }
        }
    }

    fn time_tolerance(&self) -> Span {
        self.tolerance
    }

    fn probe(&mut self, port: usize, octets: &[u8]) -> Vec<Received> {
        if self.strayed.is_some() {
            return Vec::new();
        }
        match self.events.pop_front() {
            Some(LinkEvent::Probe(at_port, at, sent, came))
                if at_port == port
                    && sent == octets
                    && (self.known.is_none() || at == self.now) =>
            {
                self.now = self.now.max(at);
                self.look(None);
                came
            }
            other => {
                if let Some(other) = other {
                    self.events.push_front(other);
                }
                self.differs("the bytes of a probe");
                Vec::new()
            }
        }
    }

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn carried(&self) -> u64 {
        0
    }

    fn drives(&self, port: usize) -> u8 {
        self.drives.get(port).copied().unwrap_or(0)
    }

    fn trace(&self, port: usize) -> Trace {
        Trace::empty(self.drives(port))
    }
}

/// Whether what was recorded is the beginning of this.
fn begins_with(what: Out<'_>, sent: &Pieces) -> bool {
    let sent = sent.as_out();
    what.first(sent.len()) == sent
}

/// A number of pieces, in words.
fn pieces_of(what: Out<'_>) -> String {
    match what {
        Out::Octets(octets) => counted(octets.len(), "byte"),
        Out::Frames(frames) => counted(frames.len(), "frame"),
    }
}

/// What was heard, in words.
fn words_of(heard: HeardPiece) -> String {
    match heard {
        HeardPiece::Octet(octet) => format!("{:02X}", octet.byte),
        HeardPiece::Frame(can::CanEvent::Frame(frame)) => frame.to_string(),
        HeardPiece::Frame(can::CanEvent::Error(error)) => error.to_string(),
    }
}

/// How long a fault may hold the bytes of a line.
fn held_by(fault: LinkFault, byte_time: Span) -> Span {
    match fault {
        LinkFault::Delay(span) | LinkFault::Break(span) => span + byte_time,
        // One byte more goes out.
        LinkFault::Duplicate | LinkFault::Insert(_) => byte_time,
        _ => Span::ZERO,
    }
}

#[cfg(test)]
#[path = "replay_tests.rs"]
mod tests;
