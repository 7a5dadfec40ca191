//! Rings over streams of bytes: real ones, or simulated ones in another process.
//!
//! The pump (`link/pump.rs`) moves the bytes. This file knows what a ring is: each byte that is sent comes back (ND21 8.2), and the
//! master has the first and the last of its links.

use harness_bench::link::inner::InnerLink;
use harness_bench::link::port_end::Accounting;
use harness_bench::link::pump::{Pump, Spot};
use harness_bench::link::{
    Capability, Lead, Line, Link, Moment, PlacedFault, PortLink, Trouble, link_name,
};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::port::{LastWords, Switch, Wire};
use harness_proto::line::{Rate, Received};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, Trace};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};

/// Default time tolerance of a rig.
pub(crate) const TOLERANCE: Span = Span::from_millis(5);

/// The bytes under way in a ring: each comes back when it has passed all drives.
#[derive(Debug)]
struct RoundTrip {
    drives: u8,
    /// Bytes sent and received since the ring was last at rest.
    sent: u64,
    came: u64,
}

impl RoundTrip {
    const fn new(drives: u8) -> Self {
        Self {
            drives,
            sent: 0,
            came: 0,
        }
    }
}

impl Accounting for RoundTrip {
    fn rest(&mut self) {
        (self.sent, self.came) = (0, 0);
    }

    fn sent(&mut self, _octet: u8) {
        self.sent += 1;
    }

    fn came(&mut self, _octet: Received) {
        self.came += 1;
    }

    fn returns(&self, octet_time: Span) -> Option<Span> {
        Some(self.soonest(octet_time))
    }

    fn is_owed(&self) -> bool {
        self.sent > self.came
    }

    /// After a time-out drives send zeros without end (ND21 9.9). Bytes that an interposer has dropped do not come back; bytes that it
    /// has inserted do.
    fn is_even(&self, taken: u64, given: u64) -> bool {
        self.came + taken == self.sent + given
    }

    /// Each drive takes a byte time (ND21 8.2).
    fn soonest(&self, octet_time: Span) -> Span {
        octet_time * u64::from(self.drives)
    }

    fn latest(&self, octet_time: Span) -> Span {
        octet_time * (2 * u64::from(self.drives) + 4)
    }
}

/// One or two rings over streams.
#[derive(Debug)]
pub(crate) struct StreamLink {
    pump: Pump<RoundTrip>,
    rate: Rate,
    capabilities: Vec<Capability>,
}

impl StreamLink {
    /// Creates a link over one wire per ring, each with its number of drives; there are one or two rings. When `interrupt` is set, the
    /// link stops sending with [`Trouble::Interrupted`].
    #[must_use]
    pub(crate) fn new(
        wires: Vec<(Wire, u8)>,
        inner: Vec<InnerLink>,
        rate: Rate,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        let mut capabilities = vec![
            Capability::Memory,
            Capability::Motion,
            Capability::Eeprom,
            Capability::Reset,
        ];
        if wires.len() > 1 {
            capabilities.push(Capability::TwoRings);
        }
        if inner.iter().any(InnerLink::passes) {
            capabilities.push(Capability::Interposer);
        }
        if !inner.is_empty() {
            capabilities.push(Capability::Tap);
        }
        let wires = wires.into_iter();
        let wires = wires.map(|(wire, drives)| (wire, RoundTrip::new(drives)));
        let mut pump = Pump::new(wires, inner, rate.byte_time(), interrupt);
        pump.tolerance = TOLERANCE;
        if pump.has_line_errors() {
            capabilities.push(Capability::LineErrors);
        }
        Self {
            pump,
            rate,
            capabilities,
        }
    }

    pub(crate) fn set_time_tolerance(&mut self, tolerance: Span) {
        self.pump.tolerance = tolerance;
    }

    /// Where a fault on a link of a ring is put; `None` where the bench has no port.
    fn spot(&self, ring: usize, link: usize) -> Option<Spot> {
        let mut links = self.pump.inner.iter();
        let here = |inner: &InnerLink| inner.passes() && (inner.ring, inner.place) == (ring, link);
        if let Some(place) = links.position(here) {
            return Some(Spot::Inner(place));
        }
        let drives = self.pump.ports.get(ring)?.accounting.drives;
        match link {
            0 => Some(Spot::Out(ring)),
            link if link == usize::from(drives) => Some(Spot::In(ring)),
            _ => None,
        }
    }
}

impl Line for StreamLink {
    fn medium(&self, _port: usize) -> Medium {
        self.rate.into()
    }

    fn now(&self) -> Instant {
        self.pump.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.pump.send(ring, what.octets())
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        let (at, octet) = self.pump.receive(ring)?;
        Some((at, HeardPiece::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.pump.wait(until)
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        self.pump.attend(ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.pump.trouble.as_ref()
    }

    fn lead(&self) -> Lead {
        self.pump.lead()
    }
}

impl PortLink for StreamLink {
    fn beats(&self) -> Arc<AtomicU64> {
        self.pump.beats()
    }

    fn last_words(&self) -> std::io::Result<Vec<LastWords>> {
        self.pump
            .last_words(|pieces| vec![pieces.as_out().octets().to_vec()])
    }

    fn resume(&mut self) {
        self.pump.resume();
    }

    fn take_unplaced(&mut self) -> u64 {
        self.pump.take_unplaced()
    }

    fn take_switches(&mut self) -> Vec<Switch> {
        self.pump.take_switches()
    }

    fn switches_parity(&self, port: usize) -> Option<bool> {
        let wire = &self.pump.ports.get(port)?.wire;
        wire.is_uart().then(|| wire.abilities().sends_wrong_parity)
    }

    fn port_name(&self, port: usize) -> &str {
        let port = self.pump.ports.get(port);
        port.map_or("the port", |port| port.wire.name())
    }

    fn inner_links(&self) -> &[InnerLink] {
        &self.pump.inner
    }
}

impl Link for StreamLink {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.pump.begin();
    }

    fn busy(&self) -> bool {
        self.pump.busy()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        // Planning and the capabilities of the rig exclude faults at other places.
        if let PlacedFault::Link(link, fault) = fault
            && let Some(spot) = self.spot(ring, link)
        {
            self.pump.inject(spot, fault, moment);
        }
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        self.spot(ring, link).is_some()
    }

    fn damages_parity(&self, ring: usize, link: usize) -> bool {
        let mut links = self.pump.inner.iter();
        !links.any(|inner| (inner.ring, inner.place) == (ring, link) && inner.shares_parity())
    }

    fn listens(&self, ring: usize, link: usize) -> bool {
        let mut links = self.pump.inner.iter();
        links.any(|inner| (inner.ring, inner.place) == (ring, link)) || self.reaches(ring, link)
    }

    fn time_tolerance(&self) -> Span {
        self.pump.tolerance
    }

    fn unwatched_since(&self) -> Option<Instant> {
        Some(self.pump.since)
    }

    fn unused_faults(&self) -> Vec<String> {
        let mut unused = Vec::new();
        for (index, ring) in self.pump.ports.iter().enumerate() {
            let ends = [
                (0, &ring.outgoing),
                (ring.accounting.drives, &ring.incoming),
            ];
            for (place, tamper) in ends {
                let place = link_name(index, ring.accounting.drives, usize::from(place));
                let faults = tamper.unused();
                unused.extend(faults.map(|(byte, fault)| format!("{place} byte {byte}: {fault}")));
            }
        }
        for inner in &self.pump.inner {
            let place = link_name(inner.ring, self.drives(inner.ring), inner.place);
            let faults = inner.tamper.unused();
            unused.extend(faults.map(|(byte, fault)| format!("{place} byte {byte}: {fault}")));
        }
        unused
    }

    fn record(&mut self, _on: bool) {
        self.pump.forget_record();
    }

    fn carried(&self) -> u64 {
        let rings: u64 = self.pump.ports.iter().map(|ring| ring.carried).sum();
        rings
            + self
                .pump
                .inner
                .iter()
                .map(|inner| inner.carried)
                .sum::<u64>()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.pump
            .ports
            .get(ring)
            .map_or(0, |ring| ring.accounting.drives)
    }

    fn trace(&self, ring: usize) -> Trace {
        let index = ring;
        let Some(ring) = self.pump.ports.get(ring) else {
            return Trace::default();
        };
        let last = usize::from(ring.accounting.drives);
        let octets = |place: usize| match place {
            0 => ring.log[0].clone(),
            place if place == last => ring.log[1].clone(),
            place => {
                let at = |inner: &&InnerLink| (inner.ring, inner.place) == (index, place);
                let inner = self.pump.inner.iter().find(at);
                inner.map(|inner| inner.log.clone()).unwrap_or_default()
            }
        };
        let channel = |place: usize| {
            let ends = (drive_before(place, last), drive_before(place + 1, last));
            Channel::of_octets(ends.0, ends.1, octets(place))
        };
        Trace {
            channels: (0..=last).map(channel).collect(),
            ..Trace::empty(ring.accounting.drives)
        }
    }
}

/// The drive in front of the `place`-th link of a ring of `drives`; `None` for the master.
fn drive_before(place: usize, drives: usize) -> Option<u8> {
    match place {
        0 => None,
        place => drives
            .checked_sub(place)
            .and_then(|drive| u8::try_from(drive).ok()),
    }
}

#[cfg(test)]
#[path = "stream_tests.rs"]
mod tests;
