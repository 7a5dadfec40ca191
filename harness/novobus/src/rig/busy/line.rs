//! A ring behind a port of a computer that stands still now and then, in virtual time.
//!
//! It does what the pump of real ports does (`link/pump.rs`): bytes are stamped when they are read, and counted as lost some time after
//! they are due. The drives go on while the computer stands still.

use crate::link::SimulatedLink;
use harness_bench::link::lateness::Lateness;
use harness_bench::link::pump::SLACK;
use harness_bench::link::stamp::stamped;
use harness_bench::link::{
    Capability, InnerLink, Lead, Line, Link, Moment, Octets, PlacedFault, PortLink,
};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::port::{LastWords, Switch};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{self, Duration};

/// When a computer stands still, and for how long.
#[derive(Clone, Debug)]
pub(in super::super) struct Stalls {
    /// State of the generator.
    seed: u64,
    /// One action of this number is late; 0 for none.
    pub(in super::super) one_in: u64,
    /// The longest stall, in microseconds.
    pub(in super::super) longest_us: u64,
    /// How often it has stood still.
    pub(in super::super) count: u64,
}

impl Stalls {
    pub(in super::super) fn new(seed: u64, one_in: u64) -> Self {
        Self {
            seed,
            one_in,
            longest_us: 500_000,
            count: 0,
        }
    }

    /// A number, as SplitMix64 draws it.
    fn draw(&mut self) -> u64 {
        self.seed = self.seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn next(&mut self) -> Option<Span> {
        let due = self.one_in > 0 && self.draw().is_multiple_of(self.one_in);
        due.then(|| {
            self.count += 1;
            Span::from_micros(self.draw() % (self.longest_us + 1))
        })
    }
}

/// A ring behind a port of such a computer.
pub(in super::super) struct BusyLine {
    pub(in super::super) ring: SimulatedLink,
    pub(in super::super) stalls: Stalls,
    capabilities: Vec<Capability>,
    /// When the line is free for the next byte.
    free: Instant,
    /// Bytes sent and received since the ring was last at rest.
    owed: (u64, u64),
    received: VecDeque<(Instant, Received)>,
    last_arrival: Instant,
    looked: Instant,
    /// What is unread has been reported.
    lying: bool,
    late: Lateness,
    clock: time::Instant,
    beats: Arc<AtomicU64>,
}

/// What the port's times are off by, at most, on a quiet computer.
const TOLERANCE: Span = Span::from_millis(20);

impl BusyLine {
    pub(in super::super) fn new(ring: SimulatedLink, stalls: Stalls) -> Self {
        let clock = time::Instant::now();
        Self {
            ring,
            stalls,
            capabilities: vec![
                Capability::Memory,
                Capability::Motion,
                Capability::Eeprom,
                Capability::Reset,
                Capability::LineErrors,
            ],
            free: Instant::START,
            owed: (0, 0),
            received: VecDeque::new(),
            last_arrival: Instant::START,
            looked: Instant::START,
            lying: false,
            late: Lateness::new(clock),
            clock,
            beats: Arc::default(),
        }
    }

    /// The computer may stand still here, and the drives go on.
    fn stand_still(&mut self) {
        self.beats.fetch_add(1, Ordering::Relaxed);
        if let Some(span) = self.stalls.next() {
            let due = self.ring.now();
            let now = due + span;
            self.ring.run_until(now);
            self.late.woken(self.real(due), self.real(now));
        }
    }

    fn real(&self, at: Instant) -> time::Instant {
        self.clock + Duration::from_nanos(at.since_start().as_nanos())
    }

    /// Reads what has come.
    fn collect(&mut self) {
        let told = self.looked;
        self.looked = self.ring.now();
        let mut bytes = Vec::new();
        while let Some((_, octet)) = self.ring.receive_octet(0) {
            bytes.push(octet);
        }
        if !bytes.is_empty() {
            self.last_arrival = self.last_arrival.max(told);
        }
        self.owed.1 += bytes.len() as u64;
        let byte_time = self.ring.byte_time();
        let stamped = stamped(bytes, self.looked, byte_time, &mut self.last_arrival);
        self.received.extend(stamped);
    }

    /// How long a byte may take to come back.
    fn round(&self) -> Span {
        let drives = u64::from(self.ring.drives(0));
        let late = self.late.at(self.real(self.looked));
        self.ring.byte_time() * (2 * drives + 4) + SLACK.max(TOLERANCE) + late
    }
}

impl Line for BusyLine {
    fn medium(&self, port: usize) -> Medium {
        self.ring.medium(port)
    }

    fn now(&self) -> Instant {
        self.ring.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.stand_still();
        let now = self.ring.now();
        if !self.busy() {
            self.owed = (0, 0);
        }
        let octets = what.octets();
        self.free = self.free.max(now) + self.ring.byte_time() * octets.len() as u64;
        self.owed.0 += octets.len() as u64;
        // Between looking at the clock and handing the bytes over, and behind it.
        self.stand_still();
        self.ring.send_octets(ring, octets);
        self.stand_still();
        self.free
    }

    fn receive(&mut self, _: usize) -> Option<(Instant, HeardPiece)> {
        self.lying = false;
        let (at, octet) = self.received.pop_front()?;
        Some((at, HeardPiece::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.stand_still();
        let unread = self.received.len();
        if self.lying || unread == 0 {
            let lost = self.free + self.round();
            let until = match self.owed.0 > self.owed.1 && lost > self.looked {
                true => until.min(lost),
                false => until,
            };
            // Looking takes time too.
            let until = until.max(self.ring.now() + Span::from_micros(1));
            while self.ring.now() < until && self.received.len() == unread {
                if !self.ring.wait(until) {
                    self.ring.run_until(until);
                }
                self.collect();
            }
        }
        self.lying = !self.received.is_empty();
        true
    }

    fn lead(&self) -> Lead {
        let late = self.late.at(self.real(self.looked));
        let far = Span::from_millis(16);
        Lead {
            far,
            near: late.saturating_sub(harness_bench::link::HARMLESS).min(far),
        }
    }
}

impl Link for BusyLine {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.stand_still();
        self.collect();
        let now = self.ring.now();
        self.clock = self.real(now);
        self.ring.begin();
        self.received.clear();
        self.lying = false;
        self.free = Instant::START + self.free.since(now);
        self.owed = (0, 0);
        (self.last_arrival, self.looked) = (Instant::START, Instant::START);
    }

    fn busy(&self) -> bool {
        let now = self.ring.now();
        now < self.free || self.owed.0 != self.owed.1 && self.looked < self.free + self.round()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.ring.inject(ring, fault, moment);
    }

    fn reaches(&self, _: usize, link: usize) -> bool {
        link == 0 || link == usize::from(self.ring.drives(0))
    }

    fn listens(&self, ring: usize, link: usize) -> bool {
        self.reaches(ring, link)
    }

    fn time_tolerance(&self) -> Span {
        TOLERANCE
    }

    fn unused_faults(&self) -> Vec<String> {
        self.ring.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.ring.carried()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.ring.drives(ring)
    }

    fn trace(&self, ring: usize) -> Trace {
        self.ring.trace(ring)
    }
}

impl PortLink for BusyLine {
    fn beats(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.beats)
    }

    fn last_words(&self) -> std::io::Result<Vec<LastWords>> {
        Ok(Vec::new())
    }

    fn resume(&mut self) {}

    fn take_unplaced(&mut self) -> u64 {
        0
    }

    fn take_switches(&mut self) -> Vec<Switch> {
        Vec::new()
    }

    fn inner_links(&self) -> &[InnerLink] {
        &[]
    }
}
