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
use crate::novobus::node::Node;
use crate::novobus::plain::PlainDrive;
use crate::novobus::ring::Ring;
use crate::novobus::under_way::UnderWay;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hash, Hasher};
use std::sync::Arc;

/// A place of the ring: the link to it and the drive there, or the master's receiver.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Place {
    inbound: Link,
    node: Option<Node<PlainDrive>>,
    /// When the drive's transmitter can start its next byte.
    line_free: Instant,
}

impl Place {
    /// What becomes of the place, and what it sends on, up to and including `until`. `sent` is what the place before it sends; the
    /// master's receiver sends on what it hears.
    fn take(&mut self, sent: &[UnderWay], until: Instant) -> Vec<UnderWay> {
        let byte_time = self.inbound.byte_time();
        for byte in sent {
            let start = byte.at - byte_time;
            self.inbound.transmit(start, byte.sent(), byte.solicited());
        }
        let Some(node) = &mut self.node else {
            return self.inbound.take_until(until);
        };
        let mut outbound = Link::free_from(byte_time, self.line_free);
        node.run(&mut self.inbound, &mut outbound, until);
        self.inbound.forget_arrived();
        self.line_free = outbound.line_free();
        outbound.under_way().to_vec()
    }
}

/// The number of a state of a place, among those that a [`SharedRing`] has met. Equal states have equal numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlaceState(u32);

/// The number of a stream of bytes, among those that a [`SharedRing`] has met. Equal streams have equal numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stream(u32);

/// What a place became, and what it sent meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Became {
    /// The state of the place.
    place: PlaceState,
    /// What it sent.
    sent: Stream,
}

/// The state of a whole ring.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct RingState {
    /// Drives in the order of the ring, and the master's receiver.
    places: Vec<PlaceState>,
    now: Instant,
}

/// What became of a ring while the master sent something.
#[derive(Clone, Debug)]
pub struct Passage {
    /// The ring when the last byte has been sent.
    after: RingState,
    /// What was sent on each link, and what the master heard.
    streams: Vec<Stream>,
}

impl Passage {
    /// The ring when the last byte has been sent.
    #[must_use]
    pub const fn after(&self) -> &RingState {
        &self.after
    }

    /// What the master heard.
    #[must_use]
    pub fn heard(&self) -> Stream {
        // There is one for the master at least.
        self.streams[self.streams.len() - 1]
    }
}

/// What was met, each with the number by which it is called.
#[derive(Clone, Debug)]
struct Met<T> {
    numbers: HashMap<Arc<T>, u32, Mixing>,
    all: Vec<Arc<T>>,
}

impl<T> Default for Met<T> {
    fn default() -> Self {
        Self {
            numbers: HashMap::default(),
            all: Vec::new(),
        }
    }
}

impl<T: Hash + Eq> Met<T> {
    fn number(&mut self, own: T) -> u32 {
        if let Some(number) = self.numbers.get(&own) {
            return *number;
        }
        // Memory ends before the numbers do.
        let number = u32::try_from(self.all.len()).unwrap_or(u32::MAX);
        let own = Arc::new(own);
        self.all.push(own.clone());
        self.numbers.insert(own, number);
        number
    }

    fn get(&self, number: u32) -> Arc<T> {
        self.all[number as usize].clone()
    }
}

/// A ring of plain drives on which cases share what they have in common.
#[derive(Clone, Debug)]
pub struct SharedRing {
    byte_time: Span,
    places: Met<Place>,
    streams: Met<Vec<UnderWay>>,
    steps: HashMap<(PlaceState, Stream, Instant), Became, Mixing>,
}

impl SharedRing {
    /// The ring, and its state. `None` where it has a drive that is not plain, where something is under way or recorded, or
    /// where a link is open.
    #[must_use]
    pub fn new(ring: &Ring<Drive>) -> Option<(Self, RingState)> {
        let (links, nodes) = ring.at_rest()?;
        let mut own = Self {
            byte_time: ring.byte_time(),
            places: Met::default(),
            streams: Met::default(),
            steps: HashMap::default(),
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
            let place = Place {
                inbound,
                node,
                line_free: outbound.map_or(Instant::START, Link::line_free),
            };
            places.push(own.met(place));
        }
        let now = ring.now();
        Some((own, RingState { places, now }))
    }

    fn met(&mut self, place: Place) -> PlaceState {
        PlaceState(self.places.number(place))
    }

    fn step(&mut self, place: PlaceState, stream: Stream, until: Instant) -> Became {
        if let Some(became) = self.steps.get(&(place, stream, until)) {
            return *became;
        }
        let own = self.places.get(place.0).as_ref().clone();
        let became = self.work(own, stream, until);
        self.steps.insert((place, stream, until), became);
        became
    }

    fn work(&mut self, mut place: Place, stream: Stream, until: Instant) -> Became {
        let sent = self.streams.get(stream.0);
        let sent = place.take(&sent, until);
        Became {
            place: self.met(place),
            sent: Stream(self.streams.number(sent)),
        }
    }

    /// Lets the master send these bytes without a gap and without a fault, up to the time at which the last one has been sent.
    pub fn send(&mut self, before: &RingState, bytes: &[u8]) -> Passage {
        let mut at = before.now;
        let whole = bytes.iter().map(|byte| {
            at = at + self.byte_time;
            UnderWay::whole(at, *byte, true)
        });
        let whole = whole.collect();
        let mut stream = Stream(self.streams.number(whole));
        let mut passage = Passage {
            after: RingState {
                places: Vec::with_capacity(before.places.len()),
                now: at,
            },
            streams: Vec::with_capacity(before.places.len() + 1),
        };
        passage.streams.push(stream);
        for place in &before.places {
            let became = self.step(*place, stream, at);
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
        before: &RingState,
        passage: &Passage,
        link: usize,
        faults: impl IntoIterator<Item = (u64, LinkFault)>,
    ) -> Option<Became> {
        let place = *before.places.get(link)?;
        let stream = *passage.streams.get(link)?;
        let mut own = self.places.get(place.0).as_ref().clone();
        for (byte, fault) in faults {
            own.inbound.arm(byte, fault);
        }
        // It is met once: what became of it is all that can be shared.
        Some(self.work(own, stream, passage.after.now))
    }

    /// The passage in which the place behind link `link` became this, with what follows for the places behind it.
    #[must_use]
    pub fn follow(
        &mut self,
        before: &RingState,
        passage: &Passage,
        link: usize,
        became: Became,
    ) -> Passage {
        let until = passage.after.now;
        let mut passage = passage.clone();
        let mut stream = became.sent;
        if let Some(own) = passage.after.places.get_mut(link) {
            *own = became.place;
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

    /// The bytes of a stream that arrive.
    #[must_use]
    pub fn bytes(&self, stream: Stream) -> Vec<Received> {
        let all = self.streams.all[stream.0 as usize].iter();
        all.filter_map(|byte| byte.unpack().arrival()).collect()
    }

    /// Drive `k` of a ring in this state, if the ring has it.
    #[must_use]
    pub fn drive(&self, state: &RingState, k: u8) -> Option<&PlainDrive> {
        let drives = state.places.len().checked_sub(1)?;
        let place = drives.checked_sub(usize::from(k) + 1)?;
        let place = self.places.all.get(state.places[place].0 as usize)?;
        place.node.as_ref().map(Node::device)
    }

    /// How many states of places it keeps: about 2 kB each.
    #[must_use]
    pub fn kept(&self) -> usize {
        self.places.all.len()
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
            let mut own = [0; 8];
            own.copy_from_slice(word);
            self.mix(u64::from_le_bytes(own));
        }
        let mut own = [0; 8];
        let rest = words.remainder();
        own[..rest.len()].copy_from_slice(rest);
        self.mix(u64::from_le_bytes(own));
    }

    #[inline]
    fn write_u8(&mut self, own: u8) {
        self.mix(u64::from(own));
    }

    #[inline]
    fn write_u32(&mut self, own: u32) {
        self.mix(u64::from(own));
    }

    #[inline]
    fn write_u64(&mut self, own: u64) {
        self.mix(own);
    }

    #[inline]
    fn write_usize(&mut self, own: usize) {
        self.mix(own as u64);
    }

    fn finish(&self) -> u64 {
        // The table looks at the high bits and at the low ones.
        self.0 ^ self.0 >> 32
    }
}
