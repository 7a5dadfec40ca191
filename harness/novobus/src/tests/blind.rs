//! A link of which only the bytes at the master can be seen.

use harness_bench::link::{Capability, Line, Link, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::line::Received;
use harness_proto::time::Instant;
use harness_sim::record::Trace;

/// A link that shows nothing of its drives: a ring of which only the master's ends are known.
pub(crate) struct Blind<L>(pub(crate) L);

impl<L: Link> Line for Blind<L> {
    fn medium(&self, port: usize) -> Medium {
        self.0.medium(port)
    }
    fn now(&self) -> Instant {
        self.0.now()
    }
    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.0.send(ring, what)
    }
    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        self.0.receive(ring)
    }
    fn wait(&mut self, until: Instant) -> bool {
        self.0.wait(until)
    }
}

impl<L: Link> Link for Blind<L> {
    fn capabilities(&self) -> &[Capability] {
        self.0.capabilities()
    }
    // Nothing is skipped for want of a tap, and no tap shows anything.
    fn listens(&self, _ring: usize, _link: usize) -> bool {
        true
    }
    fn tapped(&mut self, _ring: usize, _link: usize) -> Option<Vec<Received>> {
        None
    }
    fn begin(&mut self) {
        self.0.begin();
    }
    fn busy(&self) -> bool {
        self.0.busy()
    }
    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.0.inject(ring, fault, moment);
    }
    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        self.0.probe(ring, octets)
    }
    fn unused_faults(&self) -> Vec<String> {
        self.0.unused_faults()
    }
    fn carried(&self) -> u64 {
        self.0.carried()
    }
    fn drives(&self, ring: usize) -> u8 {
        self.0.drives(ring)
    }
    fn trace(&self, ring: usize) -> Trace {
        self.0.trace(ring)
    }
}
