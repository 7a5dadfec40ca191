//! One or two rings on one clock (ND21 8.2: drives can be distributed to several loops; 11.4: the
//! driver works with one or two).

use crate::device::Device;
use crate::ring::Ring;
use harness_proto::time::Instant;

/// One or two rings.
#[derive(Clone, Debug)]
pub struct Bench<D> {
    rings: Vec<Ring<D>>,
}

impl<D> Default for Bench<D> {
    /// A bench without a ring.
    fn default() -> Self {
        Self { rings: Vec::new() }
    }
}

impl<D: Device> Bench<D> {
    /// A bench with one ring.
    #[must_use]
    pub fn one(ring: Ring<D>) -> Self {
        Self { rings: vec![ring] }
    }

    /// A bench with two rings.
    #[must_use]
    pub fn two(first: Ring<D>, second: Ring<D>) -> Self {
        Self {
            rings: vec![first, second],
        }
    }

    /// The rings, one or two.
    #[must_use]
    pub fn rings(&self) -> &[Ring<D>] {
        &self.rings
    }

    /// Ring `index`, counted from 0.
    pub fn ring_mut(&mut self, index: usize) -> Option<&mut Ring<D>> {
        self.rings.get_mut(index)
    }

    /// The time up to which everything has happened.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.rings
            .iter()
            .map(Ring::now)
            .fold(Instant::START, Instant::max)
    }

    /// Whether something is still under way that goes back to a byte of the master's.
    #[must_use]
    pub fn busy(&self) -> bool {
        self.rings.iter().any(Ring::busy)
    }

    /// When something happens next in any ring.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        self.rings.iter().filter_map(Ring::next_event).min()
    }

    /// Lets everything happen in every ring up to and including `until`.
    pub fn run_until(&mut self, until: Instant) {
        for ring in &mut self.rings {
            ring.run_until(until);
        }
    }
}
