//! The master of one drive: jobs in, frames out, results and named disturbances back.
//!
//! It owns no port and no clock (sans-IO). The caller calls
//!
//! * [`CanMaster::poll_transmit`] whenever the bus takes a frame, and sends the frame that it gives;
//! * [`CanMaster::handle_frame`] with every frame of the bus;
//! * [`CanMaster::handle_timeout`] when [`CanMaster::poll_timeout`] is past;
//! * [`CanMaster::poll_event`] after any of these.
//!
//! # What a master can know
//!
//! A write is never answered, and a reply carries nothing but the number of its register. So one request is under way at a time,
//! and any frame with the asked register ends it, whether it has 4 or 6 bytes. If that register has a cycle, or is STATUS with sending
//! by event, the frame may have been sent for that reason; its contents are as recent.
//! The only check of a write is to read the register: the master does so for registers that hold what is written, unless
//! [`Options::read_back`] says that it must not. A write that is repeated could act twice, so only reads are repeated.
//!
//! A cycle is started when its first frame has come. From then on its interval is supervised until it is stopped.
//!
//! A new identifier in 68 may be used at once or at the next power-up (`id-change`). After a write to 68 the master asks at the new
//! identifier, and where no reply comes at the old one. It takes replies on the old and the new identifier of 69 until a frame
//! on the new one has come.

mod job;
mod slots;

pub use job::{Disturbance, Job, JobNumber, JobRefusal, MasterEvent, Options, Outcome};
pub use slots::Slot;

use super::frame::{CYCLES, Data, NoReply, Reply, Request};
use super::register::{Access, Register};
use super::words::{MODE_EVENT, MODE_LOCK};
use crate::can::Frame;
use crate::time::{Instant, Span};
use alloc::collections::VecDeque;
use slots::{FrameTiming, Slots};

/// Most jobs that wait.
const MOST_JOBS: usize = 256;
/// Most events that wait to be fetched; results are not counted.
const MOST_EVENTS: usize = 256;
/// How often a start-up asks for a bit that is not yet 1.
const POLL: Span = Span::from_millis(10);

/// The master.
#[derive(Clone, Debug)]
pub struct CanMaster {
    options: Options,
    /// The identifier to which it sends; after a write to 68 the old one as well.
    rx: (u16, Option<u16>),
    /// The identifier from which it takes replies; after a write to 69 the old one as well.
    tx: (u16, Option<u16>),
    /// The lower half of MODE as it was last written, for a lock that keeps sending by event.
    mode: u16,
    queue: VecDeque<(JobNumber, Job)>,
    next_id: u64,
    current: Option<Current>,
    slots: Slots,
    /// A register whose request may still be answered, and until when.
    owed: Option<(u8, Instant)>,
    events: VecDeque<MasterEvent>,
    other_events: usize,
    lost_events: u64,
}

/// The job under way.
#[derive(Clone, Debug)]
struct Current {
    id: JobNumber,
    job: Job,
    phase: JobPhase,
    /// The step of a start-up.
    step: usize,
    tries: u8,
    begun: Instant,
}

/// What a job waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JobPhase {
    /// Its frame is to be sent.
    Send(Request),
    /// Its frame is to be sent, but not before.
    Rest(Request, Instant),
    /// A frame with this register is to come until then.
    Reply {
        register: u8,
        until: Instant,
        asked: Request,
        /// It checks what was written.
        written: Option<Data>,
    },
}

/// A step of a start-up (ex 11, ex 12).
#[derive(Clone, Copy, Debug)]
enum StartUpStep {
    /// Asks until the register is 1.
    Until(u8),
    Write(u8, u16),
    /// Locks, and keeps sending by event.
    Lock,
    /// Releases the lock, and keeps sending by event.
    Release,
}

/// Ready, lock, no command, hardware enable closed, release. A lock keeps the set points, so they are written first.
const START_UP: [StartUpStep; 6] = [
    StartUpStep::Until(0xE2),
    StartUpStep::Lock,
    StartUpStep::Write(0x31, 0),
    StartUpStep::Write(0x90, 0),
    StartUpStep::Until(0xE8),
    StartUpStep::Release,
];

impl CanMaster {
    /// A master of the drive that receives on `rx` and sends on `tx`.
    #[must_use]
    pub fn new(rx: u16, tx: u16, options: Options) -> Self {
        Self {
            options,
            rx: (rx, None),
            tx: (tx, None),
            mode: 0,
            queue: VecDeque::new(),
            next_id: 0,
            current: None,
            slots: Slots::default(),
            owed: None,
            events: VecDeque::new(),
            other_events: 0,
            lost_events: 0,
        }
    }

    /// Takes a job; it runs after all that were submitted before it.
    ///
    /// # Errors
    /// [`JobRefusal`]; nothing is changed.
    pub fn submit(&mut self, job: Job) -> Result<JobNumber, JobRefusal> {
        if self.queue.len() >= MOST_JOBS {
            return Err(JobRefusal::Full);
        }
        if let Job::Cycle { register, every } = job {
            if !(1..=254).contains(&every) {
                return Err(JobRefusal::Interval);
            }
            let planned = self.planned_cycles(register);
            if planned >= CYCLES {
                return Err(JobRefusal::EightCycles);
            }
        }
        let id = JobNumber(self.next_id);
        self.next_id += 1;
        self.queue.push_back((id, job));
        Ok(id)
    }

    /// Cycles that run or will be started, but that of `register`.
    fn planned_cycles(&self, register: u8) -> usize {
        let mut planned: [bool; 256] = [false; 256];
        for slot in self.slots.iter() {
            planned[usize::from(slot.register)] = true;
        }
        let under_way = self.current.iter().map(|current| &current.job);
        for job in under_way.chain(self.queue.iter().map(|(_, job)| job)) {
            match *job {
                Job::Cycle { register, .. } => planned[usize::from(register)] = true,
                Job::Stop { register } => planned[usize::from(register)] = false,
                _ => {}
            }
        }
        planned[usize::from(register)] = false;
        planned.iter().filter(|planned| **planned).count()
    }

    /// The frame to be sent now, if there is one.
    pub fn poll_transmit(&mut self, now: Instant) -> Option<Frame> {
        if self.current.is_none() {
            let (id, job) = self.queue.pop_front()?;
            self.begin(id, job, now);
        }
        let current = self.current.as_mut()?;
        let request = match current.phase {
            JobPhase::Send(request) => request,
            JobPhase::Rest(request, at) if at <= now => request,
            JobPhase::Rest(..) | JobPhase::Reply { .. } => return None,
        };
        let frame = request.encode(self.rx.0).ok()?;
        self.transmitted(request, now);
        Some(frame)
    }

    fn begin(&mut self, id: JobNumber, job: Job, now: Instant) {
        let first = match job {
            Job::Read { register } => Request::Read { register },
            Job::Write { register, data } => Request::Write { register, data },
            Job::Cycle { register, every } => Request::Cycle { register, every },
            Job::Stop { register } => Request::Stop { register },
            Job::StartUp { .. } => self.step(0),
        };
        self.current = Some(Current {
            id,
            job,
            phase: JobPhase::Send(first),
            step: 0,
            tries: 0,
            begun: now,
        });
    }

    fn step(&self, step: usize) -> Request {
        let short = |register, value| Request::Write {
            register,
            data: Data::Short(value),
        };
        match START_UP[step] {
            StartUpStep::Until(register) => Request::Read { register },
            StartUpStep::Write(register, value) => short(register, value),
            StartUpStep::Lock => short(0x51, self.mode & MODE_EVENT | MODE_LOCK),
            StartUpStep::Release => short(0x51, self.mode & MODE_EVENT),
        }
    }

    /// A frame leaves: what comes next.
    fn transmitted(&mut self, request: Request, now: Instant) {
        let until = now + self.options.time_out;
        match request {
            Request::Read { register } => {
                let written = self.written();
                if let Some(current) = &mut self.current {
                    current.tries += 1;
                    current.phase = JobPhase::Reply {
                        register,
                        until,
                        asked: request,
                        written,
                    };
                }
            }
            Request::Cycle { register, every } => {
                // A frame of an older cycle of the register is no sign of the new one, but its contents are as good.
                self.slots.stop(register, now);
                if let Some(current) = &mut self.current {
                    current.tries += 1;
                    current.phase = JobPhase::Reply {
                        register,
                        until: until + Span::from_millis(every.into()),
                        asked: request,
                        written: None,
                    };
                }
            }
            Request::Stop { register } => {
                self.slots.stop(register, until);
                self.end(Outcome::Sent);
            }
            Request::Write { register, data } => self.wrote(register, data, now),
        }
    }

    /// A write has left.
    fn wrote(&mut self, register: u8, data: Data, now: Instant) {
        let low = (data.bits() & 0xFFFF) as u16;
        match register {
            0x51 => self.mode = low,
            0x68 if (1..=0x7FF).contains(&low) => self.rx = (low, Some(self.rx.0)),
            0x69 if (1..=0x7FF).contains(&low) => self.tx = (low, Some(self.tx.0)),
            _ => {}
        }
        let row = Register::of(register);
        let holds = matches!(row.access, Access::RW | Access::SP);
        if self.options.read_back && holds {
            if let Some(current) = &mut self.current {
                current.tries = 0;
                current.phase = JobPhase::Send(Request::Read { register });
            }
        } else {
            self.done(Outcome::Sent, now);
        }
    }

    /// What the job under way has just written, if it is being read back.
    fn written(&self) -> Option<Data> {
        let current = self.current.as_ref()?;
        match current.job {
            Job::Write { data, .. } => Some(data),
            Job::StartUp { .. } => match self.step(current.step) {
                Request::Write { data, .. } => Some(data),
                _ => None,
            },
            _ => None,
        }
    }

    /// A step has ended: the next one, or the end of the job.
    fn done(&mut self, outcome: Outcome, now: Instant) {
        let last = match &self.current {
            Some(current) => match current.job {
                Job::StartUp { .. } => current.step + 1 == START_UP.len(),
                _ => true,
            },
            None => return,
        };
        let carry_on = matches!(
            outcome,
            Outcome::Sent | Outcome::Read(_) | Outcome::Written(_)
        );
        if last || !carry_on {
            return self.end(if last && carry_on && self.is_start_up() {
                Outcome::Released
            } else {
                outcome
            });
        }
        let next = self.current.as_ref().map_or(0, |current| current.step + 1);
        let request = self.step(next);
        if let Some(current) = &mut self.current {
            current.step = next;
            current.tries = 0;
            current.begun = now;
            current.phase = JobPhase::Send(request);
        }
    }

    fn is_start_up(&self) -> bool {
        let job = self.current.as_ref().map(|current| &current.job);
        matches!(job, Some(Job::StartUp { .. }))
    }

    fn end(&mut self, outcome: Outcome) {
        if let Some(current) = self.current.take() {
            self.events.push_back(MasterEvent::Ended {
                id: current.id,
                outcome,
            });
        }
    }

    /// Takes a frame of the bus; frames of other identifiers are not the master's.
    pub fn handle_frame(&mut self, now: Instant, frame: &Frame) {
        let reply = match Reply::decode(frame, self.tx.0) {
            Err(NoReply::OtherIdentifier) => match self.tx.1.map(|old| Reply::decode(frame, old)) {
                Some(reply) => reply,
                None => return,
            },
            reply => {
                // The drive uses its new identifier.
                if reply.is_ok() {
                    self.tx.1 = None;
                }
                reply
            }
        };
        let reply = match reply {
            Ok(reply) => reply,
            Err(NoReply::OtherIdentifier) => return,
            Err(odd) => return self.report(MasterEvent::Disturbance(Disturbance::Odd(odd))),
        };
        let answers = self.answers(now, reply);
        let status = reply.register == 0x40 && self.mode & MODE_EVENT != 0;
        let tolerance = self.options.cycle_tolerance;
        match self.slots.heard(now, reply.register, tolerance) {
            FrameTiming::Due => self.report(MasterEvent::Cyclic { reply }),
            _ if answers => {}
            FrameTiming::Stopped => {}
            _ if self.is_owed(now, reply.register) => {}
            _ if status => self.report(MasterEvent::Status { reply }),
            FrameTiming::Early(after) => {
                let register = reply.register;
                self.report(MasterEvent::Disturbance(Disturbance::Early {
                    register,
                    after,
                }));
            }
            FrameTiming::Other => {
                self.report(MasterEvent::Disturbance(Disturbance::Unasked { reply }))
            }
        }
    }

    /// Whether this is the reply to a request that a cyclic frame or an event frame has ended already.
    fn is_owed(&mut self, now: Instant, register: u8) -> bool {
        let owed = self.owed.take_if(|(of, _)| *of == register);
        owed.is_some_and(|(_, until)| now <= until)
    }

    /// Whether the job under way waited for this.
    fn answers(&mut self, now: Instant, reply: Reply) -> bool {
        let Some(current) = &self.current else {
            return false;
        };
        let JobPhase::Reply {
            register, written, ..
        } = current.phase
        else {
            return false;
        };
        if register != reply.register {
            return false;
        }
        let (begun, job) = (current.begun, current.job);
        let by_event = register == 0x40 && self.mode & MODE_EVENT != 0;
        if by_event || self.slots.iter().any(|slot| slot.register == register) {
            self.owed = Some((register, now + self.options.time_out));
        }
        // It answered at this identifier.
        self.rx.1 = None;
        match (job, written) {
            (Job::Cycle { register, every }, _) => {
                self.slots.start(now, register, every);
                self.end(Outcome::Started(reply));
            }
            (Job::StartUp { patience }, None) => self.waited(now, begun + patience, reply),
            (_, Some(data)) if !holds(data, &reply) => self.done(
                Outcome::Differs {
                    wrote: data,
                    reads: reply,
                },
                now,
            ),
            (_, Some(_)) => self.done(Outcome::Written(reply), now),
            (_, None) => self.done(Outcome::Read(reply), now),
        }
        true
    }

    /// A start-up asked for a bit.
    fn waited(&mut self, now: Instant, end: Instant, reply: Reply) {
        if reply.data.bits() & 0xFFFF == 1 {
            self.done(Outcome::Read(reply), now);
        } else if now >= end {
            self.end(Outcome::NotReady(reply));
        } else if let Some(current) = &mut self.current {
            let again = Request::Read {
                register: reply.register,
            };
            current.tries = 0;
            current.phase = JobPhase::Rest(again, now + POLL);
        }
    }

    /// When [`CanMaster::handle_timeout`], or [`CanMaster::poll_transmit`] for a frame that had to wait, is due.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let job = match self.current.as_ref().map(|current| current.phase) {
            Some(JobPhase::Reply { until, .. }) => Some(until),
            Some(JobPhase::Rest(_, at)) => Some(at),
            Some(JobPhase::Send(_)) | None => None,
        };
        let slot = self.slots.next_missing(self.options.cycle_tolerance);
        [job, slot].into_iter().flatten().min()
    }

    /// The time is `now`: requests without a reply are repeated or given up, and missing cyclic frames are reported.
    pub fn handle_timeout(&mut self, now: Instant) {
        while let Some(disturbance) = self.slots.missing(now, self.options.cycle_tolerance) {
            self.report(MasterEvent::Disturbance(disturbance));
        }
        let Some(current) = &mut self.current else {
            return;
        };
        let JobPhase::Reply { until, asked, .. } = current.phase else {
            return;
        };
        if until > now {
            return;
        }
        if current.tries <= self.options.repeats {
            current.phase = JobPhase::Send(asked);
            // Behind a write to 68 the old and the new identifier are tried in turn.
            if let Some(other) = self.rx.1 {
                self.rx = (other, Some(self.rx.0));
            }
            return;
        }
        let tries = current.tries;
        self.end(Outcome::NoReply { tries });
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<MasterEvent> {
        let event = self.events.pop_front()?;
        if !matches!(event, MasterEvent::Ended { .. }) {
            self.other_events -= 1;
        }
        Some(event)
    }

    fn report(&mut self, event: MasterEvent) {
        if self.other_events >= MOST_EVENTS {
            self.lost_events += 1;
            return;
        }
        self.other_events += 1;
        self.events.push_back(event);
    }

    /// The identifiers to which it sends and from which it takes replies.
    #[must_use]
    pub const fn identifiers(&self) -> (u16, u16) {
        (self.rx.0, self.tx.0)
    }

    /// The cycles under supervision.
    pub fn slots(&self) -> impl Iterator<Item = &Slot> {
        self.slots.iter()
    }

    /// Whether no job waits or is under way.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.current.is_none() && self.queue.is_empty()
    }

    /// Events that were dropped because they were not fetched in time; results never are.
    #[must_use]
    pub const fn lost_events(&self) -> u64 {
        self.lost_events
    }
}

/// Whether a register reads as it was written: in the bits that both the write and the reply have.
///
/// 16 bits to a register of 32 count in the lower half only: what becomes of the upper one is open (`short-write`).
fn holds(wrote: Data, reads: &Reply) -> bool {
    let register = Register::of(reads.register);
    let mask = match (wrote, reads.data) {
        (Data::Long(_), Data::Long(_)) => register.mask(),
        _ => 0xFFFF,
    };
    (wrote.bits() ^ reads.data.bits()) & mask == 0
}
