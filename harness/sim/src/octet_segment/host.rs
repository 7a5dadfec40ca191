//! A station without a protocol.

use super::{LineStation, Octet, Wish};
use crate::participant::Participant;
use harness_proto::line::Received;
use harness_proto::time::Instant;
use std::collections::VecDeque;

/// A station that sends what it is given and keeps what it hears: a bench, a client, a tap.
#[derive(Clone, Debug, Default)]
pub struct LineHost {
    queue: VecDeque<(Wish, Vec<Octet>)>,
    heard: VecDeque<(Instant, Received)>,
    /// Ends of own telegrams.
    sent: VecDeque<Instant>,
}

impl LineHost {
    /// Puts a telegram after the others, to be sent as `wish` says.
    pub fn send(&mut self, wish: Wish, octets: Vec<Octet>) {
        self.queue.push_back((wish, octets));
    }

    /// The next octet that it has heard, and when its last stop bit had passed.
    pub fn receive(&mut self) -> Option<(Instant, Received)> {
        self.heard.pop_front()
    }

    /// When the oldest octet that it has heard had ended.
    #[must_use]
    pub fn heard_at(&self) -> Option<Instant> {
        self.heard.front().map(|(at, _)| *at)
    }

    /// When its next telegram that was sent had ended.
    pub fn confirmation(&mut self) -> Option<Instant> {
        self.sent.pop_front()
    }

    /// Forgets what it has heard.
    pub fn forget(&mut self) {
        self.heard.clear();
        self.sent.clear();
    }

    /// Telegrams that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }
}

impl LineStation for LineHost {
    fn hear(&mut self, at: Instant, octet: Received) {
        self.heard.push_back((at, octet));
    }

    fn wants(&self) -> Option<Wish> {
        self.queue.front().map(|(wish, _)| *wish)
    }

    fn begin(&mut self, _at: Instant, into: &mut Vec<Octet>) {
        if let Some((_, octets)) = self.queue.pop_front() {
            into.extend(octets);
        }
    }

    fn sent(&mut self, at: Instant) {
        self.sent.push_back(at);
    }

    fn next_action(&self) -> Option<Instant> {
        None
    }

    fn advance(&mut self, _to: Instant) {}
}

impl<D: LineStation> Participant<LineHost, D> {
    fn station(&self) -> &dyn LineStation {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }

    fn station_mut(&mut self) -> &mut dyn LineStation {
        match self {
            Self::Host(host) => host,
            Self::Drive(drive) => drive,
        }
    }
}

impl<D: LineStation> LineStation for Participant<LineHost, D> {
    fn hear(&mut self, at: Instant, octet: Received) {
        self.station_mut().hear(at, octet);
    }
    fn wants(&self) -> Option<Wish> {
        self.station().wants()
    }
    fn begin(&mut self, at: Instant, into: &mut Vec<Octet>) {
        self.station_mut().begin(at, into);
    }
    fn sent(&mut self, at: Instant) {
        self.station_mut().sent(at);
    }
    fn next_action(&self) -> Option<Instant> {
        self.station().next_action()
    }
    fn advance(&mut self, to: Instant) {
        self.station_mut().advance(to);
    }
}
