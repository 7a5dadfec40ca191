//! A segment of inverters over a stream of octets: a serial adapter, a pseudo terminal or a socket.
//!
//! The pump (`link/pump.rs`) moves the octets. This file knows what such a line is: a telegram has idle time in front of it (T_SYN), one reply comes
//! to a request or none, and what is received is the reply of the station that was asked last.

use harness_bench::link::echo::Echo;
use harness_bench::link::port_end::{Accounting, MOST_RECORDED};
use harness_bench::link::pump::{Pump, SLACK};
use harness_bench::link::{
    Capability, InnerLink, Lead, Line, Link, Moment, PlacedFault, PortLink, Trouble,
};
use harness_bench::medium::{HeardPiece, Medium, Out, Pieces};
use harness_bench::port::{LastWords, Switch, Wire};
use harness_bench::rig::playing::ON_PORT;
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::profibus::fdl::{BROADCAST, LAST_ADDRESS};
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::profibus::{Buffer, BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte, Trace};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::time;

/// How exact times are behind an adapter.
pub(crate) const TOLERANCE: Span = SLACK;

/// Octets of the longest reply of an inverter: a Data_Exchange with PPO2.
const LONGEST_REPLY: u64 = 29;

/// How long the line is left alone before each telegram that a watchdog sends: the one before and its reply have passed, at 9600 bit/s too.
const LAST_WORDS_GAP: time::Duration = time::Duration::from_millis(100);

/// The request that is under way, and its reply.
#[derive(Debug)]
struct RequestAndReply {
    rate: BusRate,
    /// How long a reply may take beside what the standard grants it.
    patience: Span,
    request: Buffer,
    reply: Buffer,
    /// A reply may come.
    owed: bool,
}

impl Accounting for RequestAndReply {
    fn rest(&mut self) {
        self.request.clear();
        self.reply.clear();
        self.owed = false;
    }

    fn sent(&mut self, octet: u8) {
        if !self.reply.is_empty() || !self.owed {
            self.request.clear();
            self.reply.clear();
        }
        self.owed = true;
        let _too_long = self.request.push(octet);
        if let Decoded::Value { value, .. } = Telegram::decode(&self.request) {
            let replies = |pdu: &harness_proto::profibus::Pdu| {
                let function = pdu.fc().function();
                let sends_only = function.is_some_and(|function| function.is_sdn());
                pdu.da() != BROADCAST && !sends_only && pdu.fc().is_request()
            };
            self.owed = value.pdu().is_some_and(replies);
            self.request.clear();
        }
    }

    fn came(&mut self, octet: Received) {
        let _too_long = self.reply.push(octet.byte);
        if matches!(Telegram::decode(&self.reply), Decoded::Value { .. }) {
            self.owed = false;
        }
    }

    fn idle(&self) -> Span {
        self.rate.bit_time() * SYN_BITS
    }

    fn is_owed(&self) -> bool {
        self.owed
    }

    fn is_even(&self, _taken: u64, _given: u64) -> bool {
        !self.owed
    }

    fn soonest(&self, _octet_time: Span) -> Span {
        self.rate.bit_time() * self.rate.max_tsdr_bits()
    }

    fn latest(&self, octet_time: Span) -> Span {
        self.soonest(octet_time) + octet_time * LONGEST_REPLY + self.patience
    }
}

/// A segment over a stream.
#[derive(Debug)]
pub(crate) struct SegmentLink {
    pump: Pump<RequestAndReply>,
    rate: BusRate,
    slaves: Vec<u8>,
    /// Which station was asked from when on.
    asked: Vec<(Instant, u8)>,
    /// Octets of the bench that are no telegram yet.
    begun: Buffer,
}

impl SegmentLink {
    /// A segment over an open wire, with these slaves. `echo`: the adapter gives back what the bench sends. When `interrupt` is set, it stops
    /// sending with [`Trouble::Interrupted`].
    pub(crate) fn new(
        wire: Wire,
        rate: BusRate,
        slaves: Vec<u8>,
        patience: Span,
        echo: bool,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        let accounting = RequestAndReply {
            rate,
            patience,
            request: Buffer::new(),
            reply: Buffer::new(),
            owed: false,
        };
        let octet_time = rate.octet_time();
        let mut pump = Pump::new([(wire, accounting)], Vec::new(), octet_time, interrupt);
        pump.tolerance = TOLERANCE;
        for port in &mut pump.ports {
            port.echo = echo.then(Echo::default);
        }
        Self {
            pump,
            rate,
            slaves,
            asked: Vec::new(),
            begun: Buffer::new(),
        }
    }

    /// Takes notice of the station that a telegram asks.
    fn note(&mut self, now: Instant, octets: &[u8]) {
        if !self.begun.extend(octets) {
            self.begun.clear();
            let _fits = self.begun.extend(octets);
        }
        let telegram = match Telegram::decode(&self.begun) {
            Decoded::NeedMore => return,
            other => other.value(),
        };
        self.begun.clear();
        let asked = telegram.and_then(|telegram| telegram.pdu().map(|pdu| pdu.da()));
        if let Some(asked) = asked.filter(|address| *address <= LAST_ADDRESS)
            && self.asked.last().is_none_or(|(_, last)| *last != asked)
            && self.asked.len() < MOST_RECORDED
        {
            self.asked.push((now, asked));
        }
    }

    /// The station that an octet is the reply of.
    fn sender(&self, at: Instant) -> Option<u8> {
        let before = self.asked.partition_point(|(since, _)| *since <= at);
        let asked = self.asked.get(before.checked_sub(1)?)?;
        Some(asked.1)
    }
}

/// The telegrams of which octets consist.
pub(super) fn telegrams(pieces: &Pieces) -> Vec<Vec<u8>> {
    let mut rest = pieces.as_out().octets();
    let mut all = Vec::new();
    while let Decoded::Value { used, .. } = Telegram::decode(rest) {
        let (telegram, behind) = rest.split_at(used);
        all.push(telegram.to_vec());
        rest = behind;
    }
    all
}

impl Line for SegmentLink {
    fn medium(&self, _port: usize) -> Medium {
        Medium::Octets(self.rate.format())
    }

    fn now(&self) -> Instant {
        self.pump.now()
    }

    /// Sends one telegram: idle time in front of it (T_SYN), and no gap in it.
    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let now = self.pump.now();
        self.note(now, what.octets());
        self.pump.send(port, what.octets())
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        let (at, octet) = self.pump.receive(port)?;
        Some((at, HeardPiece::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.pump.wait(until)
    }

    fn attend(&mut self, port: usize, at: Instant) {
        self.pump.attend(port, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.pump.trouble.as_ref()
    }

    fn lead(&self) -> Lead {
        self.pump.lead()
    }
}

impl PortLink for SegmentLink {
    fn beats(&self) -> Arc<AtomicU64> {
        self.pump.beats()
    }

    /// One telegram after the other, each with its idle time.
    fn last_words(&self) -> std::io::Result<Vec<LastWords>> {
        let ports = self.pump.last_words(telegrams)?;
        let apart = ports.into_iter().map(|words| words.after(LAST_WORDS_GAP));
        Ok(apart.collect())
    }

    fn resume(&mut self) {
        self.pump.resume();
    }

    fn take_unplaced(&mut self) -> u64 {
        self.pump.take_unplaced()
    }

    fn has_unproven_rate(&self, port: usize) -> bool {
        let port_pump = self.pump.ports.get(port);
        port_pump.is_some_and(|port| port.wire.has_unproven_rate())
    }

    fn take_switches(&mut self) -> Vec<Switch> {
        self.pump.take_switches()
    }

    fn inner_links(&self) -> &[InnerLink] {
        &[]
    }
}

impl Link for SegmentLink {
    fn capabilities(&self) -> &[Capability] {
        &ON_PORT
    }

    fn begin(&mut self) {
        self.pump.begin();
        // Octets that still come are those of the station that was asked last.
        let last = self.asked.last().map(|(_, asked)| (Instant::START, *asked));
        self.asked = last.into_iter().collect();
    }

    fn busy(&self) -> bool {
        self.pump.busy()
    }

    /// A real line has no faults that can be made.
    fn inject(&mut self, _port: usize, _fault: PlacedFault, _moment: Moment) {}

    fn listens(&self, _ring: usize, _link: usize) -> bool {
        true
    }

    fn time_tolerance(&self) -> Span {
        TOLERANCE
    }

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn record(&mut self, _on: bool) {
        self.pump.forget_record();
        // Who is asked now sends what still comes.
        let last = self.asked.pop();
        self.asked.clear();
        self.asked.extend(last);
    }

    fn carried(&self) -> u64 {
        self.pump.ports.iter().map(|port| port.carried).sum()
    }

    fn drives(&self, _port: usize) -> u8 {
        u8::try_from(self.slaves.len()).unwrap_or(u8::MAX)
    }

    fn trace(&self, port: usize) -> Trace {
        let Some(port_pump) = self.pump.ports.get(port) else {
            return Trace::default();
        };
        let [sent, came] = &port_pump.log;
        let from = |slave: u8| -> Vec<LineByte> {
            let first = self.slaves.first().copied();
            let of = |octet: &&LineByte| {
                let sender = self
                    .sender(octet.at)
                    .filter(|slave| self.slaves.contains(slave));
                sender.or(first) == Some(slave)
            };
            came.iter().filter(of).copied().collect()
        };
        let master = Channel::of_octets(None, None, sent.clone());
        let slaves = self.slaves.iter();
        let slaves = slaves.map(|slave| Channel::of_octets(Some(*slave), None, from(*slave)));
        Trace {
            channels: std::iter::once(master).chain(slaves).collect(),
            ..Trace::empty(self.drives(port))
        }
    }
}
