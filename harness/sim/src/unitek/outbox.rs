//! Frames that wait in a drive until the bus is free.

use harness_proto::can::Frame;
use harness_proto::time::Instant;
use std::collections::VecDeque;

/// Most frames that wait; further ones are lost. A bus that is free for a drive now and then never has as many.
const MOST: usize = 64;

/// What a frame is sent for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// A request for one reply.
    Asked,
    /// A cycle of this register.
    Cycle(u8),
    /// A change of STATUS.
    Event,
}

/// A frame that waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Waiting {
    /// From when on it can be sent.
    pub ready: Instant,
    /// Why.
    pub cause: Cause,
    /// The frame.
    pub frame: Frame,
}

/// The frames in the order in which they are sent.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outbox {
    frames: VecDeque<Waiting>,
    lost: u64,
}

impl Outbox {
    /// Puts a frame behind all that are ready no later. A cyclic frame that still waits is replaced by its successor.
    pub fn put(&mut self, waiting: Waiting) {
        let successor = |old: &&mut Waiting| {
            matches!(waiting.cause, Cause::Cycle(_)) && old.cause == waiting.cause
        };
        if let Some(old) = self.frames.iter_mut().find(successor) {
            old.frame = waiting.frame;
            return;
        }
        if self.frames.len() == MOST {
            self.lost += 1;
            return;
        }
        let place = self
            .frames
            .partition_point(|old| old.ready <= waiting.ready);
        self.frames.insert(place, waiting);
    }

    /// The next frame.
    #[must_use]
    pub fn first(&self) -> Option<&Waiting> {
        self.frames.front()
    }

    /// Takes the next frame out: it was sent.
    pub fn take(&mut self) -> Option<Waiting> {
        self.frames.pop_front()
    }

    /// Drops all frames.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// Frames that were lost because too many waited.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }
}
