//! One link of a ring: a wire that carries one byte at a time, and its faults.

use crate::fault::{Flips, LinkFault};
use crate::novobus::fault_plan::FaultPlan;
use crate::novobus::uart::{self, Uart};
use crate::novobus::under_way::{UnderWay, WireBytes};
use crate::record::LineByte;
use harness_proto::line::{LineError, Received};
use harness_proto::time::{Instant, Span};

/// A link that is cut open: an outside party takes what the transmitter sends and supplies what the receiver hears.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
struct Opening {
    /// Bytes that have been sent and not been fetched.
    sent: WireBytes,
    /// When the last byte sent arrives there.
    last_arrival: Instant,
}

/// A wire from one transmitter to one receiver.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Link {
    byte_time: Span,
    /// When the transmitter can start its next byte.
    line_free: Instant,
    /// When the last byte arrived: bytes arrive one after another.
    last_arrival: Instant,
    bytes: WireBytes,
    transmitted: u64,
    plan: FaultPlan<LinkFault>,
    cut: bool,
    opening: Option<Box<Opening>>,
    /// The receiver, as long as it is out of step (a damaged start bit).
    out_of_step: Option<Uart>,
    /// Until when the line is held at 0.
    held_until: Instant,
    /// No fault stands between a byte and its receiver.
    sound: bool,
    arrived: u64,
}

impl Link {
    pub(crate) fn new(byte_time: Span) -> Self {
        Self {
            byte_time,
            line_free: Instant::START,
            last_arrival: Instant::START,
            bytes: WireBytes::recorded(),
            transmitted: 0,
            plan: FaultPlan::default(),
            cut: false,
            opening: None,
            out_of_step: None,
            held_until: Instant::START,
            sound: true,
            arrived: 0,
        }
    }

    /// Resets the link for reuse. It keeps its allocations, so that many short cases do not reallocate, and whether it records.
    pub(crate) fn restart(&mut self) {
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        let mut plan = std::mem::take(&mut self.plan);
        plan.clear();
        *self = Self {
            bytes,
            plan,
            ..Self::new(self.byte_time)
        };
    }

    /// How many bytes it has carried that are recorded.
    pub(crate) fn logged(&self) -> usize {
        self.bytes.logged()
    }

    /// All of them, in order.
    pub(crate) fn log(&self) -> impl Iterator<Item = LineByte> + '_ {
        self.bytes.log()
    }

    /// One of them, in order.
    pub(crate) fn logged_byte(&self, index: usize) -> Option<LineByte> {
        self.bytes.logged_byte(index)
    }

    /// Reserves room for this number of bytes.
    pub(crate) fn reserve(&mut self, bytes: usize) {
        self.bytes.reserve(bytes);
    }

    pub(crate) fn stop_recording(&mut self) {
        self.bytes.record(false);
    }

    /// Records what it carries from now on.
    pub(crate) fn record_anew(&mut self) {
        self.bytes.record(true);
    }

    /// Returns the bytes recorded since the last call.
    pub(crate) fn take_log(&mut self) -> Vec<LineByte> {
        let log = self.log().collect();
        self.bytes.forget_arrived();
        log
    }

    /// Cuts the link open: from now on the receiver hears only what is fed, and what the transmitter sends has to be
    /// fetched.
    pub(crate) fn open(&mut self) {
        self.opening.get_or_insert_default();
        self.sound = false;
    }

    /// Feeds the receiver of an open link a byte that starts at `now` at the earliest; says when it arrives.
    pub(crate) fn feed(&mut self, now: Instant, byte: Received) -> Instant {
        self.line_up(UnderWay::pack(LineByte {
            at: now + self.byte_time,
            sent: Some(byte.byte),
            received: Some(byte.byte),
            error: byte.error,
            solicited: true,
        }));
        self.last_arrival
    }

    /// When the next byte of an open link's transmitter has been sent.
    pub(crate) fn next_sent(&self) -> Instant {
        let opening = self.opening.as_ref();
        opening.map_or(Instant::NEVER, |opening| opening.sent.next_arrival())
    }

    /// The next byte that an open link's transmitter has sent by `now`.
    pub(crate) fn fetch(&mut self, now: Instant) -> Option<LineByte> {
        let sent = &mut self.opening.as_mut()?.sent;
        if sent.next_arrival() > now {
            return None;
        }
        sent.take().map(UnderWay::unpack)
    }

    /// Discards the bytes carried and the faults whose byte has not come, and joins a link that was cut, as an interposer does. Bytes
    /// under way count as the first bytes.
    pub(crate) fn begin(&mut self) {
        self.join();
        self.plan = FaultPlan::default();
        self.bytes.forget_arrived();
        self.transmitted = self.bytes.under_way().len() as u64;
        self.arrived = 0;
    }

    /// When the transmitter can start its next byte.
    pub(crate) fn line_free(&self) -> Instant {
        self.line_free
    }

    /// How many of the bytes that were transmitted have come to the end of the link, or were lost on it. Of an open link it says nothing:
    /// what arrives there was fed.
    pub(crate) fn delivered(&self) -> u64 {
        let under_way = self.bytes.under_way().iter();
        let sent = under_way.filter(|byte| byte.is_sent()).count() as u64;
        self.transmitted.saturating_sub(sent)
    }

    /// How many bytes have been transmitted, begun ones included.
    pub(crate) fn transmitted(&self) -> u64 {
        self.transmitted
    }

    /// How many bytes have reached the receiver's end, lost ones included.
    pub(crate) fn arrived(&self) -> u64 {
        self.arrived
    }

    /// Whether a byte is under way that goes back to the master's.
    pub(crate) fn carries_solicited(&self) -> bool {
        self.bytes.under_way().iter().any(|byte| byte.solicited())
    }

    /// Faults whose byte has not come yet.
    pub(crate) fn waiting_faults(&self) -> impl Iterator<Item = (u64, LinkFault)> + '_ {
        self.plan.waiting()
    }

    /// Arms a fault for the `byte`-th byte transmitted on this link, counted from 1.
    pub(crate) fn arm(&mut self, byte: u64, fault: LinkFault) {
        self.plan.add(byte, fault);
        self.sound = false;
    }

    /// From now on nothing arrives; a byte on the wire is lost.
    pub(crate) fn cut(&mut self, now: Instant) {
        self.cut = true;
        self.sound = false;
        self.lose_after(now);
    }

    /// From now on everything arrives again.
    pub(crate) fn join(&mut self) {
        self.cut = false;
    }

    /// The line is held at 0 from now on.
    pub(crate) fn hold(&mut self, now: Instant, span: Span) {
        self.lose_after(now);
        self.held_until = self.held_until.max(now + span);
        self.sound = false;
        let (bytes, last_arrival) = match &mut self.opening {
            None => (&mut self.bytes, &mut self.last_arrival),
            Some(opening) => (&mut opening.sent, &mut opening.last_arrival),
        };
        let at = (*last_arrival).max(now) + self.byte_time;
        *last_arrival = at;
        let byte = LineByte {
            at,
            sent: None,
            received: Some(0),
            error: Some(LineError::Break),
            solicited: true,
        };
        bytes.insert(UnderWay::pack(byte));
    }

    /// The transmitter loses its power: bytes that it has not finished are never sent.
    pub(crate) fn silence(&mut self, now: Instant) {
        self.lose_after(now);
        self.line_free = self.line_free.min(now);
    }

    fn lose_after(&mut self, now: Instant) {
        // On an open link the bytes under way are not the transmitter's.
        let bytes = match &mut self.opening {
            None => &mut self.bytes,
            Some(opening) => &mut opening.sent,
        };
        for byte in bytes.under_way_mut() {
            if byte.at > now {
                byte.lose();
            }
        }
    }

    /// Puts a byte on the wire as soon as it is free, at `now` at the earliest.
    #[inline]
    pub(crate) fn transmit(&mut self, now: Instant, byte: u8, solicited: bool) {
        let start = now.max(self.line_free);
        let gap = start.since(self.line_free);
        self.line_free = start + self.byte_time;
        self.transmitted += 1;
        let on_wire = UnderWay::whole(self.line_free, byte, solicited);
        if self.sound {
            self.line_up(on_wire);
        } else {
            self.transmit_with_care(gap, on_wire);
        }
    }

    /// The same on a link on which something may happen to the byte.
    #[cold]
    fn transmit_with_care(&mut self, gap: Span, on_wire: UnderWay) {
        let fault = self.plan.take(self.transmitted);
        self.transmit_damaged(fault, gap, on_wire.unpack());
        self.sound = self.plan.waiting().next().is_none()
            && !self.cut
            && self.line_free >= self.held_until
            && self.opening.is_none()
            && self.out_of_step.is_none();
    }

    fn transmit_damaged(&mut self, first: Option<LinkFault>, gap: Span, mut byte: LineByte) {
        let start = self.line_free - self.byte_time;
        // Several faults at one byte act one after the other, in the order of their lines.
        let mut flips = Flips::default();
        let mut copies = 1;
        let mut next = first;
        while let Some(fault) = next {
            match fault {
                LinkFault::Flip(more) => {
                    flips = flips.and(more);
                    byte.received = byte.received.map(|data| data ^ more.data);
                }
                LinkFault::Replace(data) => {
                    flips = Flips::default();
                    byte.received = byte.received.map(|_| data);
                }
                LinkFault::Drop => byte.received = None,
                LinkFault::Duplicate => copies = 2,
                LinkFault::Insert(data) => {
                    let lost = self.cut || start < self.held_until;
                    self.deliver(UnderWay::pack(LineByte {
                        at: byte.at,
                        sent: None,
                        received: (!lost).then_some(data),
                        error: None,
                        solicited: true,
                    }));
                }
                LinkFault::Delay(span) => byte.at += span,
                LinkFault::Break(span) => {
                    self.held_until = self.held_until.max(start + span);
                    byte.received = Some(0);
                    byte.error = Some(LineError::Break);
                }
                LinkFault::Overrun => byte.error = Some(LineError::Overrun),
                LinkFault::Cut => self.cut = true,
                LinkFault::Join => self.cut = false,
            }
            next = self.plan.take(self.transmitted);
        }
        if byte.error == Some(LineError::Break) {
            byte.received = byte.received.map(|_| 0);
        } else {
            if flips.start || self.out_of_step.is_some() {
                self.read_out_of_step(flips, gap, &mut byte);
            } else {
                byte.error = byte.error.or(flips.noticed());
            }
            if start < self.held_until {
                byte.received = None;
            }
        }
        if self.cut {
            byte.received = None;
        }
        if byte.received.is_none() {
            byte.error = None;
            copies = 1;
        }
        self.deliver(UnderWay::pack(byte));
        if copies == 2 {
            self.deliver(UnderWay::pack(LineByte { sent: None, ..byte }));
        }
    }

    /// Lets the receiver read what it takes for a byte, bit by bit, as long as it is out of step. What it has half
    /// read when the line falls silent is read with the next byte.
    fn read_out_of_step(&mut self, flips: Flips, gap: Span, byte: &mut LineByte) {
        let mut receiver = self.out_of_step.take().unwrap_or_else(Uart::idle);
        let bit_time = Span::from_units(self.byte_time.units() / uart::BITS);
        for _ in 0..(gap.units() / bit_time.units()).min(uart::BITS) {
            if let Some(read) = receiver.take(true) {
                self.deliver(UnderWay::pack(LineByte {
                    at: byte.at - self.byte_time,
                    sent: None,
                    received: Some(read.byte),
                    error: read.error,
                    solicited: byte.solicited,
                }));
            }
        }
        // The data bits have been inverted already.
        let word = uart::bits(byte.sent.unwrap_or_default())
            ^ (u16::from(byte.received.unwrap_or_default() ^ byte.sent.unwrap_or_default()) << 1)
            ^ u16::from(flips.start)
            ^ (u16::from(flips.parity) << 9)
            ^ (u16::from(flips.stop) << 10);
        let lost = byte.received.is_none();
        byte.received = None;
        for bit in 0..uart::BITS {
            // Where nothing arrives the line is at rest.
            if let Some(read) = receiver.take(lost || word >> bit & 1 == 1) {
                byte.at = self.line_free - bit_time * (uart::BITS - 1 - bit);
                byte.received = Some(read.byte);
                byte.error = read.error;
            }
        }
        self.out_of_step = (!receiver.in_step()).then_some(receiver);
    }

    /// Sends a byte of the transmitter on its way.
    fn deliver(&mut self, mut byte: UnderWay) {
        match &mut self.opening {
            None => self.line_up(byte),
            Some(opening) => {
                byte.at = byte.at.max(opening.last_arrival + self.byte_time);
                opening.last_arrival = byte.at;
                opening.sent.push(byte);
            }
        }
    }

    /// Queues a byte behind those under way.
    #[inline]
    fn line_up(&mut self, mut byte: UnderWay) {
        byte.at = byte.at.max(self.last_arrival + self.byte_time);
        self.last_arrival = byte.at;
        self.bytes.push(byte);
    }

    /// When the next byte arrives.
    #[inline]
    pub(crate) fn next_arrival(&self) -> Instant {
        self.bytes.next_arrival()
    }

    /// Takes the next byte from the wire.
    #[inline]
    pub(crate) fn take(&mut self) -> Option<LineByte> {
        let byte = self.bytes.take()?;
        self.arrived += 1;
        Some(byte.unpack())
    }

    /// The next byte to arrive.
    #[inline]
    pub(crate) fn peek(&self) -> Option<UnderWay> {
        self.bytes.peek()
    }

    /// Takes the next byte and keeps it, so that it can be [given back](Self::give_back) until [`Self::forget_spent`].
    #[inline]
    pub(crate) fn take_and_keep(&mut self) {
        self.bytes.advance(1);
        self.arrived += 1;
    }

    /// Puts the last bytes that were taken back on the wire.
    pub(crate) fn give_back(&mut self, count: usize) {
        self.bytes.give_back(count);
        self.arrived -= count as u64;
    }

    /// Forgets bytes that were kept.
    pub(crate) fn forget_spent(&mut self) {
        self.bytes.forget_spent();
    }

    pub(crate) const fn is_recording(&self) -> bool {
        self.bytes.is_recording()
    }

    pub(crate) const fn byte_time(&self) -> Span {
        self.byte_time
    }

    /// Whether a byte sent from `now` on arrives, as it was sent.
    pub(crate) fn is_clear(&self, now: Instant) -> bool {
        self.sound && !self.cut && self.held_until <= now
    }

    /// Whether a byte sent from `now` on arrives a byte time later, and none is under way.
    pub(crate) fn is_idle(&self, now: Instant) -> bool {
        self.is_clear(now)
            && self.line_free <= now
            && self.last_arrival <= now
            && self.bytes.under_way().is_empty()
    }

    /// Whether the last byte arrives, or has arrived, at `at`, without a delay.
    pub(crate) fn is_free_from(&self, at: Instant) -> bool {
        self.line_free == at && self.last_arrival == at
    }

    /// Hands over what is under way on a link without a record, and as many bytes before it as are `older`. It counts as if it
    /// had carried none of them. Says how many were under way.
    pub(crate) fn hand_over(&mut self, older: u64) -> u64 {
        let under_way = match self.is_recording() {
            true => 0,
            false => self.bytes.take_under_way().len() as u64,
        };
        self.arrived -= older;
        self.transmitted -= older + under_way;
        under_way
    }

    /// A sound wire without a record, which is free from `line_free` on.
    pub(crate) fn free_from(byte_time: Span, line_free: Instant) -> Self {
        let mut link = Self::new(byte_time);
        link.stop_recording();
        link.line_free = line_free;
        link.last_arrival = line_free;
        link
    }

    /// Takes the bytes under way off a link without a record, until they are [put back](Self::put_under_way).
    pub(crate) fn take_under_way(&mut self) -> Vec<UnderWay> {
        self.bytes.take_under_way()
    }

    /// Puts bytes that were taken off back on the link, which has none.
    pub(crate) fn put_under_way(&mut self, bytes: &[UnderWay]) {
        bytes.iter().for_each(|byte| self.bytes.push(*byte));
    }

    /// The bytes under way, in order of their arrival.
    pub(crate) fn under_way(&self) -> &[UnderWay] {
        self.bytes.under_way()
    }

    /// Takes what arrives up to and including `until`.
    pub(crate) fn take_until(&mut self, until: Instant) -> Vec<UnderWay> {
        let mut taken = Vec::new();
        while let Some(byte) = self.peek().filter(|byte| byte.at <= until) {
            self.take_and_keep();
            taken.push(byte);
        }
        self.forget_arrived();
        taken
    }

    /// Forgets bytes that have arrived, where none is recorded.
    pub(crate) fn forget_arrived(&mut self) {
        if !self.is_recording() {
            self.bytes.forget_arrived();
        }
    }

    /// Whether it is cut open.
    pub(crate) const fn is_open(&self) -> bool {
        self.opening.is_some()
    }

    /// Makes up for bytes that it has carried meanwhile: those of `bytes` that have arrived are recorded, the others are under way.
    /// Of all, `sent` were sent and `arrived` have arrived; the line is free from `line_free` on.
    pub(crate) fn catch_up(
        &mut self,
        bytes: impl Iterator<Item = UnderWay>,
        (sent, arrived): (usize, usize),
        line_free: Option<Instant>,
    ) {
        bytes.for_each(|byte| self.bytes.push(byte));
        if self.is_recording() {
            self.bytes.advance(arrived);
        }
        self.transmitted += sent as u64;
        self.arrived += arrived as u64;
        if let Some(at) = line_free {
            self.line_free = at;
            self.last_arrival = at;
        }
    }
}
