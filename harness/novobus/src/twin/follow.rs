//! The twin and its input.

use super::compare::Comparer;
use super::comparison::{Comparison, Exactness};
use super::known::Knowledge;
use super::silence::SeenRing;
use super::unasked::EARLIEST_TIME_OUT;
use crate::link::BesideTheBus;
use crate::link::SimulatedLink;
use harness_bench::link::{Line, Link, LinkEvent, Moment, Octets, PlacedFault};
use harness_bench::qualify::worlds::{WorldsVerdict, judge_kinds};
use harness_proto::line::Received;
use harness_proto::nd21::bits::{flags2, scope_status, status as status_bits};
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

/// How long a twin in real time listens after its conversation: bytes of the ring may arrive a moment before those of its twin.
const SLACK: Span = Span::from_millis(1);

/// The largest ring in which drives are tried one by one.
const SMALL: usize = 16;

/// Which silences drives may have heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Silences {
    /// Those that the bench has noted.
    Noted,
    /// Longer ones as well, where they explain a difference.
    Longer,
}

/// An act of the bench on a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Done {
    /// It sent a byte, with its start bit due at this time.
    Sent(Instant, u8),
    /// It reached the step at this place of the scenario's text.
    Step(usize),
    /// It injected a fault, at this time or at the given moment.
    Fault(Instant, PlacedFault, Moment),
}

/// One conversation as the master's end of the rings saw it. Times are the conversation's own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Conversation {
    /// The acts of the bench, each with its ring, in order.
    pub done: Vec<(usize, Done)>,
    /// The bytes received: ring, time and byte.
    pub received: Vec<(usize, Instant, Received)>,
    /// When the next conversation began, or this one was over.
    pub end: Instant,
    /// Intervals in which the bench did not look at its ports: a byte read at the end of one came at any time in it.
    pub unwatched: Vec<(Instant, Instant)>,
}

impl Conversation {
    /// The conversations of a record; `byte_time` is that of its line. What SYNCO and answers of a probe were is part of
    /// the conversation, but a simulated link probes a copy of itself (`probes_a_copy`).
    #[must_use]
    pub(crate) fn all(events: &[LinkEvent], byte_time: Span, probes_a_copy: bool) -> Vec<Self> {
        let mut all = Vec::new();
        let mut open = Self::default();
        for event in events {
            match event {
                LinkEvent::Begin(at) => {
                    let end = open.end.max(*at);
                    all.push(Self {
                        end,
                        ..std::mem::take(&mut open)
                    });
                }
                LinkEvent::Step(place) => open.done.push((0, Done::Step(*place))),
                LinkEvent::Sent(ring, end, sent) => {
                    let bytes = sent.as_out().octets();
                    let mut start = *end - byte_time * bytes.len() as u64;
                    for byte in bytes {
                        open.done.push((*ring, Done::Sent(start, *byte)));
                        start += byte_time;
                    }
                    open.end = open.end.max(*end);
                }
                LinkEvent::Received(ring, at, heard) => {
                    open.received
                        .extend(heard.octet().map(|byte| (*ring, *at, byte)));
                    open.end = open.end.max(*at);
                }
                LinkEvent::Fault(ring, at, fault, moment) => {
                    open.done.push((*ring, Done::Fault(*at, *fault, *moment)));
                }
                LinkEvent::Probe(ring, at, sent, came) if !probes_a_copy => {
                    let mut start = *at;
                    for byte in sent {
                        open.done.push((*ring, Done::Sent(start, *byte)));
                        start += byte_time;
                    }
                    // Their times are lost: each as soon as it can have come.
                    let received = came.iter().map(|byte| (*ring, start, *byte));
                    open.received.extend(received);
                }
                LinkEvent::Look(look) => {
                    open.end = open.end.max(look.at);
                    let unwatched = look.since.map(|since| (since, look.at));
                    open.unwatched.extend(unwatched);
                }
                LinkEvent::Probe(..) | LinkEvent::Tapped(..) | LinkEvent::Trouble(_) => {}
            }
        }
        all.push(open);
        all
    }

    /// The bytes sent into a ring, each with whether it went round undamaged.
    pub(crate) fn sent_in(&self, ring: usize) -> Vec<(u8, bool)> {
        let mut damaged = BTreeSet::new();
        let mut sent = Vec::new();
        let here = self.done.iter().filter(|(at, _)| *at == ring);
        for (_, done) in here {
            let next = sent.len() as u64 + 1;
            match done {
                Done::Sent(_, byte) => sent.push(*byte),
                Done::Fault(_, PlacedFault::Link(..), Moment::Byte(byte)) => {
                    damaged.insert(*byte);
                }
                Done::Fault(..) => {
                    damaged.insert(next);
                }
                Done::Step(_) => {}
            }
        }
        let numbered = (1..).zip(sent);
        numbered
            .map(|(number, byte)| (byte, !damaged.contains(&number)))
            .collect()
    }

    /// When each byte sent into a ring began.
    pub(crate) fn sent_at(&self, ring: usize) -> Vec<Instant> {
        let here = self.done.iter().filter(|(at, _)| *at == ring);
        let starts = here.filter_map(|(_, done)| match done {
            Done::Sent(at, _) => Some(*at),
            _ => None,
        });
        starts.collect()
    }

    /// The step that was running when the `index`-th byte, counted from 0, was sent into a ring.
    pub(crate) fn step_at(&self, ring: usize, index: usize) -> Option<usize> {
        let mut step = None;
        let mut sent = 0;
        for (at, done) in &self.done {
            match done {
                Done::Step(place) if sent <= index => step = Some(*place),
                Done::Sent(..) if *at == ring => sent += 1,
                _ => {}
            }
        }
        step
    }

    /// Whether it is the scenario's own, and not one before or after it.
    #[must_use]
    pub(crate) fn has_steps(&self) -> bool {
        let step = |(_, done): &(usize, Done)| matches!(done, Done::Step(_));
        self.done.iter().any(step)
    }

    pub(crate) fn sends(&self) -> bool {
        let sent = |(_, done): &(usize, Done)| matches!(done, Done::Sent(..));
        self.done.iter().any(sent)
    }

    pub(crate) fn received_in(&self, ring: usize) -> Vec<(Instant, Received)> {
        let here = self.received.iter().filter(|(at, ..)| *at == ring);
        here.map(|(_, at, byte)| (*at, *byte)).collect()
    }
}

/// What a twin received from a ring in a conversation.
#[derive(Clone, Debug, Default)]
pub(crate) struct TwinBytes {
    /// The bytes, each with its time.
    pub(crate) bytes: Vec<(Instant, Received)>,
    /// The place of the first one that a drive sent unasked (ND21 9.9).
    pub(crate) unasked: Option<usize>,
}

impl TwinBytes {
    /// Reads the bytes received from a ring of the link.
    fn fetch(&mut self, link: &mut SimulatedLink, ring: usize) {
        while let Some((at, byte, asked)) = link.receive_with_cause(ring) {
            if !asked {
                self.unasked.get_or_insert(self.bytes.len());
            }
            self.bytes.push((at, byte));
        }
    }
}

/// A simulated ring that gets the same bytes as a real one.
#[derive(Clone, Debug)]
pub(crate) struct Twin {
    link: SimulatedLink,
    sizes: Vec<RingSize>,
    knowledge: Knowledge,
}

impl Twin {
    /// A twin with these rings, freshly switched on.
    #[must_use]
    pub(crate) fn new(link: SimulatedLink, sizes: &[RingSize]) -> Self {
        Self {
            link,
            sizes: sizes.to_vec(),
            knowledge: Knowledge::default(),
        }
    }

    /// The simulated ring of a twin to which nothing has been sent.
    #[must_use]
    pub(crate) fn into_link(self) -> SimulatedLink {
        self.link
    }

    /// Plays a conversation and compares the bytes received with those of the twin.
    pub(crate) fn follow(
        &mut self,
        conversation: &Conversation,
        exactness: Exactness,
    ) -> Comparison {
        self.follow_rings(conversation, exactness, &BTreeSet::new(), Silences::Longer)
    }

    /// As [`Self::follow`], without comparing some rings. Where silences may be longer than the bench has noted, those are tried that explain a
    /// difference.
    fn follow_rings(
        &mut self,
        conversation: &Conversation,
        exactness: Exactness,
        left_out: &BTreeSet<usize>,
        silences: Silences,
    ) -> Comparison {
        let longer = silences == Silences::Longer && exactness.tolerance > Span::ZERO;
        let before = longer.then(|| self.clone());
        let mut comparison = self.compare(conversation, exactness, left_out);
        if let (Some(before), Some(found)) = (before, &comparison.divergence) {
            let races = comparison.unasked.iter();
            let races = races.filter(|race| race.ring == found.ring);
            let ring = SeenRing {
                ring: found.ring,
                size: self.sizes[found.ring],
                byte_time: self.link.byte_time(),
                earliest: self.link.earliest_time_out().min(EARLIEST_TIME_OUT),
                after_a_race: races.clone().rev().find_map(|race| race.until),
                race: races
                    .clone()
                    .find(|race| race.until.is_none())
                    .map(|race| race.at),
            };
            let (heard, more) = ring.held_back(conversation, found);
            let twins = before.with_monitors(found.ring, comparison.monitored);
            let worlds =
                twins.flat_map(|twin| heard.iter().map(move |heard| (twin.clone(), heard)));
            let verdict = judge_kinds(worlds, |(mut twin, heard)| {
                twin.rest(found.ring, heard.rest);
                let again = twin.compare(&heard.conversation, exactness, left_out);
                match again.divergence.is_none() && ring.is_in_error(conversation, &again) {
                    true => WorldsVerdict::Right,
                    false => WorldsVerdict::Wrong(found.byte, found.expected),
                }
            });
            let explained = verdict == WorldsVerdict::Right;
            comparison.too_many = more && !explained;
            comparison.silenced = more || explained;
        }
        comparison
    }

    /// This twin with drives of a ring that monitor time-outs (ND21 14.10.2): those of the model, if one has `monitored`; all of which it is not
    /// known; and each one of these.
    fn with_monitors(&self, ring: usize, monitored: bool) -> impl Iterator<Item = Self> {
        let drives = 0..self.sizes[ring].drives();
        let is_unknown = |drive: &u8| self.knowledge.monitors(ring, *drive).is_none();
        let unknown: Vec<_> = drives.filter(is_unknown).collect();
        let alone = (2..=SMALL).contains(&unknown.len());
        let alone = unknown.iter().filter(|_| alone).map(|drive| vec![*drive]);
        let alone: Vec<_> = alone.collect();
        let known = monitored.then(Vec::new);
        let all = (!unknown.is_empty()).then_some(unknown);
        let drives = known.into_iter().chain(all).chain(alone);
        drives.map(move |drives| {
            let mut twin = self.clone();
            let monitor = |drive: &u8| twin.link.monitor(ring, *drive);
            drives.iter().for_each(monitor);
            twin
        })
    }

    /// Lets a silence pass. Drives monitor from the first byte on that they hear (ND21 9.9).
    fn rest(&mut self, ring: usize, silence: Span) {
        if silence == Span::ZERO {
            return;
        }
        let drives = 0..self.sizes[ring].drives();
        let mut drives = drives.filter_map(|drive| self.link.drive(ring, drive));
        if drives.all(|drive| drive.bus_end().due(|| true).is_none()) {
            self.link.begin();
            self.link.send_octets(ring, &[SYNCO]);
        }
        self.link.run_until(self.link.now() + silence);
    }

    /// Plays a conversation and compares the bytes received with those of the twin, but for those of some rings.
    fn compare(
        &mut self,
        conversation: &Conversation,
        exactness: Exactness,
        left_out: &BTreeSet<usize>,
    ) -> Comparison {
        let real_time = exactness.tolerance > Span::ZERO;
        let slack = if real_time { SLACK } else { Span::ZERO };
        let mut recording = self.recording();
        let (mut received, monitored) = self.answer(conversation, slack);
        if real_time {
            self.add_later(conversation, exactness.tolerance, &mut received);
        }
        recording.extend(self.recording());
        let fault = |(_, done): &(usize, Done)| matches!(done, Done::Fault(..));
        self.knowledge.converse(conversation.done.iter().any(fault));
        let mut comparer = Comparer {
            exactness,
            byte_time: self.link.byte_time(),
            knowledge: &mut self.knowledge,
            recording,
            unwatched: &conversation.unwatched,
            comparison: Comparison {
                monitored,
                left_out: !left_out.is_empty(),
                ..Comparison::default()
            },
        };
        let rings = self.sizes.iter().zip(&received).enumerate();
        for (ring, (size, expected)) in rings.filter(|(ring, _)| !left_out.contains(ring)) {
            comparer.ring(ring, *size, conversation, expected);
        }
        comparer.comparison
    }

    /// Drives whose oscilloscope is not stopped (ND21 14.10.6.5).
    fn recording(&self) -> BTreeSet<(usize, u8)> {
        self.drives(ram::SCOPE_STATUS, |status| {
            status & scope_status::STOPPED == 0
        })
    }

    /// Whether a drive monitors time-outs (ND21 14.10.2).
    pub(crate) fn monitors(&self) -> bool {
        let monitors = |flags: u8| flags & flags2::MONITORING != 0;
        !self.drives(ram::FLAGS2, monitors).is_empty()
    }

    /// The drives whose cell holds such a byte.
    fn drives(&self, address: u16, such: impl Fn(u8) -> bool) -> BTreeSet<(usize, u8)> {
        let rings = self.sizes.iter().enumerate();
        let drives = rings.flat_map(|(ring, size)| (0..size.drives()).map(move |k| (ring, k)));
        let holds =
            |(ring, drive): &(usize, u8)| such(self.link.peek(*ring, *drive, address).unwrap_or(0));
        drives.filter(holds).collect()
    }

    /// Plays conversations one after another. In real time no model knows the state of a ring after drives have sent unasked bytes (9.9),
    /// because these race with the master's bytes. Unless a check sequence has ended the race, the ring is not compared any more after
    /// that conversation, and the second value says that another twin is needed.
    pub(crate) fn follow_all(
        &mut self,
        conversations: &[Conversation],
        exactness: Exactness,
    ) -> (Vec<Comparison>, bool) {
        let mut comparisons: Vec<Comparison> = Vec::new();
        let mut left_out = BTreeSet::new();
        self.knowledge.begin();
        for conversation in conversations {
            if left_out.len() == self.sizes.len() {
                break;
            }
            let comparison =
                self.follow_rings(conversation, exactness, &left_out, Silences::Longer);
            left_out.extend(comparison.open_races());
            comparisons.push(comparison);
        }
        let diverged = comparisons.iter().any(|c| c.divergence.is_some());
        (comparisons, diverged || !left_out.is_empty())
    }

    /// As [`Self::follow_all`], up to the first conversation in which a byte differs.
    pub(crate) fn follow_while_alike(
        &mut self,
        conversations: &[Conversation],
        exactness: Exactness,
        silences: Silences,
    ) -> Vec<Comparison> {
        let (mut comparisons, whole) = (Vec::new(), BTreeSet::new());
        for conversation in conversations {
            let comparison = self.follow_rings(conversation, exactness, &whole, silences);
            let last = comparison.divergence.is_some() || comparison.open_races().next().is_some();
            comparisons.push(comparison);
            if last {
                break;
            }
        }
        comparisons
    }

    /// Plays a conversation and `slack` more, and returns what the twin received, ring by ring, and whether a drive has monitored
    /// time-outs meanwhile.
    fn answer(&mut self, conversation: &Conversation, slack: Span) -> (Vec<TwinBytes>, bool) {
        self.link.begin();
        let mut monitored = self.monitors();
        let byte_time = self.link.byte_time();
        let mut done = conversation.done.iter().peekable();
        while let Some((ring, done_here)) = done.next() {
            match done_here {
                Done::Sent(at, byte) => {
                    // Bytes without a gap go out together.
                    let mut bytes = vec![*byte];
                    let mut next = *at + byte_time;
                    while let Some((_, Done::Sent(_, byte))) = done.next_if(
                        |(to, done)| matches!(done, Done::Sent(at, _) if to == ring && *at == next),
                    ) {
                        bytes.push(*byte);
                        next += byte_time;
                    }
                    self.link.run_until(*at);
                    monitored = monitored || self.monitors();
                    self.link.send_octets(*ring, &bytes);
                }
                Done::Fault(at, fault, moment) => {
                    if *moment == Moment::Now {
                        self.link.run_until(*at);
                    }
                    // A byte that is due is on the wire before a fault that comes after it.
                    self.link.wait(self.link.now());
                    self.link.inject(*ring, *fault, *moment);
                }
                Done::Step(_) => {}
            }
        }
        self.link.run_until(conversation.end + slack);
        let mut received = vec![TwinBytes::default(); self.sizes.len()];
        for (ring, received) in received.iter_mut().enumerate() {
            received.fetch(&mut self.link, ring);
        }
        (received, monitored || self.monitors())
    }

    /// Adds what the twin would receive until `tolerance` after the end of a conversation, where more bytes came than it received itself:
    /// a drive may be that much earlier than the model. The twin itself stays where it is.
    fn add_later(&self, conversation: &Conversation, tolerance: Span, received: &mut [TwinBytes]) {
        let more = |(ring, twin): (usize, &TwinBytes)| {
            conversation.received_in(ring).len() > twin.bytes.len()
        };
        if !received.iter().enumerate().any(more) {
            return;
        }
        let mut later = self.link.clone();
        later.run_until(conversation.end + tolerance);
        for (ring, received) in received.iter_mut().enumerate() {
            received.fetch(&mut later, ring);
        }
    }

    /// Lets time pass without sending, until every drive has tested itself after its power-up (11.8).
    pub(crate) fn rest_through_self_tests(&mut self) {
        const STEP: Span = Span::from_millis(200);
        const LONGEST: Span = Span::from_millis(61_000);
        let end = self.link.now() + LONGEST;
        loop {
            let next = self.link.now() + STEP;
            self.link.run_until(next);
            if next >= end || !self.in_reset() {
                return;
            }
        }
    }

    /// Whether a drive is in its reset mode (11.8).
    fn in_reset(&self) -> bool {
        let resets = |status: u8| status & status_bits::RESET != 0;
        !self.drives(ram::STATUS, resets).is_empty()
    }
}
