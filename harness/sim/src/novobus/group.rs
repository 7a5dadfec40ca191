//! Drives in a row that only pass bytes on, advanced together.
//!
//! A drive that is not addressed sends each byte one byte time after it has received it, an address byte with 1 added. So what
//! [`Relay`] keeps of the bytes tells the state of all drives of the row: they differ by their place alone. A group takes each byte
//! once, when the first drive receives it. It gives the byte to no drive but the one that is addressed, at that drive's own time,
//! and puts it on the link behind the group when the last drive sends it.
//!
//! Times are those of `Entry::home`: when a byte reaches the end of the ring. Sums are those of a drive before all others.
//! With both, a byte has the same entry at every drive.
//!
//! A group ends at the first byte that its drives do not pass on in this way. Then each drive and each link gets the state that the
//! entries tell, and is advanced by itself. [`Ring`](super::ring::Ring) decides where groups begin.

use crate::novobus::device::Device;
use crate::novobus::link::Link;
use crate::novobus::node::Node;
use crate::novobus::under_way::UnderWay;
use crate::record::LineByte;
use harness_proto::novobus::bus_end::Relay;
use harness_proto::time::{Instant, Span};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Minimum number of drives in a group: below it, the bookkeeping of a group costs more than its drives.
const LEAST: usize = 6;

/// How many bytes that have left a group are kept at most where none is recorded.
const SPENT: usize = 512;

/// A byte on its way through a group.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// When it reaches the end of the ring.
    home: Instant,
    /// What the drives before the addressed one receive; of a byte that each increments, what a drive before all others would.
    byte: u8,
    /// What the drives behind the addressed one receive.
    answer: u8,
    /// Whether each drive adds 1 to it.
    climbs: bool,
    /// The place of the addressed drive in the ring.
    addressed: Option<u8>,
    /// What a drive before all others keeps behind this byte.
    relay: Relay,
}

impl Entry {
    /// What the drive in this place receives.
    #[inline]
    fn at(&self, place: usize) -> u8 {
        let place = low(place);
        if self.climbs {
            self.byte.wrapping_add(place)
        } else if self.addressed.is_some_and(|addressed| addressed < place) {
            self.answer
        } else {
            self.byte
        }
    }
}

/// Drives in a row that only pass bytes on.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// Their places in the ring, counted from the master.
    places: Range<usize>,
    /// How many links the ring has.
    end: usize,
    byte_time: Span,
    recording: bool,
    /// How many bytes the first drive had received, and the last one had sent, when the group was formed.
    received_before: u64,
    sent_before: u64,
    /// What a drive before all others keeps behind the last byte.
    relay: Relay,
    /// The bytes since the group was formed; where none is recorded, the last one that has left and those behind it.
    entries: Vec<Entry>,
    /// How many were before these.
    dropped: usize,
    /// How many have left the group, of all.
    left: usize,
    /// Bytes for addressed drives: when they arrive there, and their number.
    waiting: BinaryHeap<Reverse<(Instant, usize)>>,
}

impl Group {
    /// The group that begins with the first of `nodes`, in place `first`; `links[i]` ends at `nodes[i]`, and the last link leads away from
    /// the last node. `None` where fewer than [`LEAST`] drives make one. Nothing may be due before `now`.
    pub(crate) fn form<D: Device>(
        first: usize,
        nodes: &[Node<D>],
        links: &[Link],
        end: usize,
        now: Instant,
    ) -> Option<Self> {
        nodes.get(LEAST - 1)?;
        let relay = |node: &Node<D>, place: usize| {
            let before = low(place).wrapping_neg();
            Some(node.relay()?.behind(before))
        };
        let own = relay(nodes.first()?, first)?;
        let recording = links.get(1)?.is_recording();
        let fits = |(offset, (node, inbound)): &(usize, (&Node<D>, &Link))| {
            inbound.is_idle(now)
                && inbound.is_recording() == recording
                && relay(node, first + offset) == Some(own)
        };
        let more = nodes.iter().zip(links).enumerate().skip(1);
        let count = 1 + more.take_while(fits).count();
        (count >= LEAST).then(|| Self {
            places: first..first + count,
            end,
            byte_time: links[1].byte_time(),
            recording,
            received_before: links[0].arrived(),
            sent_before: links[count].transmitted(),
            relay: own,
            entries: Vec::new(),
            dropped: 0,
            left: 0,
            waiting: BinaryHeap::new(),
        })
    }

    /// The places of its drives.
    pub(crate) fn places(&self) -> Range<usize> {
        self.places.clone()
    }

    /// How long a byte needs from the end of link `place` to the end of the ring.
    fn way_home(&self, place: usize) -> Span {
        self.byte_time * (self.end - place) as u64
    }

    /// How many bytes have reached the end of link `place` up to `now`.
    pub(crate) fn arrived(&self, place: usize, now: Instant) -> usize {
        let home = now + self.way_home(place);
        // Most often all of them or those of the last byte times.
        self.dropped + self.entries.partition_point(|entry| entry.home <= home)
    }

    /// Byte `number`, counted from 0.
    fn entry(&self, number: usize) -> Option<&Entry> {
        self.entries.get(number.checked_sub(self.dropped)?)
    }

    /// Does everything that is due up to and including `until`. An error is the time at which the group ends, with everything done
    /// that is due up to then. `nodes` are those of the group, `outbound` leads away from the last.
    pub(crate) fn run<D: Device>(
        &mut self,
        nodes: &mut [Node<D>],
        links: &mut [Link],
        until: Instant,
    ) -> Result<(), Instant> {
        let [inbound, inner @ .., outbound] = links else {
            return Ok(());
        };
        let mut end = None;
        while let Some(byte) = inbound.peek()
            && byte.at <= until
        {
            if !self.enter(byte.at, byte) {
                end = Some(byte.at - Span::from_units(1));
                break;
            }
            inbound.take_and_keep();
        }
        // Also after a drive has left the group: others are addressed at the same instant.
        while let Some(&Reverse((at, number))) = self.waiting.peek()
            && at <= end.unwrap_or(until)
        {
            self.waiting.pop();
            if !self.give(nodes, inner, at, number) {
                end = Some(at);
            }
        }
        self.leave(outbound, end.unwrap_or(until));
        if let Some(end) = end {
            self.give_back(inbound, end);
        }
        inbound.forget_spent();
        end.map_or(Ok(()), Err)
    }

    /// Takes a byte that arrives at the first drive; false where the drives do not pass it on as a group.
    #[inline]
    fn enter(&mut self, at: Instant, byte: UnderWay) -> bool {
        let Some(byte) = byte.plain() else {
            return false;
        };
        let climbs = self.relay.awaits_address();
        let first = low(self.places.start);
        let byte = byte.wrapping_sub(if climbs { first } else { 0 });
        let Some(relay) = self.relay.receive(byte) else {
            return false;
        };
        let sum = self.relay.addressing().or_else(|| relay.addressing());
        self.relay = relay;
        let addressed = sum.map(u8::wrapping_neg);
        let addressed = addressed.filter(|own| self.places.contains(&usize::from(*own)));
        if let Some(place) = addressed {
            let at = at + self.byte_time * (usize::from(place) - self.places.start) as u64;
            self.waiting.push(Reverse((at, self.count())));
        }
        self.entries.push(Entry {
            home: at + self.way_home(self.places.start),
            byte,
            answer: byte,
            climbs,
            addressed,
            relay,
        });
        true
    }

    /// How many bytes it has taken.
    fn count(&self) -> usize {
        self.dropped + self.entries.len()
    }

    /// Gives byte `number` to the drive that is addressed; false where that drive then is no longer one of the group.
    fn give<D: Device>(
        &mut self,
        nodes: &mut [Node<D>],
        inner: &[Link],
        at: Instant,
        number: usize,
    ) -> bool {
        let Some(entry) = self.entry(number).copied() else {
            return false;
        };
        let place = usize::from(entry.addressed.unwrap_or_default());
        let offset = place - self.places.start;
        let Some(node) = nodes.get_mut(offset) else {
            return false;
        };
        self.make_up(place, number, node.device_mut());
        let before = offset.checked_sub(1).and_then(|own| inner.get(own));
        let received = before.map_or(self.received_before, Link::arrived);
        let sent = inner
            .get(offset)
            .map_or(self.sent_before, Link::transmitted);
        let number_of = |before: u64| before + number as u64 + 1;
        let answer = node.answer(at, entry.at(place), number_of(received), number_of(sent));
        let kept = self.entries.get_mut(number - self.dropped);
        if let (Some(kept), Some(answer)) = (kept, answer) {
            kept.answer = answer;
        }
        node.relay() == Some(entry.relay.behind(low(place)))
    }

    /// Lets the drive in this place make up for the bytes that it has passed on, of the first `count`.
    fn make_up<D: Device>(&self, place: usize, count: usize, device: &mut D) {
        let last = count.checked_sub(1).and_then(|last| self.entry(last));
        if let Some(entry) = last.filter(|last| last.addressed != Some(low(place))) {
            let at = entry.home - self.way_home(place);
            device.has_relayed(at, entry.relay.behind(low(place)));
        }
    }

    /// The drive in this place, with all that has happened to it up to `now`.
    pub(crate) fn show<D: Device>(&self, place: usize, now: Instant, device: &mut D) {
        self.make_up(place, self.arrived(place, now), device);
        device.advance(now);
    }

    /// Puts on the link behind the group what its last drive has received up to `now`.
    fn leave(&mut self, outbound: &mut Link, now: Instant) {
        let last = self.places.end - 1;
        let way_home = self.way_home(last);
        while let Some(entry) = self.entry(self.left)
            && entry.home <= now + way_home
        {
            outbound.transmit(entry.home - way_home, entry.at(last + 1), true);
            self.left += 1;
        }
        let spent = (self.left - self.dropped).saturating_sub(1);
        if !self.recording && spent > SPENT {
            self.entries.drain(..spent);
            self.dropped += spent;
        }
    }

    /// Whether a byte is under way between two of its drives.
    pub(crate) fn busy(&self) -> bool {
        self.left < self.count()
    }

    /// When a byte next reaches one of its drives but the first, behind `now`, up to which everything has happened.
    pub(crate) fn next_arrival(&self, now: Instant) -> Instant {
        let mut next = Instant::NEVER;
        let mut before = None;
        let byte_time = self.byte_time.units();
        for entry in &self.entries[self.left - self.dropped..] {
            // Bytes without a gap are all due at the same time.
            if before.is_none_or(|before: Instant| before + self.byte_time != entry.home) {
                let rest = entry.home.since(now).units() % byte_time;
                let rest = if rest == 0 { byte_time } else { rest };
                next = next.min(now + Span::from_units(rest));
            }
            before = Some(entry.home);
        }
        next
    }

    /// How many bytes its inner links have carried beyond those that they have counted.
    pub(crate) fn carried(&self, now: Instant) -> u64 {
        let inner = self.places.start + 1..self.places.end;
        inner.map(|place| self.arrived(place, now) as u64).sum()
    }

    /// How many bytes the inner link to this place has recorded since the group was formed, up to `now`.
    pub(crate) fn logged(&self, place: usize, now: Instant) -> usize {
        if self.recording {
            self.arrived(place, now)
        } else {
            0
        }
    }

    /// One of them.
    pub(crate) fn logged_byte(&self, place: usize, index: usize) -> Option<LineByte> {
        Some(self.on_link(place, self.entries.get(index)?).unpack())
    }

    /// The byte on the link to this place.
    fn on_link(&self, place: usize, entry: &Entry) -> UnderWay {
        UnderWay::whole(entry.home - self.way_home(place), entry.at(place), true)
    }

    /// Ends the group at `now`, up to which everything has happened: gives each drive and each inner link its own state.
    pub(crate) fn end<D: Device>(&self, nodes: &mut [Node<D>], links: &mut [Link], now: Instant) {
        for ((place, node), inbound) in self.places().zip(nodes).zip(links) {
            let arrived = self.arrived(place, now);
            self.make_up(place, arrived, node.device_mut());
            if place > self.places.start {
                let kept = self.entries[..self.arrived(place - 1, now) - self.dropped].iter();
                let way_home = self.way_home(place);
                let skipped = if self.recording {
                    0
                } else {
                    arrived - self.dropped
                };
                let line_free = kept.clone().last().map(|last| last.home - way_home);
                inbound.catch_up(
                    kept.skip(skipped).map(|entry| self.on_link(place, entry)),
                    (self.arrived(place - 1, now), arrived),
                    line_free,
                );
            }
        }
    }

    /// Gives back to the link to the first drive what arrives there behind `now`.
    fn give_back(&mut self, inbound: &mut Link, now: Instant) {
        let arrived = self.arrived(self.places.start, now);
        inbound.give_back(self.count() - arrived);
        self.entries.truncate(arrived - self.dropped);
    }
}

/// A place as drives count sums; a ring has fewer than 256.
fn low(place: usize) -> u8 {
    place.to_le_bytes()[0]
}
