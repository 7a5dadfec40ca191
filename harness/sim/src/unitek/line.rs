//! The segment with the drives that the bench simulates.
//!
//! The calls do what those of [`Segment`] do. They are compiled with this crate, which is optimised, and not with the bench, which is not:
//! most of the time of a simulated conversation passes in them.

use super::deviation::Deviant;
use super::{Drive, Member};
use crate::segment::Segment;
use harness_proto::time::Instant;

impl Segment<Member<Box<Deviant>>> {
    /// [`Segment::run_until`].
    #[inline(never)]
    pub fn run_to(&mut self, to: Instant) {
        self.run_until(to);
    }

    /// [`Segment::next_event`].
    #[inline(never)]
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.next_event()
    }
}

impl Segment<Member<Box<Drive>>> {
    /// [`Segment::run_until`].
    #[inline(never)]
    pub fn run_to(&mut self, to: Instant) {
        self.run_until(to);
    }

    /// [`Segment::next_event`].
    #[inline(never)]
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.next_event()
    }
}
