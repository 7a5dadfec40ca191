//! The calls of a line whose medium is octets.

use super::Line;
use crate::medium::Out;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};

/// A [`Line`] in octets, for the buses whose medium they are.
pub trait Octets: Line {
    /// How long a byte takes; all ports of a line have the same rate.
    fn byte_time(&self) -> Span {
        self.medium(0).octet_time()
    }

    /// [Sends](Line::send) octets.
    fn send_octets(&mut self, port: usize, octets: &[u8]) -> Instant {
        self.send(port, Out::Octets(octets))
    }

    /// [Takes](Line::receive) the next received octet.
    fn receive_octet(&mut self, port: usize) -> Option<(Instant, Received)> {
        std::iter::from_fn(|| self.receive(port)).find_map(|(at, heard)| Some((at, heard.octet()?)))
    }
}

impl<L: Line + ?Sized> Octets for L {}
