//! The master at the bench's end of a ring: the right one, or one that deviates on purpose. Both have the same interface.

use crate::novobus::deviation::{DeviantMaster, MasterDeviation};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{
    Counters, CyclePace, Event, Job, JobId, Master, MasterOptions, Phase, Refused,
};
use harness_proto::time::Instant;

/// A master, right or wrong. Its calls are those of [`Master`].
#[derive(Clone, Debug)]
pub enum AnyMaster {
    /// The master of the manual.
    Right(Box<Master>),
    /// One that deviates from it.
    Deviant(Box<DeviantMaster>),
}

/// The same call for whichever master it is.
macro_rules! each {
    ($self:ident, $master:ident => $call:expr) => {
        match $self {
            AnyMaster::Right($master) => $call,
            AnyMaster::Deviant($master) => $call,
        }
    };
}

impl AnyMaster {
    /// Creates a master for a ring of this size on a line of this rate, with an optional deviation.
    #[must_use]
    pub fn new(
        ring: RingSize,
        rate: Rate,
        options: MasterOptions,
        deviates: Option<&'static MasterDeviation>,
    ) -> Self {
        match deviates {
            None => Self::Right(Box::new(Master::new(ring, rate, options))),
            Some(deviation) => {
                Self::Deviant(Box::new(DeviantMaster::new(ring, rate, options, deviation)))
            }
        }
    }

    fn master(&self) -> &Master {
        match self {
            Self::Right(master) => master,
            Self::Deviant(master) => master.inner(),
        }
    }

    /// How many drives the ring should have.
    #[must_use]
    pub fn ring(&self) -> RingSize {
        self.master().ring()
    }

    /// What the master is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.master().phase()
    }

    /// What it has done so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.master().counters()
    }

    /// How many jobs are queued or under way.
    #[must_use]
    pub fn jobs(&self) -> usize {
        self.master().jobs()
    }

    /// How many bytes have been sent and must come back.
    #[must_use]
    pub fn under_way(&self) -> usize {
        self.master().under_way()
    }

    /// Takes a job behind those that it has.
    ///
    /// # Errors
    /// Why the job cannot be done: see [`Refused`].
    pub fn submit(&mut self, job: Job) -> Result<JobId, Refused> {
        each!(self, master => master.submit(job))
    }

    /// Exchanges process data with these drives from the next round on (ND21 9.4).
    ///
    /// # Errors
    /// [`Refused::Drive`] where the ring has not all of them.
    pub fn set_exchange(&mut self, drives: &[u8], pace: CyclePace) -> Result<(), Refused> {
        match self {
            Self::Right(master) => master.set_exchange(drives, pace),
            Self::Deviant(master) => master.inner_mut().set_exchange(drives, pace),
        }
    }

    /// Lets one more round begin, at [`CyclePace::OnRequest`].
    pub fn start_round(&mut self) {
        match self {
            Self::Right(master) => master.start_round(),
            Self::Deviant(master) => master.inner_mut().start_round(),
        }
    }

    /// Sets what a drive gets in the cyclic exchange.
    ///
    /// # Errors
    /// [`Refused::Drive`] where the ring has no such drive.
    pub fn set_nominal(&mut self, drive: u8, value: u16) -> Result<(), Refused> {
        each!(self, master => master.set_nominal(drive, value))
    }

    /// What a drive gave last in the cyclic exchange.
    #[must_use]
    pub fn actual(&self, drive: u8) -> Option<u16> {
        each!(self, master => master.actual(drive))
    }

    /// The next byte to be sent; to be asked for whenever the line is free.
    #[inline]
    pub fn poll_transmit(&mut self, now: Instant) -> Option<u8> {
        each!(self, master => master.poll_transmit(now))
    }

    /// Takes a byte that has come back.
    #[inline]
    pub fn handle_byte(&mut self, now: Instant, received: Received) {
        each!(self, master => master.handle_byte(now, received));
    }

    /// When [`Self::handle_timeout`] is to be called, if no byte comes before.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        each!(self, master => master.poll_timeout())
    }

    /// Does what is due.
    pub fn handle_timeout(&mut self, now: Instant) {
        each!(self, master => master.handle_timeout(now));
    }

    /// The next thing to report.
    pub fn poll_event(&mut self) -> Option<Event> {
        each!(self, master => master.poll_event())
    }
}
