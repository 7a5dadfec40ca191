//! A ring of plain drives for many cases that differ in a few faults of links. What they have in common is worked out once.
//!
//! A drive sees nothing but what the one before it sends, and a master that sends without looking at what comes back sees nothing
//! at all. So the bytes of a conversation can go through the ring place by place: each place takes all that it is sent, and the
//! next one gets all that it sends. [`SharedRing`] keeps what a place in a state makes of a stream of bytes, and the next case
//! that brings the same state the same stream takes it from there. States and streams are compared in full, with all their times.
//!
//! Links and nodes are those of a [`Ring`], so that nothing but the order of the work differs from
//! [`Ring::run_until`]; tests compare the two.

use crate::fault::LinkFault;
use crate::novobus::drive::Drive;
use crate::novobus::link::Link;
use crate::novobus::node::RingNode;
use crate::novobus::plain::PlainDrive;
use crate::novobus::ring::Ring;
use crate::novobus::under_way::UnderWay;
use harness_proto::line::{LineError, Received};
use harness_proto::time::{Instant, Span};
use std::collections::HashMap;
use std::hash::{BuildHasher, BuildHasherDefault, Hash, Hasher};

/// A place of the ring: the link to it and the drive there, or the master's receiver.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct RingPlace {
    inbound: Link,
    node: Option<RingNode<PlainDrive>>,
    /// When the drive's transmitter can start its next byte.
    line_free: Instant,
}

impl RingPlace {
    /// What becomes of the place, and what it sends on, up to and including `until`. `sent` is what the place before it sends; the
    /// master's receiver sends on what it hears.
    fn take(&mut self, sent: &LinkStream, until: Instant) -> LinkStream {
        let byte_time = self.inbound.byte_time();
        self.inbound.reserve(sent.bytes.len());
        let mut bytes = sent.bytes.iter();
        for run in &sent.runs {
            let mut start = run.start;
            for byte in bytes.by_ref().take(run.count) {
                self.inbound.transmit(start, *byte, run.solicited);
                start += byte_time;
            }
        }
        let Some(node) = &mut self.node else {
            return LinkStream::heard(self.inbound.take_until(until));
        };
        let mut outbound = Link::free_from(byte_time, self.line_free);
        outbound.reserve(sent.bytes.len() + 1);
        node.run(&mut self.inbound, &mut outbound, until);
        self.inbound.forget_arrived();
        self.line_free = outbound.line_free();
        LinkStream::sent(outbound.under_way(), byte_time)
    }
}

/// Bytes that were sent without a gap.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct ByteRun {
    start: Instant,
    count: usize,
    /// Whether they go back to bytes of the master's.
    solicited: bool,
}

/// What a place sends, or what the master hears.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct LinkStream {
    bytes: Vec<u8>,
    /// When they are sent; no part of what the master hears.
    runs: Vec<ByteRun>,
    /// Bytes that the master hears damaged, by their place.
    errors: Vec<(usize, LineError)>,
}

impl LinkStream {
    fn sent(all: &[UnderWay], byte_time: Span) -> Self {
        let mut carried = Self {
            bytes: Vec::with_capacity(all.len()),
            ..Self::default()
        };
        let mut free = None;
        for byte in all {
            let last = carried.runs.last_mut();
            let start = byte.at - byte_time;
            match last.filter(|run| free == Some(start) && run.solicited == byte.solicited()) {
                Some(run) => run.count += 1,
                None => carried.runs.push(ByteRun {
                    start,
                    count: 1,
                    solicited: byte.solicited(),
                }),
            }
            free = Some(byte.at);
            carried.bytes.push(byte.sent());
        }
        carried
    }

    fn heard(all: Vec<UnderWay>) -> Self {
        let mut carried = Self::default();
        for received in all.into_iter().filter_map(|byte| byte.unpack().arrival()) {
            if let Some(error) = received.error {
                carried.errors.push((carried.bytes.len(), error));
            }
            carried.bytes.push(received.byte);
        }
        carried
    }

    fn received(&self) -> Vec<Received> {
        let mut all: Vec<_> = self.bytes.iter().copied().map(Received::good).collect();
        for (place, error) in &self.errors {
            all[*place].error = Some(*error);
        }
        all
    }
}

/// The numbers of a state of a place, among those that a [`SharedRing`] has met. Equal states have equal numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct PlaceState {
    place: u32,
    /// The bytes on its link, which are many where the place itself is the same.
    under_way: u32,
}

/// The number of a stream of bytes, among those that a [`SharedRing`] has met. Equal streams have equal numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SentStream(u32);

/// What a place became, and what it sent meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlaceStep {
    /// The state of the place.
    place: PlaceState,
    sent: SentStream,
}

/// The state of a whole ring.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SharedState {
    /// Drives in the order of the ring, and the master's receiver.
    places: Vec<PlaceState>,
    now: Instant,
}

impl SharedState {
    fn of_drive(&self, k: u8) -> Option<PlaceState> {
        let drives = self.places.len().checked_sub(1)?;
        let place = drives.checked_sub(usize::from(k) + 1)?;
        self.places.get(place).copied()
    }
}

/// What became of a ring while the master sent something.
#[derive(Clone, Debug)]
pub struct Passage {
    /// The ring when the last byte has been sent.
    after: SharedState,
    /// What was sent on each link, and what the master heard.
    streams: Vec<SentStream>,
}

impl Passage {
    /// The ring when the last byte has been sent.
    #[must_use]
    pub const fn after(&self) -> &SharedState {
        &self.after
    }

    /// What was sent on a link, if the ring has it.
    #[must_use]
    pub fn sent_on(&self, link: usize) -> Option<SentStream> {
        self.streams.get(link).copied()
    }

    /// What the master heard.
    #[must_use]
    pub fn heard(&self) -> SentStream {
        // There is one for the master at least.
        self.streams[self.streams.len() - 1]
    }
}

/// What was met, each with the number by which it is called.
#[derive(Clone, Debug)]
struct Numbered<T> {
    /// The last one with a hash.
    last: HashMap<u64, u32, Mixing>,
    /// Each with its hash and the one before it that has the same hash.
    all: Vec<(Box<T>, u64, Option<u32>)>,
}

impl<T> Default for Numbered<T> {
    fn default() -> Self {
        Self {
            last: HashMap::default(),
            all: Vec::new(),
        }
    }
}

impl<T: Hash + Eq> Numbered<T> {
    fn number(&mut self, value: T) -> u32 {
        let hash = Mixing::default().hash_one(&value);
        let last = self.last.get(&hash).copied();
        let mut same = last;
        while let Some(number) = same {
            let (other, _, before) = &self.all[number as usize];
            if **other == value {
                return number;
            }
            same = *before;
        }
        // Memory ends before the numbers do.
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        self.all.push((Box::new(value), hash, last));
        self.last.insert(hash, number);
        number
    }

    fn get(&self, number: u32) -> &T {
        &self.all[number as usize].0
    }

    /// Forgets all but the first `count`.
    fn forget_after(&mut self, count: usize) {
        for (_, hash, before) in self.all.drain(count..).rev() {
            match before {
                Some(before) => self.last.insert(hash, before),
                None => self.last.remove(&hash),
            };
        }
    }
}

/// What is made of each key, in the order in which the keys were met.
#[derive(Clone, Debug)]
struct Made<K, V> {
    of: HashMap<K, V, Mixing>,
    keys: Vec<K>,
}

impl<K, V> Default for Made<K, V> {
    fn default() -> Self {
        Self {
            of: HashMap::default(),
            keys: Vec::new(),
        }
    }
}

impl<K: Hash + Eq + Copy, V: Copy> Made<K, V> {
    fn insert(&mut self, key: K, value: V) {
        self.of.insert(key, value);
        self.keys.push(key);
    }

    fn forget_after(&mut self, count: usize) {
        for key in self.keys.drain(count..) {
            self.of.remove(&key);
        }
    }
}

/// How much a [`SharedRing`] had met at a time.
#[derive(Clone, Copy, Debug)]
pub struct MetSoFar {
    places: usize,
    under_way: usize,
    streams: usize,
    steps: usize,
}

/// A ring of plain drives on which cases share what they have in common.
#[derive(Clone, Debug)]
pub struct SharedRing {
    byte_time: Span,
    /// Places without the bytes on their links.
    places: Numbered<RingPlace>,
    under_way: Numbered<Vec<UnderWay>>,
    streams: Numbered<LinkStream>,
    /// What a place makes of a stream up to a time.
    steps: Made<(PlaceState, SentStream, Instant), PlaceStep>,
}

impl SharedRing {
    /// The ring, and its state. `None` where it has a drive that is not plain, where something is under way or recorded, or
    /// where a link is open.
    #[must_use]
    pub fn new(ring: &Ring<Drive>) -> Option<(Self, SharedState)> {
        let (links, nodes) = ring.at_rest()?;
        let mut shared = Self {
            byte_time: ring.byte_time(),
            places: Numbered::default(),
            under_way: Numbered::default(),
            streams: Numbered::default(),
            steps: Made::default(),
        };
        let mut places = Vec::with_capacity(links.len());
        for (place, inbound) in links.iter().enumerate() {
            let mut inbound = inbound.clone();
            if inbound.is_recording() || inbound.is_open() || !inbound.under_way().is_empty() {
                return None;
            }
            inbound.forget_arrived();
            let node = match nodes.get(place).map(|node| (node, node.device())) {
                None => None,
                Some((node, Drive::Plain(drive))) if !node.is_recording() => {
                    Some(node.around(drive.clone()))
                }
                Some(_) => return None,
            };
            let outbound = links.get(place + 1);
            let place = RingPlace {
                inbound,
                node,
                line_free: outbound.map_or(Instant::START, Link::line_free),
            };
            places.push(shared.met(place));
        }
        let now = ring.now();
        Some((shared, SharedState { places, now }))
    }

    fn met(&mut self, mut place: RingPlace) -> PlaceState {
        let under_way = place.inbound.take_under_way();
        PlaceState {
            under_way: self.under_way.number(under_way),
            place: self.places.number(place),
        }
    }

    fn place(&self, state: PlaceState) -> RingPlace {
        let mut place = self.places.get(state.place).clone();
        let under_way = self.under_way.get(state.under_way);
        place.inbound.put_under_way(under_way);
        place
    }

    /// What a place in this state becomes when the place before it sends this stream.
    fn step(&mut self, place: PlaceState, stream: SentStream, until: Instant) -> PlaceStep {
        if let Some(became) = self.steps.of.get(&(place, stream, until)) {
            return *became;
        }
        let ring_place = self.place(place);
        let became = self.work(ring_place, stream, until);
        self.steps.insert((place, stream, until), became);
        became
    }

    fn work(&mut self, mut place: RingPlace, stream: SentStream, until: Instant) -> PlaceStep {
        let sent = place.take(self.streams.get(stream.0), until);
        PlaceStep {
            place: self.met(place),
            sent: SentStream(self.streams.number(sent)),
        }
    }

    /// Lets the master send these bytes without a gap and without a fault, up to the time at which the last one has been sent.
    pub fn send(&mut self, before: &SharedState, bytes: &[u8]) -> Passage {
        let sent = LinkStream {
            bytes: bytes.to_vec(),
            runs: vec![ByteRun {
                start: before.now,
                count: bytes.len(),
                solicited: true,
            }],
            errors: Vec::new(),
        };
        let now = before.now + self.byte_time * bytes.len() as u64;
        let mut stream = SentStream(self.streams.number(sent));
        let mut passage = Passage {
            after: SharedState {
                places: Vec::with_capacity(before.places.len()),
                now,
            },
            streams: Vec::with_capacity(before.places.len() + 1),
        };
        passage.streams.push(stream);
        for place in &before.places {
            let became = self.step(*place, stream, now);
            stream = became.sent;
            passage.after.places.push(became.place);
            passage.streams.push(stream);
        }
        passage
    }

    /// What the place behind link `link` becomes in a passage if these faults happen there: each with its byte, counted from 1 over all
    /// that the link has carried. `before` is the ring before the passage. `None` where the ring has no such link.
    pub fn disturb(
        &mut self,
        before: &SharedState,
        passage: &Passage,
        link: usize,
        faults: impl IntoIterator<Item = (u64, LinkFault)>,
    ) -> Option<PlaceStep> {
        let mut place = self.place(*before.places.get(link)?);
        for (byte, fault) in faults {
            place.inbound.arm(byte, fault);
        }
        // With a fault that waits, the place is met once: there is nothing to be kept for it.
        Some(self.work(place, *passage.streams.get(link)?, passage.after.now))
    }

    /// The passage in which the place behind link `link` became this, with what follows for the places behind it.
    #[must_use]
    pub fn follow(
        &mut self,
        before: &SharedState,
        passage: &Passage,
        link: usize,
        became: PlaceStep,
    ) -> Passage {
        let until = passage.after.now;
        let mut passage = passage.clone();
        let mut stream = became.sent;
        if let Some(place) = passage.after.places.get_mut(link) {
            *place = became.place;
        }
        for place in link + 1..before.places.len() {
            // From here on everything is as in the passage.
            if passage.streams[place] == stream {
                return passage;
            }
            passage.streams[place] = stream;
            let became = self.step(before.places[place], stream, until);
            passage.after.places[place] = became.place;
            stream = became.sent;
        }
        if let Some(heard) = passage.streams.last_mut() {
            *heard = stream;
        }
        passage
    }

    /// The bytes of a stream.
    #[must_use]
    pub fn bytes(&self, stream: SentStream) -> Vec<Received> {
        self.streams.get(stream.0).received()
    }

    /// Drive `k` of a ring in this state, if the ring has it.
    #[must_use]
    pub fn drive(&self, state: &SharedState, k: u8) -> Option<&PlainDrive> {
        let place = self.places.get(state.of_drive(k)?.place);
        place.node.as_ref().map(RingNode::device)
    }

    /// The number of the state of drive `k`, if the ring has it: a drive that has the same number later is the same, with the same memory.
    /// Numbers are small. [`Self::forget_after`] frees them for other states.
    #[must_use]
    pub fn drive_number(&self, state: &SharedState, k: u8) -> Option<usize> {
        Some(state.of_drive(k)?.place as usize)
    }

    /// How much it has met so far.
    #[must_use]
    pub fn mark(&self) -> MetSoFar {
        MetSoFar {
            places: self.places.all.len(),
            under_way: self.under_way.all.len(),
            streams: self.streams.all.len(),
            steps: self.steps.keys.len(),
        }
    }

    /// Forgets what it has met since `mark`. No passage, state or stream of later may be used any more.
    pub fn forget_after(&mut self, mark: MetSoFar) {
        self.places.forget_after(mark.places);
        self.under_way.forget_after(mark.under_way);
        self.streams.forget_after(mark.streams);
        self.steps.forget_after(mark.steps);
    }

    /// Number of steps that it keeps: about 1 kB each.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.steps.keys.len() + self.places.all.len()
    }
}

/// A hash of whole words. Nothing is lost by a bad one: what is equal is compared.
#[derive(Clone, Copy, Debug, Default)]
struct Mix(u64);

type Mixing = BuildHasherDefault<Mix>;

impl Mix {
    #[inline]
    fn mix(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }
}

impl Hasher for Mix {
    fn write(&mut self, bytes: &[u8]) {
        let mut words = bytes.chunks_exact(8);
        for word in &mut words {
            let mut eight = [0; 8];
            eight.copy_from_slice(word);
            self.mix(u64::from_le_bytes(eight));
        }
        let mut padded = [0; 8];
        let rest = words.remainder();
        padded[..rest.len()].copy_from_slice(rest);
        self.mix(u64::from_le_bytes(padded));
    }

    #[inline]
    fn write_u8(&mut self, value: u8) {
        self.mix(u64::from(value));
    }

    #[inline]
    fn write_u32(&mut self, value: u32) {
        self.mix(u64::from(value));
    }

    #[inline]
    fn write_u64(&mut self, value: u64) {
        self.mix(value);
    }

    #[inline]
    fn write_usize(&mut self, value: usize) {
        self.mix(value as u64);
    }

    fn finish(&self) -> u64 {
        // The table looks at the high bits and at the low ones.
        self.0 ^ self.0 >> 32
    }
}
