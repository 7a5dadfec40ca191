//! The drive as a station of a segment.

use super::drive::Drive;
use crate::segment::Station;
use harness_proto::can::Frame;
use harness_proto::time::Instant;

impl Station for Drive {
    fn hear(&mut self, at: Instant, frame: &Frame) {
        if self.is_powered() {
            // What it ignores is its own affair.
            let _ = self.receive(at, frame);
        }
    }

    fn wants(&self) -> Option<(Instant, Frame)> {
        Drive::wants(self).map(|waiting| (waiting.ready, waiting.frame))
    }

    fn sent(&mut self, _at: Instant) {
        let _ = Drive::sent(self);
    }

    fn next_action(&self) -> Option<Instant> {
        self.next_scan()
    }

    fn advance(&mut self, to: Instant) {
        Drive::advance(self, to);
    }

    fn acknowledges(&self) -> bool {
        self.is_powered() && self.is_on_bus()
    }
}
