//! Recovery: from the first wrong byte back to normal operation, or to a stopped bus (ND21 9.7-9.9, 11.5).

use super::super::address::RingSize;
use super::super::check_sequence::{CHECK_SEQUENCE, SequenceProgress, SequenceWatch};
use super::super::sync::SYNCO;
use super::diagnosis::{DisturbanceSign, Evidence, NO_TELEGRAM, SPELLING, Spelled};
use super::event::Event;
use super::fault::{BusStop, Fault, RingLink};
use super::in_flight::{BytePlace, Owner};
use super::job::{JobId, Outcome};
use super::store::Entry;
use super::{Master, Phase};
use crate::line::Received;
use crate::time::{Instant, Span};

/// Silence after a failed recovery. It is shorter than the 10 ms after which drives with monitoring report a time-out:
/// the ring would spell out that time-out in place of the first fault (ND21 9.9).
const DRAINING: Span = Span::from_millis(8);

/// The state of a master, with its data.
#[derive(Clone, Debug)]
pub(super) enum RecoveryState {
    Counting {
        composed: bool,
    },
    Running,
    Locating {
        evidence: Evidence,
        until: Instant,
    },
    /// The sequence begins to come back before all of it is sent: in a small ring two bytes later.
    Resetting {
        /// Bytes that were sent, and how many there are.
        next: u16,
        bytes: u16,
        watch: SequenceWatch,
    },
    Verifying {
        watch: SequenceWatch,
        heard: bool,
        /// Of several sequences, SYNCO comes back after the last one only.
        last: LastSequence,
        until: Instant,
    },
    /// Nothing is sent, so that late bytes can catch up: on a line without a gap a delay never shrinks.
    Draining {
        until: Instant,
    },
    Stopped(BusStop),
}

impl RecoveryState {
    pub(super) const fn counting() -> Self {
        Self::Counting { composed: false }
    }

    /// This number of check sequences.
    pub(super) fn resetting(sequences: u16) -> Self {
        Self::Resetting {
            next: 0,
            bytes: sequences * CHECK_SEQUENCE.len() as u16,
            watch: SequenceWatch::default(),
        }
    }

    pub(super) const fn phase(&self) -> Phase {
        match self {
            Self::Counting { .. } => Phase::Counting,
            Self::Running => Phase::Running,
            Self::Locating { .. } => Phase::Locating,
            Self::Draining { .. } => Phase::Draining,
            Self::Resetting { .. } => Phase::Resetting,
            Self::Verifying { .. } => Phase::Verifying,
            Self::Stopped(_) => Phase::Stopped,
        }
    }
}

/// Which of the check sequences has come back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LastSequence {
    /// There is one alone.
    Only,
    /// There are several, and another one may come.
    Awaited,
    /// There are several, and one has just come back.
    Perhaps,
}

/// The work at which a disturbance began. Recoveries are counted until it is done, so that a ring that recovers
/// each time and fails again at the same place is stopped as well.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Stumble {
    /// None, or none that can be named: done when a round of the ring has come back right.
    #[default]
    Idle,
    Job(JobId),
    Exchange(u8),
}

/// The history of the recoveries.
#[derive(Clone, Debug, Default)]
pub(super) struct Episode {
    /// Recoveries since the disturbed work was last done.
    failures: u16,
    /// Recoveries since the ring last ran.
    attempts: u8,
    /// How many of the failures began within one and the same command of the drive that was named.
    rejections: u16,
    stumble: Stumble,
    /// Bytes that have come back right since the ring runs again.
    clean: u16,
    /// A byte was missed since the ring last ran.
    silent: bool,
    /// The last byte came after a silence.
    after_silence: bool,
    /// The drives are to be counted before the ring runs.
    count: bool,
    /// The ring has run.
    ran: bool,
    /// The last fault that was found.
    fault: Option<Fault>,
}

impl Episode {
    /// How many check sequences the next recovery sends: one, and where two recoveries did not help, as many as a sound ring needs (9.9).
    pub(super) fn sequences(&self, ring: RingSize) -> u16 {
        match self.failures {
            0..=2 => 1,
            _ => ring.drives().into(),
        }
    }

    /// Whether the ring has not run yet.
    pub(super) fn is_first(&self) -> bool {
        !self.ran
    }

    /// A piece of work is done.
    #[inline]
    pub(super) fn is_done(&mut self, work: Stumble) {
        if self.failures > 0 && self.stumble == work {
            self.got_over();
        }
    }

    /// A byte has come, after a silence or not.
    #[inline]
    pub(super) fn heard_after(&mut self, silence: bool) {
        self.after_silence = silence;
    }

    /// A byte has come back right.
    #[inline]
    pub(super) fn byte_was_right(&mut self, ring: RingSize) {
        let runs = self.attempts == 0;
        if self.failures > 0 && runs && self.stumble == Stumble::Idle {
            self.clean = self.clean.saturating_add(1);
            if self.clean > u16::from(ring.drives()) + 4 * u16::from(NO_TELEGRAM) {
                self.got_over();
            }
        }
    }

    /// From now on process data are exchanged with these drives only.
    pub(super) fn exchange_with(&mut self, drives: &[u8]) {
        if matches!(self.stumble, Stumble::Exchange(drive) if !drives.contains(&drive)) {
            self.stumble = Stumble::Idle;
        }
    }

    fn got_over(&mut self) {
        self.failures = 0;
        self.rejections = 0;
        self.stumble = Stumble::Idle;
    }
}

impl Master {
    /// Handles a disturbance: work stops, and the ring gets time to spell out an address.
    pub(super) fn disturb(&mut self, cause: DisturbanceSign, now: Instant) {
        if self.episode.attempts == 0 {
            self.counters.disturbed += 1;
        }
        match cause {
            DisturbanceSign::Missed(_) => self.episode.silent = true,
            DisturbanceSign::NotBack => {
                if matches!(self.state, RecoveryState::Verifying { heard: false, .. }) {
                    self.episode.silent = true;
                }
            }
            DisturbanceSign::Wrong(sent) => {
                self.episode.count |= sent.composed.place == BytePlace::Address
            }
            DisturbanceSign::Unasked => {}
        }
        if matches!(cause, DisturbanceSign::Wrong(_) | DisturbanceSign::Unasked) {
            self.episode.silent |= self.episode.after_silence;
        }
        if self.episode.failures == 0 {
            self.episode.stumble = match cause.sent().map(|sent| sent.composed.owner) {
                Some(Owner::Job(slot)) => self
                    .store
                    .get(slot)
                    .map_or(Stumble::Idle, |entry| Stumble::Job(entry.id)),
                Some(Owner::Exchange(drive)) => Stumble::Exchange(drive),
                Some(Owner::Idle | Owner::Count) | None => Stumble::Idle,
            };
        }
        self.episode.clean = 0;
        let evidence = Evidence::new(cause, self.in_flight.iter());
        self.in_flight.clear();
        self.unconfirmed = super::Unconfirmed::default();
        let mut until = now + self.patience + self.byte_time * SPELLING;
        if self.episode.silent {
            until += self.options.monitoring;
        }
        self.state = RecoveryState::Locating { evidence, until };
    }

    /// Keeps the byte at which it began.
    pub(super) fn see(&mut self, received: Received) {
        if let RecoveryState::Locating { evidence, .. } = &mut self.state {
            evidence.see(received);
        }
    }

    /// The ring has spelled out an address, or its time is over.
    pub(super) fn located(&mut self, spelled: Spelled, now: Instant) {
        let RecoveryState::Locating { evidence, .. } = &self.state else {
            return;
        };
        let job = match evidence.cause() {
            DisturbanceSign::Wrong(sent) => match sent.composed.owner {
                Owner::Job(slot) => self.store.get(slot).map(|job| (sent, job)),
                _ => None,
            },
            _ => None,
        };
        let drive = job.map(|(_, job)| job.drive);
        let mut fault = evidence.name(self.ring, spelled, self.episode.silent, drive);
        let episode = &mut self.episode;
        let named = |job: &Entry| fault == Fault::Damaged(RingLink::into(self.ring, job.drive));
        episode.failures = episode.failures.saturating_add(1);
        episode.attempts = episode.attempts.saturating_add(1);
        let rejected = job.filter(|(sent, job)| {
            sent.composed.place == BytePlace::Parameter
                && named(job)
                && episode.stumble == Stumble::Job(job.id)
        });
        if rejected.is_some() {
            episode.rejections = episode.rejections.saturating_add(1);
        }
        episode.silent |= spelled == Spelled::Nothing;
        episode.fault = Some(fault);
        let (failures, attempt) = (episode.failures, episode.attempts);
        let always_rejected = episode.rejections == failures;
        if failures > u16::from(self.options.attempts) {
            if let Some((_, job)) = rejected.filter(|_| always_rejected) {
                fault = Fault::Rejected {
                    drive: job.drive,
                    kind: job.kind,
                };
            }
            self.report(Event::Disturbed { fault, attempt });
            self.stop(fault);
        } else {
            self.report(Event::Disturbed { fault, attempt });
            // Sent long ago, unless the caller stopped polling.
            self.outgoing.clear();
            self.state = if failures == 1 {
                RecoveryState::resetting(1)
            } else {
                RecoveryState::Draining {
                    until: now + DRAINING,
                }
            };
        }
    }

    /// Looks for the check sequence in the bytes that come back.
    pub(super) fn verify(&mut self, received: Received) {
        let (watch, last) = match &mut self.state {
            RecoveryState::Resetting { watch, .. } => {
                watch.see(received.byte, received.error.is_none());
                return;
            }
            RecoveryState::Verifying {
                watch, heard, last, ..
            } => {
                *heard = true;
                if *last == LastSequence::Perhaps && received.is(SYNCO) {
                    self.in_flight.pop();
                    return self.came_back();
                }
                (watch, last)
            }
            _ => return,
        };
        let progress = watch.see(received.byte, received.error.is_none());
        let complete = progress == SequenceProgress::Complete;
        if *last == LastSequence::Only {
            if complete {
                self.came_back();
            }
        } else {
            *last = match complete {
                true => LastSequence::Perhaps,
                false => LastSequence::Awaited,
            };
        }
    }

    /// All drives are back in normal mode; the bytes sent after the sequence come next.
    fn came_back(&mut self) {
        if self.episode.count || !self.episode.ran {
            self.state = RecoveryState::counting();
        } else {
            self.resume();
        }
    }

    /// The ring works again: jobs that were not done are sent again.
    pub(super) fn resume(&mut self) {
        let attempts = core::mem::take(&mut self.episode.attempts);
        self.episode.ran = true;
        self.episode.silent = false;
        self.episode.count = false;
        self.last_addressed = None;
        self.state = RecoveryState::Running;
        if attempts == 0 {
            return;
        }
        self.counters.corrected += 1;
        self.report(Event::Recovered { attempts });
        let fault = self.episode.fault.unwrap_or(Fault::Unclear);
        let (events, episode) = (&mut self.events, &mut self.episode);
        self.counters.repeated += self.store.restart(|job| {
            let again = job.left() > 0 || job.may_repeat;
            if !again {
                events.ended(job.id, Outcome::Unknown(fault));
                if episode.stumble == Stumble::Job(job.id) {
                    episode.stumble = Stumble::Idle;
                }
            }
            again
        });
        self.cycle.restart();
    }

    /// The bus is stopped; every job ends.
    fn stop(&mut self, fault: Fault) {
        let stop = BusStop {
            fault,
            attempts: self.options.attempts,
        };
        let events = &mut self.events;
        self.store.restart(|job| {
            let perhaps_run = job.perhaps_run || job.left() == 0;
            let outcome = if perhaps_run && !job.kind.reads() {
                Outcome::Unknown(fault)
            } else {
                Outcome::Failed(stop)
            };
            events.ended(job.id, outcome);
            false
        });
        self.state = RecoveryState::Stopped(stop);
        self.report(Event::Stopped(stop));
    }
}
