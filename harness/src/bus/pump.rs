//! Masters and their link, coupled: bytes out when the line is free, bytes in as they come.

use super::{Error, Options};
use crate::link::{Line, Trouble};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{
    self, Counters, Event, Job, JobId, Outcome, Phase, Refused, Stop,
};
use harness_proto::time::{Instant, Span};
use harness_sim::master::AnyMaster;
use std::collections::BTreeMap;

/// The most events that wait to be fetched.
const MOST_LINES: usize = 256;

/// How much later than the ring needs a byte may come where time is real: a busy computer stands still for longer than a ring does.
const BUSY_HOST: Span = Span::from_millis(400);

/// How long what is under way may take to come home before a pause.
const PAUSE: Span = Span::from_millis(500);

struct Ring {
    master: AnyMaster,
    /// When the line is free for the next byte.
    free: Instant,
    results: BTreeMap<JobId, Option<Outcome>>,
    stopped: Option<Stop>,
}

/// The masters of one or two rings over one link.
pub(super) struct Pump<'l> {
    link: Box<dyn Line + 'l>,
    rings: Vec<Ring>,
    /// What happened that no job reports, oldest first, with the number of the ring.
    log: Vec<(usize, Event)>,
}

impl<'l> Pump<'l> {
    pub(super) fn new(link: Box<dyn Line + 'l>, sizes: &[RingSize], options: &Options) -> Self {
        let now = link.now();
        // A byte that is only late must not count as lost: the recovery stops every drive.
        let own = master::Options {
            slack: match link.lead() {
                Span::ZERO => options.master.slack,
                _ => options.master.slack.max(BUSY_HOST),
            },
            ..options.master
        };
        let rate = Rate::ALL
            .into_iter()
            .find(|rate| rate.byte_time() == link.byte_time())
            .unwrap_or_default();
        let rings = sizes.iter().map(|&size| Ring {
            master: AnyMaster::new(size, rate, own, options.deviates),
            free: now,
            results: BTreeMap::new(),
            stopped: None,
        });
        Self {
            rings: rings.collect(),
            link,
            log: Vec::new(),
        }
    }

    pub(super) fn now(&self) -> Instant {
        self.link.now()
    }

    pub(super) fn sizes(&self) -> Vec<RingSize> {
        self.rings.iter().map(|ring| ring.master.ring()).collect()
    }

    pub(super) fn phases(&self) -> impl Iterator<Item = Phase> + '_ {
        self.rings.iter().map(|ring| ring.master.phase())
    }

    pub(super) fn counters(&self) -> Vec<Counters> {
        self.rings
            .iter()
            .map(|ring| ring.master.counters())
            .collect()
    }

    /// Why nothing goes on any more, if so: a ring has been stopped, or the link carries nothing.
    pub(super) fn halt(&self) -> Option<Error> {
        let stop = self.rings.iter().find_map(|ring| ring.stopped);
        let trouble = || self.trouble().map(Error::Link);
        stop.map(Error::Stopped).or_else(trouble)
    }

    /// Why the link carries nothing, if so.
    pub(super) fn trouble(&self) -> Option<Trouble> {
        self.link.trouble().cloned()
    }

    /// Takes a job; `None` where there is no such ring.
    pub(super) fn submit(&mut self, ring: usize, job: Job) -> Option<Result<JobId, Refused>> {
        let ring = self.rings.get_mut(ring)?;
        let id = ring.master.submit(job);
        if let Ok(id) = id {
            ring.results.insert(id, None);
        }
        Some(id)
    }

    /// The master of a ring; `None` where there is no such ring.
    pub(super) fn master(&mut self, ring: usize) -> Option<&mut AnyMaster> {
        Some(&mut self.rings.get_mut(ring)?.master)
    }

    /// The outcome of a job has come.
    pub(super) fn has(&self, ring: usize, id: JobId) -> bool {
        let result = self.rings.get(ring).and_then(|ring| ring.results.get(&id));
        matches!(result, Some(Some(_)))
    }

    /// The job was started here, and its outcome has not been fetched.
    pub(super) fn knows(&self, ring: usize, id: JobId) -> bool {
        self.rings
            .get(ring)
            .is_some_and(|ring| ring.results.contains_key(&id))
    }

    pub(super) fn take(&mut self, ring: usize, id: JobId) -> Option<Outcome> {
        if !self.has(ring, id) {
            return None;
        }
        self.rings.get_mut(ring)?.results.remove(&id)?
    }

    /// Nobody will ask for this outcome.
    pub(super) fn forget(&mut self, ring: usize, id: JobId) {
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.results.remove(&id);
        }
    }

    pub(super) fn take_log(&mut self) -> Vec<(usize, Event)> {
        std::mem::take(&mut self.log)
    }

    /// Takes what has come and does what is due, without letting time pass.
    pub(super) fn poll(&mut self) {
        let now = self.link.now();
        for (index, ring) in self.rings.iter_mut().enumerate() {
            while let Some((at, received)) = self.link.receive(index) {
                ring.master.handle_byte(at, received);
            }
            if ring.master.poll_timeout().is_some_and(|due| due <= now) {
                ring.master.handle_timeout(now);
            }
            while let Some(event) = ring.master.poll_event() {
                match &event {
                    Event::Ended { id, outcome } => {
                        // A result that was given up is dropped.
                        if let Some(result) = ring.results.get_mut(id) {
                            *result = Some(outcome.clone());
                        }
                        continue;
                    }
                    Event::Stopped(stop) => ring.stopped = Some(*stop),
                    Event::Disturbed { .. } | Event::Recovered { .. } => {}
                    Event::Ready | Event::Round { .. } => continue,
                }
                if self.log.len() < MOST_LINES {
                    self.log.push((index, event));
                }
            }
        }
    }

    /// Sends what the lines are free for and lets time pass until the next byte is due, at most until
    /// `end`.
    pub(super) fn step(&mut self, end: Instant) {
        self.poll();
        let now = self.link.now();
        let byte_time = self.link.byte_time();
        let lead = self.link.lead();
        let mut until = end;
        for (index, ring) in self.rings.iter_mut().enumerate() {
            let mut idle = false;
            // Where the link carries nothing, no byte takes any time.
            while ring.free <= now + lead && !idle && self.link.trouble().is_none() {
                // The time at which the byte leaves, not that at which it is handed over.
                let start = ring.free.max(now);
                ring.free = match ring.master.poll_transmit(start) {
                    Some(byte) => self.link.send(index, &[byte]),
                    None => {
                        idle = true;
                        now + byte_time
                    }
                };
                idle |= lead == Span::ZERO;
            }
            // Where bytes are handed over ahead, the next are before the line has run dry, many at a time.
            let ahead = if idle {
                Span::ZERO
            } else {
                Span::from_nanos(lead.as_nanos() / 2)
            };
            let next = Instant::START + ring.free.since_start().saturating_sub(ahead);
            until = until.min(next.max(now + byte_time.min(lead)));
        }
        while self.link.now() < until && self.link.trouble().is_none() {
            self.link.wait(until);
            self.poll();
        }
    }

    /// When the link wants a pause next.
    pub(super) fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due()
    }

    /// Where the link wants a pause and no job is on its way, lets what is under way come home and gives it one.
    pub(super) fn pause(&mut self) {
        let now = self.link.now();
        let due = self.link.pause_due().is_some_and(|due| due <= now);
        if due && self.rings.iter().all(|ring| ring.master.jobs() == 0) {
            self.drain(now + PAUSE);
            self.link.pause();
        }
    }

    /// Sends nothing more and lets what is under way come home, at most until `end`.
    pub(super) fn drain(&mut self, end: Instant) {
        let under_way = |ring: &Ring| ring.master.under_way() > 0;
        self.poll();
        while self.halt().is_none() && self.rings.iter().any(under_way) && self.link.now() < end {
            let until = self.link.now() + self.link.byte_time();
            self.link.wait(until.min(end));
            self.poll();
        }
    }
}
