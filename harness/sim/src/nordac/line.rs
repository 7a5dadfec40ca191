//! The line with the inverters that the bench simulates.
//!
//! The calls do what those of [`OctetSegment`] do. They are compiled with this crate, which is optimised, and not with the bench, which is not:
//! most of the time of a simulated conversation passes in them.

use super::deviation::Deviant;
use super::{Drive, Member};
use crate::octet_segment::OctetSegment;
use harness_proto::time::Instant;

impl OctetSegment<Member<Box<Deviant>>> {
    /// [`OctetSegment::run_until`].
    #[inline(never)]
    pub fn run_to(&mut self, to: Instant) {
        self.run_until(to);
    }

    /// [`OctetSegment::next_event`].
    #[inline(never)]
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.next_event()
    }
}

impl OctetSegment<Member<Drive>> {
    /// [`OctetSegment::run_until`].
    #[inline(never)]
    pub fn run_to(&mut self, to: Instant) {
        self.run_until(to);
    }
}
