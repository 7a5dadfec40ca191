//! The master's end of the bus (ND21 8.2, 9, 10, 11): jobs in, telegrams out, results and named faults
//! back, for one ring.
//!
//! It owns no port and no clock (sans-IO). The caller, which owns both, calls
//!
//! * [`Master::poll_transmit`] whenever the line is free, and sends the byte that it gives;
//! * [`Master::handle_byte`] with every byte that has come back;
//! * [`Master::handle_timeout`] when [`Master::poll_timeout`] is past;
//! * [`Master::poll_event`] after any of these.
//!
//! Work is given by [`Master::submit`] (a command for a drive) and [`Master::set_exchange`] (cyclic
//! process data). The line has no gap (9.1): an idle master sends SYNCO. Telegrams are pipelined: the master
//! does not wait for an answer before it sends the next one. It keeps a bounded list of the bytes that must come back
//! and compares each one: sync byte, address, echo, checking byte.
//!
//! # When a wrong byte comes back
//!
//! ```text
//! Counting -> Running -> Locating -> Resetting -> Verifying -> Running
//!                           ^                         |
//!                           +------ not back ---------+     Locating -> Draining -> Resetting, then
//!                                                           Locating -> Stopped, after too many
//! ```
//!
//! *Locating*: the master completes the current telegram (an incomplete one would make a sound drive detect
//! an error, and the ring would spell out that drive), then sends SYNCO until the ring
//! spells out an address (9.7) or a time-out ends the wait. *Draining*, from the second recovery on: 8 ms of
//! silence, in which late bytes arrive. *Resetting*: 17 zeros and the check sequence (9.8).
//! *Verifying*: a drive forwards the five bytes only when they have ended its error mode; so once all five
//! have come round, no drive is in the error mode. The manual repeats at once; this master waits, because
//! a job that is sent while some drives are in the error mode could run without an answer. *Counting*:
//! a telegram to address byte 00, which no drive has, comes back with the number of drives. The master counts at the
//! beginning, because in a ring of another size every address means another drive, and after
//! an address byte has come back wrong.
//!
//! # What is known of a job that was under way
//!
//! * It *ran* when every byte up to the drive's own -checksum has come back right: the address names the
//!   drive that answered, and a drive sends that byte only after its check of the command succeeded. (For two sums of
//!   256 both checking bytes are the same; then only the address proves it.)
//! * It *did not run* when its checking byte was never sent: until then a drive changes nothing (9.6).
//! * In between it is *unknown*. The spelled-out address does not prove that the byte had not reached
//!   the drives behind it: the named one is the first *in the ring* that is in the error mode. It may have
//!   entered the error mode later than a drive further down, whose address was overwritten.
//!
//! Jobs that did not run are sent again. Jobs that may have run are sent again if they [may run twice](Repeat);
//! if not, they end as [`Outcome::Unknown`]. The order of submission is kept. The outcome of a write says whether it may have run
//! twice. A read that is sent again returns the value at that time.
//!
//! Data without a check of their own (process data, the four data bytes of `ReadLong`) count only when a
//! byte other than 00 has come back right after them: a drive in the error mode answers 00. Where they
//! end with 80, and only SYNCO follows, a lost byte would look the same; then the drives are counted.
//!
//! # What cannot be detected
//!
//! The bus checks a byte by its parity and a command by 8 bits. Neither detects every loss of a whole run of bytes
//! (a plug that is pulled and put back): a telegram to the "next" drive then means the one
//! before, until the next address byte, and process data, which no check protects, are attributed to a
//! neighbour. Where that matters, [`Packing`] switches the short addresses off: every telegram then
//! returns the number of the drive that answered.

mod answers;
mod compose;
mod cycle;
mod diagnosis;
mod event;
mod fault;
mod in_flight;
mod job;
mod options;
mod recovery;
mod store;
#[cfg(test)]
mod tests;

pub use cycle::CyclePace;
pub use event::{Counters, Event};
pub use fault::{BusStop, Fault, LinkEnd, RingLink};
pub use job::{Job, JobId, Outcome, ReadData, Refused, Repeat};
pub use options::{MasterOptions, Packing};

use super::address::RingSize;
use super::check_sequence::{CHECK_SEQUENCE, SequenceWatch};
use super::sync::{PAUSE, SYNCO};
use crate::line::{Rate, Received};
use crate::time::{Instant, Span};
use alloc::vec::Vec;
use answers::Unconfirmed;
use compose::Outgoing;
use cycle::Cycle;
use diagnosis::DisturbanceSign;
use event::Events;
use in_flight::{ByteInFlight, BytePlace, ComposedByte, InFlight};
use recovery::{Episode, LastSequence, RecoveryState};
use store::Store;

/// The master's end of one ring.
#[derive(Clone, Debug)]
pub struct Master {
    ring: RingSize,
    options: MasterOptions,
    byte_time: Span,
    /// From the beginning of a byte to when it must be back.
    patience: Span,
    state: RecoveryState,
    episode: Episode,
    store: Store,
    cycle: Cycle,
    /// The last round is sent whole, and a telegram with jobs comes before the next one.
    jobs_turn: bool,
    outgoing: Outgoing,
    in_flight: InFlight,
    unconfirmed: Unconfirmed,
    /// The drive for which "same drive" would be meant; `None` where no short address is valid.
    last_addressed: Option<u8>,
    /// No byte of the ring has come but SYNCO, with which another program may have kept the line before.
    unheard: bool,
    pauses: u16,
    /// When the last byte came back.
    last_heard: Instant,
    events: Events,
    counters: Counters,
}

/// The most bytes that may be under way besides those that a ring needs by itself, however much slack
/// there is.
const MOST_SLACK: u64 = 4096;

/// The silence after which a drive with monitoring reports a time-out (ND21 9.9). What comes after it was
/// sent unasked: at least 10 ms later, which may be sooner than the master misses a byte.
const TIME_OUT: Span = Span::from_millis(10);

/// What a master is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It counts the drives.
    Counting,
    /// It does its work.
    Running,
    /// It waits for the ring to spell out an address (ND21 9.7).
    Locating,
    /// A recovery has failed: for 8 ms it sends nothing.
    Draining,
    /// It sends the check sequence (ND21 9.8).
    Resetting,
    /// It waits for the check sequence to come back.
    Verifying,
    /// It has given up.
    Stopped,
}

impl Master {
    /// Creates a master for a ring of this size on a line of this rate.
    #[must_use]
    pub fn new(ring: RingSize, rate: Rate, options: MasterOptions) -> Self {
        let byte_time = rate.byte_time();
        // A byte needs one byte time to the first drive and one for each drive that passes it on.
        let round = u64::from(ring.drives()) + 1;
        let slack = options.slack.units() / byte_time.units() + 2;
        let most = usize::try_from(round + slack.min(MOST_SLACK)).unwrap_or(usize::MAX);
        Self {
            ring,
            options,
            byte_time,
            patience: byte_time * round + options.slack,
            state: if options.check_first {
                RecoveryState::resetting(1)
            } else {
                RecoveryState::counting()
            },
            episode: Episode::default(),
            store: Store::new(ring, options.capacity),
            cycle: Cycle::new(ring),
            jobs_turn: false,
            outgoing: Outgoing::default(),
            in_flight: InFlight::new(most),
            unconfirmed: Unconfirmed::default(),
            last_addressed: None,
            unheard: true,
            pauses: 0,
            last_heard: Instant::START,
            events: Events::default(),
            counters: Counters::default(),
        }
    }

    /// How many drives the ring should have.
    #[must_use]
    pub const fn ring(&self) -> RingSize {
        self.ring
    }

    /// What the master is doing.
    #[must_use]
    pub const fn phase(&self) -> Phase {
        self.state.phase()
    }

    /// What it has done so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// How many jobs are queued or under way.
    #[must_use]
    pub fn jobs(&self) -> usize {
        self.store.len()
    }

    /// How many bytes have been sent and must come back.
    #[must_use]
    pub fn under_way(&self) -> usize {
        self.in_flight.len()
    }

    /// Takes a job behind those that it has. Jobs for one drive run in this order; so do all jobs as
    /// long as there is no cyclic exchange with one of their drives.
    ///
    /// # Errors
    /// Why the job cannot be done: see [`Refused`].
    pub fn submit(&mut self, job: Job) -> Result<JobId, Refused> {
        if let RecoveryState::Stopped(stop) = self.state {
            return Err(Refused::Stopped(stop));
        }
        job.check(self.ring)?;
        let full = Refused::Full {
            capacity: self.options.capacity,
        };
        if self.store.len() + self.events.results() >= usize::from(self.options.capacity) {
            return Err(full);
        }
        self.store.add(&job, self.options.read_long).ok_or(full)
    }

    /// Exchanges process data with these drives from the next round on (ND21 9.4), in ascending order;
    /// with none, the exchange ends. Drives get the value set last by [`Self::set_nominal`], 0 at first.
    ///
    /// # Errors
    /// [`Refused::Drive`] where the ring has not all of them.
    pub fn set_exchange(&mut self, drives: &[u8], pace: CyclePace) -> Result<(), Refused> {
        let mut list: Vec<u8> = drives.to_vec();
        for &drive in drives {
            self.ring.address_byte(drive).map_err(Refused::Drive)?;
        }
        list.sort_unstable();
        list.dedup();
        self.episode.exchange_with(&list);
        self.cycle.set(list, pace);
        Ok(())
    }

    /// Lets one more round begin, at [`CyclePace::OnRequest`].
    pub fn start_round(&mut self) {
        self.cycle.request();
    }

    /// Sets what a drive gets in the cyclic exchange from its next telegram on.
    ///
    /// # Errors
    /// [`Refused::Drive`] where the ring has no such drive.
    pub fn set_nominal(&mut self, drive: u8, value: u16) -> Result<(), Refused> {
        self.ring.address_byte(drive).map_err(Refused::Drive)?;
        self.cycle.set_nominal(drive, value);
        Ok(())
    }

    /// What a drive gave last in the cyclic exchange.
    #[must_use]
    pub fn actual(&self, drive: u8) -> Option<u16> {
        self.cycle.actual(drive)
    }

    /// Sends PAUSE in place of the next `count` SYNCO, to loosen the data flow (ND21 9.2). The first drive
    /// swallows them: the others hear nothing, and after 10 ms those with monitoring report a time-out.
    pub fn pause(&mut self, count: u16) {
        self.pauses = count;
    }

    /// Returns the next byte to send; call it whenever the line is free. `None` when the bus is
    /// stopped, and while the maximum number of bytes is under way.
    #[inline]
    pub fn poll_transmit(&mut self, now: Instant) -> Option<u8> {
        let watched = match self.state {
            RecoveryState::Running | RecoveryState::Counting { .. } => true,
            RecoveryState::Verifying { .. } => {
                return self.transmit(ComposedByte::SYNCO, true, now);
            }
            RecoveryState::Locating { .. } => false,
            RecoveryState::Resetting { next, bytes, watch } => {
                return self.reset_byte(next, bytes, watch, now);
            }
            RecoveryState::Draining { .. } | RecoveryState::Stopped(_) => return None,
        };
        if watched && self.in_flight.is_full() {
            return None;
        }
        if self.outgoing.is_empty() {
            match &mut self.state {
                RecoveryState::Running => self.compose(now),
                RecoveryState::Counting { composed } if !*composed => {
                    *composed = true;
                    self.compose_count();
                }
                _ => {}
            }
        }
        let composed = match self.outgoing.next() {
            Some(composed) => composed,
            None if matches!(self.state, RecoveryState::Running) && self.pauses > 0 => {
                self.pauses -= 1;
                self.counters.idle += 1;
                self.counters.sent += 1;
                return Some(PAUSE);
            }
            None => ComposedByte::SYNCO,
        };
        self.transmit(composed, watched, now)
    }

    /// Lets a byte out; `watched`: it must come back as composed.
    fn transmit(&mut self, composed: ComposedByte, watched: bool, now: Instant) -> Option<u8> {
        if watched {
            if self.in_flight.is_full() {
                return None;
            }
            self.in_flight.push(ByteInFlight {
                composed,
                due: now + self.patience,
            });
        } else if let RecoveryState::Locating { evidence, .. } = &mut self.state {
            evidence.expect(composed.back);
        }
        self.counters.sent += 1;
        let idle = composed.byte == SYNCO && composed == ComposedByte::SYNCO;
        self.counters.idle += u64::from(idle);
        self.counters.telegrams += u64::from(composed.place == BytePlace::Sync && !idle);
        Some(composed.byte)
    }

    /// Lets out the next byte of the check sequences.
    fn reset_byte(
        &mut self,
        next: u16,
        bytes: u16,
        watch: SequenceWatch,
        now: Instant,
    ) -> Option<u8> {
        let byte = CHECK_SEQUENCE[usize::from(next) % CHECK_SEQUENCE.len()];
        self.counters.sent += 1;
        let next = next + 1;
        self.state = if next < bytes {
            RecoveryState::Resetting { next, bytes, watch }
        } else {
            RecoveryState::Verifying {
                watch,
                heard: false,
                last: match usize::from(bytes) > CHECK_SEQUENCE.len() {
                    true => LastSequence::Awaited,
                    false => LastSequence::Only,
                },
                until: now + self.patience,
            }
        };
        Some(byte)
    }

    /// Takes a byte that has come back.
    pub fn handle_byte(&mut self, now: Instant, received: Received) {
        if self.poll_timeout().is_some_and(|due| due < now) {
            self.handle_timeout(now);
        }
        self.counters.received += 1;
        self.counters.line_errors += u64::from(received.error.is_some());
        let silent = self.silent_until(now) >= TIME_OUT;
        self.last_heard = now;
        self.episode.heard_after(silent);
        let works = matches!(
            self.state,
            RecoveryState::Running | RecoveryState::Counting { .. }
        );
        if works && self.unheard && self.is_before(received) {
            return;
        }
        match &mut self.state {
            RecoveryState::Running | RecoveryState::Counting { .. } => self.take(received, now),
            RecoveryState::Locating { evidence, .. } => {
                evidence.see(received);
                if let Some(spelled) = evidence.settled(self.ring) {
                    self.located(spelled, now);
                }
            }
            RecoveryState::Resetting { .. } | RecoveryState::Verifying { .. } => {
                self.verify(received)
            }
            RecoveryState::Draining { .. } | RecoveryState::Stopped(_) => {}
        }
    }

    /// Whether a byte was sent before this master: SYNCO in front of the telegram with which it begins.
    fn is_before(&mut self, received: Received) -> bool {
        let first = self.in_flight.iter().next();
        let before = first.is_none_or(|sent| sent.composed != ComposedByte::SYNCO);
        self.unheard &= before && received.is(SYNCO);
        self.unheard
    }

    /// For how long bytes have been missed. A master that has sent nothing for a while, or never, has missed none.
    fn silent_until(&self, now: Instant) -> Span {
        // One byte time before the oldest byte under way is to come back.
        let early = self.options.slack + self.byte_time;
        let from = |due: Instant| due - early;
        let from = self.in_flight.due().map(from);
        now.since(from.map_or(self.last_heard, |from| from.max(self.last_heard)))
    }

    /// When [`Self::handle_timeout`] is to be called, if no byte comes before.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        match self.state {
            RecoveryState::Running | RecoveryState::Counting { .. } => self.in_flight.due(),
            RecoveryState::Locating { until, .. }
            | RecoveryState::Draining { until }
            | RecoveryState::Verifying { until, .. } => Some(until),
            RecoveryState::Resetting { .. } | RecoveryState::Stopped(_) => None,
        }
    }

    /// Does what is due: a byte is missed, or a phase of the recovery has taken too long.
    pub fn handle_timeout(&mut self, now: Instant) {
        if self.poll_timeout().is_none_or(|due| due > now) {
            return;
        }
        match &self.state {
            RecoveryState::Running | RecoveryState::Counting { .. } => {
                if let Some(sent) = self.in_flight.pop() {
                    self.disturb(DisturbanceSign::Missed(sent), now);
                }
            }
            RecoveryState::Locating { evidence, .. } => {
                let spelled = evidence.spelled(self.ring);
                self.located(spelled, now);
            }
            RecoveryState::Draining { .. } => {
                self.state = RecoveryState::resetting(self.episode.sequences(self.ring));
            }
            RecoveryState::Verifying { .. } => self.disturb(DisturbanceSign::NotBack, now),
            RecoveryState::Resetting { .. } | RecoveryState::Stopped(_) => {}
        }
    }

    /// The next thing to report.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.next()
    }

    fn report(&mut self, event: Event) {
        if !self.events.add(event) {
            self.counters.lost_events += 1;
        }
    }
}
