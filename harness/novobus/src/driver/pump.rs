//! Couples masters to their link: sends a byte when the line is free for it and passes on the bytes received.

use super::{Error, Options};
use crate::guard::safe_state::telegram;
use harness_bench::link::lateness::StoodStill;
use harness_bench::link::{Lead, Line, Octets, Trouble};
use harness_bench::medium::Out;
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{
    self, BusStop, Counters, Event, Job, JobId, Outcome, Phase, Refused,
};
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::master::AnyMaster;
use std::collections::BTreeMap;

/// Maximum number of events kept until they are fetched.
const MOST_LINES: usize = 256;

/// How much longer than the ring needs a byte may take in real time: a busy computer can stand still for this long.
const BUSY_HOST: Span = Span::from_millis(400);

/// How long bytes on their way may take to come back before a pause.
const PAUSE: Span = Span::from_millis(500);

struct PumpedRing {
    master: AnyMaster,
    /// When the line is free for the next byte.
    free: Instant,
    /// When the last byte that is not an idle SYNCO is back at the master.
    home: Instant,
    /// Only SYNCO has been sent behind that byte, and nothing has been requested since.
    idle: bool,
    results: BTreeMap<JobId, Option<Outcome>>,
    stopped: Option<BusStop>,
}

/// The masters of one or two rings over one link.
pub(crate) struct Masters<'l> {
    link: Box<dyn Line + 'l>,
    rings: Vec<PumpedRing>,
    /// Events that belong to no job, oldest first, with the number of the ring.
    log: Vec<(usize, Event)>,
    still: StoodStill,
}

impl<'l> Masters<'l> {
    pub(crate) fn new(link: Box<dyn Line + 'l>, sizes: &[RingSize], options: &Options) -> Self {
        let now = link.now();
        // A late byte must not count as lost, because the recovery stops every drive.
        let master_options = master::MasterOptions {
            slack: match link.lead() {
                Lead::NONE => options.master.slack,
                _ => options.master.slack.max(BUSY_HOST),
            },
            ..options.master
        };
        let rate = Rate::ALL
            .into_iter()
            .find(|rate| rate.byte_time() == link.byte_time())
            .unwrap_or_default();
        let rings = sizes.iter().map(|&size| PumpedRing {
            master: AnyMaster::new(size, rate, master_options, options.deviates),
            free: now,
            home: now,
            idle: false,
            results: BTreeMap::new(),
            stopped: None,
        });
        Self {
            rings: rings.collect(),
            link,
            log: Vec::new(),
            still: StoodStill::new(now),
        }
    }

    pub(crate) fn now(&self) -> Instant {
        self.link.now()
    }

    /// When `patience` is over that began at a time, when the computer had stood still for `before` in all: a caller that stands still
    /// itself waits for nothing.
    pub(crate) fn end(&self, (began, before): (Instant, Span), patience: Span) -> Instant {
        began + patience + self.still.total().saturating_sub(before)
    }

    /// The time, and for how long the computer has stood still before it.
    pub(crate) fn begin(&mut self) -> (Instant, Span) {
        let now = self.link.now();
        self.still.look(now, now);
        (now, self.still.total())
    }

    pub(crate) fn permits(&self, ring: usize, drive: u8, command: Command) -> bool {
        let Some(PumpedRing { master, .. }) = self.rings.get(ring) else {
            return false;
        };
        let bytes = telegram(master.ring(), drive, command);
        self.link.permits(ring, Out::Octets(&bytes))
    }

    pub(crate) fn sizes(&self) -> Vec<RingSize> {
        self.rings.iter().map(|ring| ring.master.ring()).collect()
    }

    pub(crate) fn phases(&self) -> impl Iterator<Item = Phase> + '_ {
        self.rings.iter().map(|ring| ring.master.phase())
    }

    pub(crate) fn counters(&self) -> Vec<Counters> {
        self.rings
            .iter()
            .map(|ring| ring.master.counters())
            .collect()
    }

    /// Why the bus has halted, if it has: a ring is stopped, or the link carries nothing.
    pub(crate) fn halt(&self) -> Option<Error> {
        let stop = self.rings.iter().find_map(|ring| ring.stopped);
        let trouble = || self.trouble().map(Error::Link);
        stop.map(Error::Stopped).or_else(trouble)
    }

    /// Why the link carries nothing, if so.
    pub(crate) fn trouble(&self) -> Option<Trouble> {
        self.link.trouble().cloned()
    }

    /// Takes a job; `None` where there is no such ring.
    pub(crate) fn submit(&mut self, ring: usize, job: Job) -> Option<Result<JobId, Refused>> {
        let ring = self.rings.get_mut(ring)?;
        let id = ring.master.submit(job);
        if let Ok(id) = id {
            ring.idle = false;
            ring.results.insert(id, None);
        }
        Some(id)
    }

    /// The master of a ring; `None` where there is no such ring.
    pub(crate) fn master(&mut self, ring: usize) -> Option<&mut AnyMaster> {
        Some(&mut self.rings.get_mut(ring)?.master)
    }

    /// Notes that the master of a ring has something to send that is not a job.
    pub(crate) fn speak(&mut self, ring: usize) {
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.idle = false;
        }
    }

    /// Whether the outcome of a job is known.
    pub(crate) fn has(&self, ring: usize, id: JobId) -> bool {
        let result = self.rings.get(ring).and_then(|ring| ring.results.get(&id));
        matches!(result, Some(Some(_)))
    }

    /// Whether the job was started here and its outcome has not been fetched.
    pub(crate) fn knows(&self, ring: usize, id: JobId) -> bool {
        self.rings
            .get(ring)
            .is_some_and(|ring| ring.results.contains_key(&id))
    }

    pub(crate) fn take(&mut self, ring: usize, id: JobId) -> Option<Outcome> {
        if !self.has(ring, id) {
            return None;
        }
        self.rings.get_mut(ring)?.results.remove(&id)?
    }

    /// Drops the outcome of a job that will not be fetched.
    pub(crate) fn forget(&mut self, ring: usize, id: JobId) {
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.results.remove(&id);
        }
    }

    pub(crate) fn take_log(&mut self) -> Vec<(usize, Event)> {
        std::mem::take(&mut self.log)
    }

    /// Processes received bytes and due time-outs without letting time pass. Returns whether a master has reported something.
    pub(crate) fn poll(&mut self) -> bool {
        let now = self.link.now();
        let mut news = false;
        for (index, ring) in self.rings.iter_mut().enumerate() {
            while let Some((at, received)) = self.link.receive_octet(index) {
                ring.master.handle_byte(at, received);
            }
            if ring.master.poll_timeout().is_some_and(|due| due <= now) {
                ring.master.handle_timeout(now);
            }
            while let Some(event) = ring.master.poll_event() {
                news = true;
                match &event {
                    Event::Ended { id, outcome } => {
                        // The outcome of a forgotten job is dropped.
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
        news
    }

    /// Sends what the lines are free for and lets time pass until the next byte is due or something is reported, at most until `end`.
    /// For callers that wait for a report.
    pub(crate) fn step(&mut self, end: Instant) {
        self.work(end, true);
    }

    /// The same for callers that wait only for `end`.
    pub(crate) fn pass(&mut self, end: Instant) {
        self.work(end, false);
    }

    /// In real time, hands over enough bytes to keep the line busy for a while without this program.
    pub(crate) fn keep(&mut self) {
        if self.link.lead() != Lead::NONE {
            self.work(self.link.now(), false);
        }
    }

    fn work(&mut self, end: Instant, awaited: bool) {
        let mut news = self.poll();
        let rings = 0..self.rings.len();
        let until = rings.fold(end, |until, ring| until.min(self.transmit(ring, awaited)));
        let now = self.link.now();
        self.still
            .look(now, if awaited { Instant::START } else { now });
        while !news && self.link.now() < until && self.link.trouble().is_none() {
            self.link.wait(until);
            self.still.look(self.link.now(), until);
            news = self.poll();
        }
    }

    /// Hands over the bytes that may be handed over now, and returns when there will be more.
    ///
    /// In real time, while an answer is `awaited` and the master is idle, SYNCO reaches only to the time at which the answer is due, plus
    /// [`Lead::near`]: the next job would have to wait behind more SYNCO. If no job has come a byte time after the answer was due, SYNCO
    /// goes on.
    fn transmit(&mut self, index: usize, awaited: bool) -> Instant {
        let now = self.link.now();
        let byte_time = self.link.byte_time();
        let lead = self.link.lead();
        let ring = &mut self.rings[index];
        let round = byte_time * u64::from(ring.master.ring().drives());
        let far = now + lead.far;
        let mut bytes = Vec::new();
        let next = loop {
            // Without a lead, or with `near` at its maximum, SYNCO is not held back.
            if awaited && ring.idle && lead.near < lead.far {
                let again = ring.home + byte_time;
                let enough = match now < again {
                    true => ring.free >= ring.home + lead.near,
                    false => ring.free > now + lead.near,
                };
                if enough {
                    break (ring.free - lead.near).max(again);
                }
            }
            if ring.free > far || self.link.trouble().is_some() {
                // Refill at half of the lead, so that many bytes go out at a time.
                break ring.free - Span::from_nanos(lead.far.as_nanos() / 2);
            }
            // The time at which the byte leaves, not the time at which it is handed over.
            let start = ring.free.max(now);
            let idle = ring.master.counters().idle;
            let Some(byte) = ring.master.poll_transmit(start) else {
                ring.free = ring.free.max(now + byte_time);
                break now + byte_time;
            };
            bytes.push(byte);
            ring.free = start + byte_time;
            ring.idle = ring.master.counters().idle > idle;
            if !ring.idle {
                ring.home = ring.free + round;
            }
        };
        if bytes.is_empty() {
            return next;
        }
        // If a fault holds the line, everything is later than computed. If the link carries nothing, bytes take no time.
        let free = self.link.send_octets(index, &bytes);
        let held = free.since(ring.free);
        ring.free = free;
        ring.home += held;
        if awaited {
            self.link.attend(index, ring.home);
        }
        next + held
    }

    /// When the link wants a pause next.
    pub(crate) fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due()
    }

    /// If the link wants a pause and no job is under way, waits until all bytes are back and grants the pause.
    pub(crate) fn pause(&mut self) {
        let now = self.link.now();
        let due = self.link.pause_due().is_some_and(|due| due <= now);
        if due && self.rings.iter().all(|ring| ring.master.jobs() == 0) {
            self.drain(now + PAUSE);
            self.link.pause();
        }
    }

    /// Sends nothing more and waits until all bytes are back, at most until `end`.
    pub(crate) fn drain(&mut self, end: Instant) {
        let under_way = |ring: &PumpedRing| ring.master.under_way() > 0;
        self.poll();
        while self.halt().is_none() && self.rings.iter().any(under_way) && self.link.now() < end {
            let missed = self.rings.iter().filter_map(|r| r.master.poll_timeout());
            let until = missed.fold(end, Instant::min);
            let until = until.max(self.link.now() + self.link.byte_time());
            self.link.wait(until.min(end));
            self.poll();
        }
    }
}

#[cfg(test)]
#[path = "pump_tests.rs"]
mod tests;
