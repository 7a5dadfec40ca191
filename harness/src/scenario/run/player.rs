//! Step by step.

use super::halt::Halt;
use super::outcome::{Difference, Outcome, Stop};
use super::{Shown, matches, resolve, show};
use crate::buses::novobus::language::run::record::Recorder;
use crate::link::{Capability, Link, Moment, Octets};
use crate::scenario::pattern::Expected;
use crate::scenario::plan::{Plan, PlannedAction, PlannedStep, PlannedWhen, PlannedWindow};
use crate::scenario::problem::Span;
use crate::scenario::run::skip::lacks;
use crate::scenario::syntax::Ending;
use crate::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::master::Fault;
use harness_proto::time::{self, Instant};
use std::collections::{BTreeMap, BTreeSet};

/// How long bytes may be on their way round: more than the most that a scenario can send takes at 9600
/// bit/s, with the longest delays.
pub(crate) const MAX_ROUND: time::Span = time::Span::from_millis(3_600_000);

/// How long a link may need for a pause.
const PAUSE: time::Span = time::Span::from_millis(50);

/// Bytes that no line asks for shown at most.
const UNASKED: usize = 16;

/// What to do at a line that is not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtMismatch {
    /// Send nothing more.
    Stop,
    /// Go on with the lines behind it: for a trace of the whole conversation.
    GoOn,
}

/// Plays a plan on a link up to its end or to the first line that is not met.
pub fn run(plan: &Plan, link: &mut dyn Link) -> Outcome {
    play(plan, link, AtMismatch::Stop)
}

/// Plays a plan on a link. The outcome tells of the first line that was not met.
pub fn play(plan: &Plan, link: &mut dyn Link, at_mismatch: AtMismatch) -> Outcome {
    if let Some(lacks) = lacks(plan, link) {
        return Outcome::skipped(lacks);
    }
    let mut runner = Runner::new(plan, link, at_mismatch);
    let result = runner.play();
    let result = runner.wind_up(result);
    let remarks = runner
        .link
        .unused_faults()
        .into_iter()
        .map(|fault| format!("this fault never happened: {fault}"))
        .collect();
    let took = runner.link.now().since_start();
    let (verdict, finding) = match result {
        Ok(()) => (Verdict::Passed, None),
        Err(Stop { verdict, finding }) => (verdict, Some(*finding)),
    };
    Outcome {
        verdict,
        finding,
        remarks,
        took,
        records: runner.recorder.records,
        unready: None,
        skip: None,
    }
}

/// What the master has received from one ring.
#[derive(Default)]
pub(crate) struct RingRecord {
    pub(crate) received: Vec<(Instant, Received)>,
    /// The first byte that no line has asked for yet.
    pub(crate) next: usize,
    /// The first byte behind the last check sequence.
    pub(crate) since_recovery: usize,
    /// What was sent, and whether no fault was put on it at the master's end.
    pub(crate) sent: Vec<(u8, bool)>,
}

pub(crate) struct Runner<'a> {
    pub(crate) link: &'a mut dyn Link,
    pub(crate) plan: &'a Plan,
    at_mismatch: AtMismatch,
    strict: bool,
    /// Why nothing more can be played: the recording is full, or the link is in trouble.
    pub(crate) full: Option<Halt>,
    /// The first check on something that the link does not show.
    pub(crate) unseen: Option<Stop>,
    pub(crate) recorder: Recorder,
    /// Cells that were read over the bus, where the link does not show them.
    pub(crate) seen: BTreeMap<(usize, u8, u16), u8>,
    /// Drives that have just answered a telegram, where the link does not show the error mode.
    pub(crate) answers: BTreeSet<(usize, u8)>,
    /// Drives whose error mode taps have just shown, with its cause; `None` where they are not in it.
    pub(crate) tapped: BTreeMap<(usize, u8), Option<BusError>>,
    pub(crate) rings: Vec<RingRecord>,
    /// When the line before was done.
    pub(crate) line_before: Instant,
    deadline: time::Span,
    pub(crate) corrected: u64,
    /// The faults that the driver reported in its last job, in order.
    pub(crate) disturbed: Vec<Fault>,
    /// How the commands of that job have ended.
    pub(crate) ended: Vec<Ending>,
    /// The commands that each ring was sent by the driver; `None` where there may be others.
    pub(crate) asked: Vec<Option<Vec<(u8, Command)>>>,
    /// When the driver last left the line of a ring free in the middle of its work, if it did.
    pub(crate) gap: Option<Instant>,
    pub(crate) sent: u64,
    pub(crate) sent_from: Instant,
    pub(crate) sent_to: Instant,
    /// The step that is under way, or the last one.
    pub(crate) place: Span,
}

impl<'a> Runner<'a> {
    pub(crate) fn new(plan: &'a Plan, link: &'a mut dyn Link, at_mismatch: AtMismatch) -> Self {
        Self {
            rings: plan.rings.iter().map(|_| RingRecord::default()).collect(),
            line_before: link.now(),
            deadline: plan.deadline,
            corrected: 0,
            disturbed: Vec::new(),
            ended: Vec::new(),
            asked: plan.rings.iter().map(|_| Some(Vec::new())).collect(),
            gap: None,
            sent: 0,
            sent_from: link.now(),
            sent_to: link.now(),
            link,
            plan,
            at_mismatch,
            strict: plan.strict,
            full: None,
            unseen: None,
            recorder: Recorder::default(),
            seen: BTreeMap::new(),
            answers: BTreeSet::new(),
            tapped: BTreeMap::new(),
            place: Span::default(),
        }
    }
}

impl Runner<'_> {
    fn play(&mut self) -> Result<(), Stop> {
        let plan = self.plan;
        self.place = plan.steps.first().map_or(Span::default(), |step| step.span);
        self.halted()?;
        for (ring, drives, influence) in plan.influences() {
            influence.act(self.link, ring, drives);
        }
        // A fault at a byte is armed from the start, wherever its line stands: its byte is counted
        // from the start too.
        for step in &plan.steps {
            if let PlannedAction::Fault(ring, fault, moment @ (Moment::Byte(_) | Moment::At(_))) =
                step.action
            {
                self.place = step.span;
                self.link.inject(ring, fault, moment);
                self.halted()?;
            }
        }
        let mut first = Ok(());
        for step in &plan.steps {
            self.place = step.span;
            let result = self.step(step);
            self.halted()?;
            first = first.and(result);
            if first.is_err() && self.at_mismatch == AtMismatch::Stop {
                return first;
            }
        }
        self.settle();
        first.and_then(|()| self.nothing_unasked(self.place))
    }

    fn step(&mut self, step: &PlannedStep) -> Result<(), Stop> {
        self.link.step(step.span.start);
        if let PlannedAction::Receive(ring, expected) = &step.action {
            return self.receive(step, *ring, expected);
        }
        let in_time = self.pass_until_due(step);
        if in_time.is_err() && self.at_mismatch == AtMismatch::Stop {
            return in_time;
        }
        in_time.and(self.act(step))
    }

    /// Lets time pass until a step with a time in front is due.
    fn pass_until_due(&mut self, step: &PlannedStep) -> Result<(), Stop> {
        let at = match step.when {
            PlannedWhen::Now => return Ok(()),
            PlannedWhen::After(window) => self.line_before + window.from,
            PlannedWhen::At(window) => Instant::START + window.from,
        };
        let now = self.link.now();
        if at + self.link.time_tolerance() < now {
            return Err(Stop::aborted(
                step.span,
                format!("this line is for {at}, but the lines before it took until {now}"),
            ));
        }
        self.pass_until(at);
        self.line_before = at;
        Ok(())
    }

    fn act(&mut self, step: &PlannedStep) -> Result<(), Stop> {
        match &step.action {
            PlannedAction::Send(ring, bytes) => {
                self.not_the_driver(*ring);
                self.send(*ring, bytes);
                Ok(())
            }
            PlannedAction::Fault(ring, fault, Moment::Now) => {
                // With a time in front it is the byte at that time, without one the first byte of the lines behind.
                let moment = match step.when {
                    PlannedWhen::Now => Moment::Now,
                    _ => Moment::At(self.link.now()),
                };
                self.link.inject(*ring, *fault, moment);
                Ok(())
            }
            PlannedAction::Fault(..) | PlannedAction::Receive(..) => Ok(()),
            PlannedAction::Influence(ring, drives, influence) => {
                influence.act(self.link, *ring, drives.clone());
                Ok(())
            }
            PlannedAction::Record(record) => {
                self.record(record);
                Ok(())
            }
            PlannedAction::Wait(time) => {
                self.line_before = self.line_before.max(self.link.now()) + *time;
                self.pass_until(self.line_before);
                Ok(())
            }
            PlannedAction::Until(check, within) => self.until(check, *within, step.span),
            PlannedAction::Check(check) => {
                if step.when == PlannedWhen::Now {
                    self.settle();
                    self.line_before = self.line_before.max(self.link.now());
                }
                let result = self.check(check, step.when != PlannedWhen::Now, step.span);
                self.sent = 0;
                result
            }
            PlannedAction::Telegram(ring, bytes, expected, reading) => {
                self.not_the_driver(*ring);
                self.settle();
                let asked = self.nothing_unasked(step.span);
                if asked.is_err() && self.at_mismatch == AtMismatch::Stop {
                    return asked;
                }
                self.forget(*ring);
                self.send(*ring, bytes);
                asked
                    .and(self.expect(step.span, *ring, expected, None))
                    .and_then(|()| self.read(*ring, expected.len(), reading.as_ref(), step.span))
            }
            PlannedAction::Recover(ring) => self.recover(*ring, step.span),
            PlannedAction::Master(ring, calls, once) => self.master(*ring, calls, *once, step.span),
            PlannedAction::Count(ring, drives) => self.count(*ring, *drives, step.span),
        }
    }

    pub(crate) fn send(&mut self, ring: usize, bytes: &[u8]) -> Instant {
        if self.sent == 0 {
            self.sent_from = self.link.now().max(self.sent_to);
        }
        self.sent += bytes.len() as u64;
        let good = |byte| (byte, true);
        if let Some(record) = self.rings.get_mut(ring) {
            record.sent.extend(bytes.iter().copied().map(good));
        }
        self.line_before = self.link.send_octets(ring, bytes);
        self.sent_to = self.line_before;
        self.sent_to
    }

    /// Takes the next received byte that no step has taken.
    pub(crate) fn take_next(&mut self, ring: usize) -> Option<(Instant, Received)> {
        self.fetch();
        let record = &mut self.rings[ring];
        let byte = record.received.get(record.next).copied()?;
        record.next += 1;
        Some(byte)
    }

    /// Lets time pass up to `until`, with a pause for the link where it wants one and there is room for it.
    pub(crate) fn pass_until(&mut self, until: Instant) {
        while self.link.now() < until && self.full.is_none() {
            let due = self.link.pause_due();
            let due = due.filter(|due| *due + PAUSE < until && !self.link.busy());
            if due.is_some_and(|due| due <= self.link.now()) {
                self.pause();
                continue;
            }
            self.wait(due.map_or(until, |due| due.min(until)));
        }
    }

    /// Lets the link query drives, if nothing is under way. No line expects the answers.
    pub(crate) fn pause(&mut self) {
        self.fetch();
        if !self.link.busy() {
            self.link.pause();
        }
    }

    /// Lets time pass until everything that was sent has come round (or has been lost).
    pub(crate) fn settle(&mut self) {
        let end = self.link.now() + MAX_ROUND;
        while self.link.busy() && self.link.now() < end && self.wait(end) {}
        self.fetch();
    }

    /// Lets time pass until something happens. False where nothing will, or where the record is full.
    pub(crate) fn wait(&mut self, until: Instant) -> bool {
        loop {
            self.notice();
            if self.full.is_some() {
                self.fetch();
                return false;
            }
            // Time stops on its way where a cell is to be looked at.
            let more = self.link.wait(until.min(self.recorder.next()));
            self.note();
            self.fetch();
            if more || self.link.now() >= until {
                return more;
            }
        }
    }

    pub(crate) fn fetch(&mut self) {
        for (index, record) in self.rings.iter_mut().enumerate() {
            while let Some(byte) = self.link.receive_octet(index) {
                record.received.push(byte);
                if ends_with_sequence(&record.received[record.since_recovery..]) {
                    record.since_recovery = record.received.len();
                    self.corrected += 1;
                }
            }
        }
    }

    /// Bytes that no line has asked for are none of the next line's business.
    pub(crate) fn forget(&mut self, ring: usize) {
        self.rings[ring].next = self.rings[ring].received.len();
    }

    fn receive(
        &mut self,
        step: &PlannedStep,
        ring: usize,
        expected: &[Expected],
    ) -> Result<(), Stop> {
        let window = match step.when {
            PlannedWhen::Now => None,
            PlannedWhen::After(window) => Some((self.line_before, window)),
            PlannedWhen::At(window) => Some((Instant::START, window)),
        };
        self.expect(step.span, ring, expected, window)
    }

    /// The next bytes must be these; with a window, the first of them must come in it.
    fn expect(
        &mut self,
        span: Span,
        ring: usize,
        expected: &[Expected],
        window: Option<(Instant, PlannedWindow)>,
    ) -> Result<(), Stop> {
        let first = self.rings[ring].next;
        let tolerance = self.link.time_tolerance();
        for index in 0..expected.len() {
            let until = match window {
                Some((base, window)) if index == 0 => {
                    base + window.to + window.tolerance + tolerance
                }
                _ => self.link.now().max(self.line_before) + self.deadline,
            };
            let arrived = self.next_byte(ring, first + index, until);
            if arrived.is_none() {
                // It may only be late.
                self.settle();
            }
            let received = &self.rings[ring].received[first..];
            let difference = || Difference {
                ring,
                byte: first + index + 1,
                at: received.get(index).map(|(at, _)| *at),
                index,
                // A checking byte is shown as the byte that it must be, where that is known.
                expected: (0..expected.len())
                    .map(|i| match received.get(..i) {
                        Some(before) => resolve(expected[i], before),
                        None => expected[i],
                    })
                    .collect(),
                received: received.iter().map(|(_, byte)| *byte).collect(),
            };
            let Some((at, byte)) = arrived else {
                if let Some((at, byte)) = received.get(index) {
                    let byte = show(*byte);
                    let message = format!("{byte} came at {at}, expected at {until} at the latest");
                    return Err(Stop::failed(span, message));
                }
                let message = format!(
                    "nothing more was received up to {}, where {} is expected",
                    until.min(self.link.now()),
                    Shown(expected[index])
                );
                return Err(Stop::failed(span, message).differs(difference()));
            };
            let wanted = resolve(expected[index], &received[..index]);
            if !matches(wanted, byte) {
                let message = format!(
                    "the master received {} where {} is expected",
                    show(byte),
                    Shown(wanted)
                );
                return Err(Stop::failed(span, message).differs(difference()));
            }
            if let Some((base, window)) = window.filter(|_| index == 0) {
                let earliest = base + window.from - window.tolerance;
                if at + tolerance < earliest {
                    let message = format!(
                        "{} came at {at}, expected at {} at the earliest",
                        show(byte),
                        base + window.from
                    );
                    return Err(Stop::failed(span, message));
                }
            }
            self.rings[ring].next = first + index + 1;
            self.line_before = at;
        }
        Ok(())
    }

    /// Waits for the `index`-th byte received.
    fn next_byte(
        &mut self,
        ring: usize,
        index: usize,
        until: Instant,
    ) -> Option<(Instant, Received)> {
        loop {
            self.fetch();
            if let Some(byte) = self.rings[ring].received.get(index) {
                return Some(*byte).filter(|(at, _)| *at <= until);
            }
            if self.link.now() >= until || !self.wait(until) {
                return None;
            }
        }
    }

    /// ND21 9.8: 17 zeros and the five bytes; they must come back.
    fn recover(&mut self, ring: usize, span: Span) -> Result<(), Stop> {
        self.settle();
        let before = self.corrected;
        self.send(ring, &CHECK_SEQUENCE);
        self.settle();
        self.forget(ring);
        self.line_before = self.link.now();
        if self.corrected > before {
            return Ok(());
        }
        Err(Stop::failed(
            span,
            "the check sequence FF 44 72 4C 41 did not come back (ND21 9.8)",
        ))
    }

    /// A strict scenario asks for every byte.
    fn nothing_unasked(&self, span: Span) -> Result<(), Stop> {
        let rings = self.rings.iter().enumerate().filter(|_| self.strict);
        for (ring, record) in rings {
            let unasked = &record.received[record.next..];
            if let Some((at, byte)) = unasked.first() {
                let message = format!(
                    "{} was received at {at}, but no line asks for it (the scenario is strict)",
                    show(*byte)
                );
                return Err(Stop::failed(span, message).differs(Difference {
                    ring,
                    byte: record.next + 1,
                    at: Some(*at),
                    index: 0,
                    expected: Vec::new(),
                    received: unasked.iter().take(UNASKED).map(|(_, b)| *b).collect(),
                }));
            }
        }
        Ok(())
    }
}

fn ends_with_sequence(received: &[(Instant, Received)]) -> bool {
    received.len() >= SEQUENCE.len()
        && received[received.len() - SEQUENCE.len()..]
            .iter()
            .zip(SEQUENCE)
            .all(|((_, byte), wanted)| byte.is(wanted))
}

/// What a plan needs that a rig may lack, in words.
#[must_use]
pub fn needs(plan: &Plan) -> Vec<&'static str> {
    plan.needs
        .iter()
        .map(|need: &Capability| need.name())
        .collect()
}
