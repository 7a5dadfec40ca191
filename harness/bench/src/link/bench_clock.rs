//! The clock of a simulated bench: its time, where the conversation began, and the faults that wait for their time.

use super::PlacedFault;
use harness_proto::time::Instant;
use std::collections::VecDeque;

/// Times are those of the bench, which are never set back, unless they are said to count from the conversation's begin.
#[derive(Clone, Debug)]
pub struct BenchClock {
    pub now: Instant,
    /// When the last piece that the bench has sent will have left, as far as it knows.
    pub left: Instant,
    /// When the conversation began.
    origin: Instant,
    scheduled: VecDeque<(Instant, PlacedFault)>,
}

impl Default for BenchClock {
    fn default() -> Self {
        Self {
            now: Instant::START,
            left: Instant::START,
            origin: Instant::START,
            scheduled: VecDeque::new(),
        }
    }
}

impl BenchClock {
    /// Begins a conversation: faults that have not happened are dropped.
    pub fn begin(&mut self) {
        self.origin = self.now;
        self.left = self.now;
        self.scheduled.clear();
    }

    /// When the conversation began.
    pub const fn origin(&self) -> Instant {
        self.origin
    }

    /// A time counted from the begin of the conversation.
    pub fn since_origin(&self, at: Instant) -> Instant {
        Instant::START + at.since(self.origin)
    }

    /// The inverse of [`Self::since_origin`].
    pub fn on_bench(&self, at: Instant) -> Instant {
        match at {
            Instant::NEVER => at,
            at => self.origin + at.since_start(),
        }
    }

    /// Keeps a fault for a time since the start of the conversation. Returns the fault if that time has already come.
    pub fn schedule(&mut self, at: Instant, fault: PlacedFault) -> Option<PlacedFault> {
        let at = self.on_bench(at);
        if at <= self.now {
            return Some(fault);
        }
        let place = self.scheduled.partition_point(|(other, _)| *other <= at);
        self.scheduled.insert(place, (at, fault));
        None
    }

    /// When the next fault happens.
    pub fn next_fault(&self) -> Option<Instant> {
        self.scheduled.front().map(|(at, _)| *at)
    }

    /// Takes the next fault whose time has come.
    pub fn due(&mut self) -> Option<PlacedFault> {
        self.next_fault().filter(|at| *at <= self.now)?;
        self.scheduled.pop_front().map(|(_, fault)| fault)
    }

    /// The faults that have not happened, each with its time from the begin of the conversation.
    pub fn left_over(&self) -> impl Iterator<Item = (Instant, PlacedFault)> {
        let all = self.scheduled.iter();
        all.map(|(at, fault)| (self.since_origin(*at), *fault))
    }
}
