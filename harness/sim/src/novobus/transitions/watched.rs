//! A plain drive with an observer around it that notes its transitions.

use super::{Event, Notes, Reached, Transition, classify, state};
use crate::novobus::device::Device;
use crate::novobus::plain::PlainDrive;
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{Deadline, Reaction};
use harness_proto::novobus::error::BusError;
use harness_proto::time::Instant;

/// A plain drive whose transitions are noted. It does what the drive does.
#[derive(Clone, Debug, Default)]
pub struct Watched<N = Reached> {
    drive: PlainDrive,
    reached: N,
    timed_out: bool,
}

impl<N: Notes> Watched<N> {
    /// A drive with nothing noted.
    #[must_use]
    pub fn new(drive: PlainDrive) -> Self {
        Self {
            drive,
            reached: N::default(),
            timed_out: false,
        }
    }

    /// Resets the drive for reuse: it keeps its EEPROM, and the noted transitions are cleared.
    pub fn restart(&mut self) {
        self.drive.restart();
        self.reached = N::default();
        self.timed_out = false;
    }

    /// The drive.
    #[must_use]
    pub const fn drive(&self) -> &PlainDrive {
        &self.drive
    }

    /// The transitions that it went through.
    #[must_use]
    pub const fn reached(&self) -> &N {
        &self.reached
    }

    /// Returns the transitions so far and clears them.
    #[must_use]
    pub fn take_reached(&mut self) -> N {
        std::mem::take(&mut self.reached)
    }

    /// Whether there has been a time-out (ND21 9.9).
    #[must_use]
    pub const fn timed_out(&self) -> bool {
        self.timed_out
    }

    /// Returns the transitions that it went through and consumes the drive.
    #[must_use]
    pub fn into_reached(self) -> N {
        self.reached
    }

    /// The transition that a byte would be.
    #[must_use]
    pub fn transition(&self, received: Received) -> Transition {
        classify(self.drive.bus_end(), self.drive.memory(), received)
    }
}

impl<N: Notes> Device for Watched<N> {
    #[inline(always)]
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        self.reached.note(self.transition(received));
        self.drive.receive(now, received)
    }

    #[inline]
    fn deadline(&self) -> Option<Deadline> {
        self.drive.deadline()
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        self.reached.note(Transition {
            state: state(self.drive.bus_end(), self.drive.memory()),
            event: Event::Silence,
        });
        self.timed_out = true;
        self.drive.handle_deadline(now)
    }

    fn power_on(&mut self, now: Instant) {
        self.drive.power_on(now);
    }

    fn in_error(&self) -> bool {
        self.drive.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.drive.cause()
    }
}
