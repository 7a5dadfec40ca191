//! Drives in a row that only pass bytes on, advanced together.
//!
//! A drive that is not addressed sends each byte one byte time after it has received it, an address byte with 1 added; in the error mode it
//! adds 1 to each but those of a check sequence. So what [`Relay`] keeps of the bytes tells the state of all drives of the row: they differ
//! by their place alone. A group takes each byte once, when the first drive receives it. It gives the byte to no drive but the one that is
//! addressed, at that drive's own time, and puts it on the link behind the group when the last drive sends it.
//!
//! Times are those of `GroupByte::home`: when a byte reaches the end of the ring. Bytes and [`Relay`] are those of the first drive.
//! With both, a byte has the same entry at every drive.
//!
//! A group ends at the first byte that its drives do not pass on in this way. Then each drive and each link gets the state that the
//! entries tell, and is advanced by itself. [`Ring`](super::ring::Ring) decides where groups begin.

use crate::novobus::device::Device;
use crate::novobus::link::Link;
use crate::novobus::node::RingNode;
use crate::novobus::under_way::UnderWay;
use crate::record::LineByte;
use harness_proto::novobus::bus_end::{Passing, Relay};
use harness_proto::novobus::error_mode::Climb;
use harness_proto::time::{Instant, Span};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

/// Minimum number of drives in a group: below it, the bookkeeping of a group costs more than its drives.
pub(crate) const LEAST: usize = 6;

/// How many bytes that have left a group are kept at most where none is recorded.
const SPENT: usize = 512;

/// A byte on its way through a group.
#[derive(Clone, Copy, Debug)]
struct GroupByte {
    /// When it reaches the end of the ring.
    home: Instant,
    /// What the first drive receives.
    byte: u8,
    /// Whether drives add 1 to it, up to the one at `turn`.
    climbs: bool,
    /// The first drive that does something else with it: its number in the group.
    turn: u8,
    /// What the drives behind that one receive.
    answer: u8,
    /// The number of the drive that is addressed.
    addressed: Option<u8>,
    /// What the first drive keeps behind this byte.
    relay: Relay,
}

/// No drive's number in a group: a ring has fewer.
const NO_TURN: u8 = u8::MAX;

impl GroupByte {
    /// What drive `number` of the group receives.
    #[inline]
    fn at(&self, number: u8) -> u8 {
        if number > self.turn {
            self.answer
        } else if self.climbs {
            self.byte.wrapping_add(number)
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
    /// Whether drives keep what they remark.
    remarking: bool,
    /// When the group was formed. What had arrived at a drive then, the drive has dealt with.
    formed: Instant,
    /// How many bytes the first drive had received, and the last one had sent, when the group was formed.
    received_before: u64,
    sent_before: u64,
    /// What the first drive keeps behind the last byte.
    relay: Relay,
    /// The bytes since the group was formed; where none is recorded, the last one that has left and those behind it.
    entries: Vec<GroupByte>,
    /// How many were before these.
    dropped: usize,
    /// How many have left the group, of all.
    left: usize,
    /// Bytes for addressed drives: when they arrive there, and their number.
    waiting: BinaryHeap<Reverse<(Instant, usize)>>,
}

impl Group {
    /// The group that ends with the last of `nodes`, the first of which is in place `first`; `links[i]` ends at `nodes[i]`, and the last
    /// link leads away from the last node. It takes over what is under way inside of it. `None` where fewer than [`LEAST`] drives make
    /// one. Nothing may be due before `now`.
    pub(crate) fn form<D: Device>(
        first: usize,
        nodes: &[RingNode<D>],
        links: &mut [Link],
        end: usize,
        now: Instant,
    ) -> Option<Self> {
        nodes.get(LEAST - 1)?;
        let row = GroupRow::of(nodes, links, now)?;
        let (nodes, links) = (&nodes[row.first..], &mut links[row.first..]);
        nodes.get(LEAST - 1)?;
        let last = nodes.len() - 1;
        let start = first + row.first;
        let mut group = Self {
            places: start..start + nodes.len(),
            end,
            byte_time: links[last].byte_time(),
            recording: links[last].is_recording(),
            remarking: nodes[last].is_recording(),
            formed: now,
            received_before: links[0].arrived().checked_sub(row.bytes.len() as u64)?,
            sent_before: links[last + 1].transmitted(),
            relay: nodes[last].relay()?.ahead(low(last)),
            entries: Vec::new(),
            dropped: 0,
            left: 0,
            waiting: BinaryHeap::new(),
        };
        for (inner, byte) in row.bytes {
            group.enter(low(inner - row.first), byte)?;
        }
        group.relay = row.relay;
        if let Some(newest) = group.entries.last_mut() {
            newest.relay = row.relay;
        }
        let mut older = 0;
        for inner in links[1..=last].iter_mut().rev() {
            older += inner.hand_over(older);
        }
        Some(group)
    }

    /// The number of the drive in this place, or of the one that would follow the last.
    fn number(&self, place: usize) -> u8 {
        low(place - self.places.start)
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
    fn entry(&self, number: usize) -> Option<&GroupByte> {
        self.entries.get(number.checked_sub(self.dropped)?)
    }

    /// Does everything that is due up to and including `until`. An error is the time at which the group ends, with everything done
    /// that is due up to then. `nodes` are those of the group, `outbound` leads away from the last.
    pub(crate) fn run<D: Device>(
        &mut self,
        nodes: &mut [RingNode<D>],
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
            if self.enter(0, byte).is_none() {
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

    /// Takes a byte that arrives at drive `number` of the group, most often the first; `None` where the drives do not pass it on as a
    /// group.
    #[inline]
    fn enter(&mut self, number: u8, arriving: UnderWay) -> Option<()> {
        let byte = arriving.plain()?;
        let entry = match self.relay {
            Relay::Passing(relay) => self.passed_on(relay, number, arriving.at, byte)?,
            Relay::Climbing(relay) => self.climbed(relay, number, arriving.at, byte)?,
        };
        self.relay = entry.relay;
        self.entries.push(entry);
        Some(())
    }

    /// When a byte that arrives at drive `number` at `at` reaches the end of the ring.
    #[inline]
    fn home(&self, number: u8, at: Instant) -> Instant {
        at + self.way_home(self.places.start + usize::from(number))
    }

    /// A byte that arrives in normal mode.
    #[inline]
    fn passed_on(
        &mut self,
        before: Passing,
        number: u8,
        at: Instant,
        byte: u8,
    ) -> Option<GroupByte> {
        let climbs = before.awaits_address();
        let byte = byte.wrapping_sub(if climbs { number } else { 0 });
        let relay = before.receive(byte)?;
        let sum = before.addressing().or_else(|| relay.addressing());
        let addressed = sum.map(u8::wrapping_neg);
        let addressed = addressed.filter(|drive| usize::from(*drive) < self.places.len());
        if let Some(drive) = addressed.filter(|drive| *drive >= number) {
            let at = at + self.byte_time * u64::from(drive - number);
            self.waiting.push(Reverse((at, self.count())));
        }
        Some(GroupByte {
            home: self.home(number, at),
            byte,
            climbs,
            // Each drive adds 1 to an address byte, also the addressed one.
            turn: addressed.filter(|_| !climbs).unwrap_or(NO_TURN),
            answer: byte,
            addressed,
            relay: Relay::Passing(relay),
        })
    }

    /// A byte that arrives in the error mode.
    #[inline(never)]
    fn climbed(&self, before: Climb, number: u8, at: Instant, byte: u8) -> Option<GroupByte> {
        let relay = before.behind(number).receive(byte)?.ahead(number);
        let remarks = relay.began_sequence() && usize::from(relay.from()) < self.places.len();
        if self.remarking && remarks {
            return None;
        }
        Some(GroupByte {
            home: self.home(number, at),
            byte: byte.wrapping_sub(number),
            climbs: true,
            turn: relay.from(),
            answer: relay.in_sequence(),
            addressed: None,
            relay: Relay::Climbing(relay),
        })
    }

    /// How many bytes it has taken.
    fn count(&self) -> usize {
        self.dropped + self.entries.len()
    }

    /// Gives byte `number` to the drive that is addressed; false where that drive then is no longer one of the group.
    fn give<D: Device>(
        &mut self,
        nodes: &mut [RingNode<D>],
        inner: &[Link],
        at: Instant,
        number: usize,
    ) -> bool {
        let Some(entry) = self.entry(number).copied() else {
            return false;
        };
        let drive = entry.addressed.unwrap_or_default();
        let offset = usize::from(drive);
        let Some(node) = nodes.get_mut(offset) else {
            return false;
        };
        self.make_up(self.places.start + offset, number, node.device_mut());
        let before = offset.checked_sub(1).and_then(|link| inner.get(link));
        let received = before.map_or(self.received_before, Link::arrived);
        let sent = inner
            .get(offset)
            .map_or(self.sent_before, Link::transmitted);
        let number_of = |before: u64| before + number as u64 + 1;
        let answer = node.answer(at, entry.at(drive), number_of(received), number_of(sent));
        let kept = self.entries.get_mut(number - self.dropped);
        if let (Some(kept), Some(answer)) = (kept, answer) {
            kept.answer = answer;
        }
        node.relay() == Some(entry.relay.behind(drive))
    }

    /// Lets the drive in this place make up for the bytes that it has passed on, of the first `count`.
    fn make_up<D: Device>(&self, place: usize, count: usize, device: &mut D) {
        let last = count.checked_sub(1).and_then(|last| self.entry(last));
        let Some(entry) = last else { return };
        let (number, at) = (self.number(place), entry.home - self.way_home(place));
        if entry.addressed != Some(number) && at > self.formed {
            device.has_relayed(at, entry.relay.behind(number));
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
        let (way_home, behind) = (self.way_home(last), self.number(last + 1));
        while let Some(entry) = self.entry(self.left)
            && entry.home <= now + way_home
        {
            outbound.transmit(entry.home - way_home, entry.at(behind), true);
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
    fn on_link(&self, place: usize, entry: &GroupByte) -> UnderWay {
        let byte = entry.at(self.number(place));
        UnderWay::whole(entry.home - self.way_home(place), byte, true)
    }

    /// Ends the group at `now`, up to which everything has happened: gives each drive and each inner link its own state.
    pub(crate) fn end<D: Device>(
        &self,
        nodes: &mut [RingNode<D>],
        links: &mut [Link],
        now: Instant,
    ) {
        for ((place, node), inbound) in self.places().zip(nodes).zip(links) {
            let arrived = self.arrived(place, now);
            self.make_up(place, arrived, node.device_mut());
            node.device_mut().advance(now);
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

/// Drives that can make a group.
struct GroupRow {
    /// The first of them, in the nodes from which they are taken. They end with the last node.
    first: usize,
    /// What is under way between them, the oldest first, each with the drive to which it is under way.
    bytes: Vec<(usize, UnderWay)>,
    /// What the first of them keeps.
    relay: Relay,
    /// When the newest of the bytes arrives, or has arrived, at the second of them.
    newest: Option<Instant>,
}

impl GroupRow {
    /// The longest row that ends with the last of `nodes`.
    fn of<D: Device>(nodes: &[RingNode<D>], links: &[Link], now: Instant) -> Option<Self> {
        let first = nodes.len().checked_sub(1)?;
        let mut row = Self {
            first,
            bytes: Vec::new(),
            relay: nodes[first].relay()?,
            newest: None,
        };
        let recording = links[first].is_recording();
        while let Some(ahead) = row.first.checked_sub(1)
            && links[row.first].is_recording() == recording
            && row
                .lengthen(&nodes[ahead], &links[row.first], now)
                .is_some()
        {}
        Some(row)
    }

    /// Takes one more drive into the row, and the link that leads away from it; `None` where it is none of the row.
    fn lengthen<D: Device>(
        &mut self,
        ahead: &RingNode<D>,
        link: &Link,
        now: Instant,
    ) -> Option<()> {
        // What the links of the row have carried is counted without these bytes.
        let counted = link.arrived() >= self.bytes.len() as u64;
        if !link.is_clear(now) || !counted {
            return None;
        }
        let byte = match link.under_way() {
            [] => None,
            [byte] if !link.is_recording() => Some(*byte),
            _ => return None,
        };
        // When the link to the drive ahead carried the newest of the bytes so far.
        let passed = self.newest.map(|at| at - link.byte_time());
        let newest = byte.map(|byte| byte.at).or(passed);
        let undelayed = newest.map_or(link.is_idle(now), |at| link.is_free_from(at));
        let waits = byte.is_some_and(|byte| self.newest.is_some_and(|at| byte.at < at));
        if !undelayed || waits {
            return None;
        }
        let mut relay = self.relay;
        if let Some(byte) = byte {
            relay = relay.receive(byte.plain()?)?;
        }
        self.relay = relay.led_by(ahead.relay()?)?;
        self.bytes.extend(byte.map(|byte| (self.first, byte)));
        self.newest = newest;
        self.first -= 1;
        Some(())
    }
}

/// A number of places as drives count sums; a ring has fewer than 256.
fn low(places: usize) -> u8 {
    places.to_le_bytes()[0]
}
