//! One or two rings on one clock (ND21 8.2: drives can be distributed to several loops; 11.4: the
//! driver works with one or two).

use crate::novobus::drive::Drive;
use crate::novobus::ring::Ring;
use harness_proto::time::Instant;

/// One or two rings. The drive type is an enum of all models and not a type parameter, so that the code that advances time is compiled
/// and optimised with this crate and not with its users.
#[derive(Clone, Debug, Default)]
pub struct Bench {
    rings: Vec<Ring<Drive>>,
}

impl Bench {
    /// A bench with one ring.
    #[must_use]
    pub fn one(ring: Ring<Drive>) -> Self {
        Self { rings: vec![ring] }
    }

    /// A bench with two rings.
    #[must_use]
    pub fn two(first: Ring<Drive>, second: Ring<Drive>) -> Self {
        Self {
            rings: vec![first, second],
        }
    }

    /// The rings, one or two.
    #[must_use]
    pub fn rings(&self) -> &[Ring<Drive>] {
        &self.rings
    }

    /// Ring `index`, counted from 0.
    pub fn ring_mut(&mut self, index: usize) -> Option<&mut Ring<Drive>> {
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
