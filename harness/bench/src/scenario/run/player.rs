//! Step by step.

use super::halt::Halt;
use super::outcome::{Outcome, Stop};
use super::skip::lacks;
use crate::link::{Capability, Link, Moment, PlacedFault};
use crate::scenario::language::Language;
use crate::scenario::plan::{Plan, PlannedAction, PlannedStep, PlannedWhen, PlannedWindow};
use crate::scenario::problem::TextSpan;
use crate::scenario::verdict::Verdict;
use harness_proto::time::{Instant, Span};
use std::sync::atomic::AtomicBool;

/// How long bytes may be on their way round: more than the most that a scenario can send takes at 9600
/// bit/s, with the longest delays.
pub(crate) const MAX_ROUND: Span = Span::from_millis(3_600_000);

/// How long a link may need for a pause.
const PAUSE: Span = Span::from_millis(50);

/// What to do at a line that is not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtMismatch {
    /// Send nothing more.
    Stop,
    /// Go on with the lines after it: for a trace of the whole conversation.
    GoOn,
}

/// Plays a plan on a link up to its end or to the first line that is not met.
pub fn run<L: Language>(plan: &Plan<L>, link: &mut dyn Link) -> Outcome {
    play(plan, link, AtMismatch::Stop)
}

/// Plays a plan on a link. The outcome tells of the first line that was not met.
pub fn play<L: Language>(plan: &Plan<L>, link: &mut dyn Link, at_mismatch: AtMismatch) -> Outcome {
    play_until(plan, link, at_mismatch, &AtomicBool::new(false))
}

/// The same, aborted once `interrupt` is set: for a link that does not look at it itself.
pub fn play_until<L: Language>(
    plan: &Plan<L>,
    link: &mut dyn Link,
    at_mismatch: AtMismatch,
    interrupt: &AtomicBool,
) -> Outcome {
    if let Some(lacks) = lacks(plan, link) {
        return Outcome::skipped(lacks);
    }
    let mut runner = Runner::new(plan, link, at_mismatch);
    runner.interrupt = Some(interrupt);
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
        unmet: runner.unmet,
        remarks,
        took,
        records: L::records(runner.own),
        unready: None,
        shows_nothing: false,
        skip: None,
    }
}

/// What the master has received on one port.
pub struct PortState<L: Language> {
    pub received: Vec<(Instant, L::Received)>,
    /// The first piece that no line has asked for yet.
    pub next: usize,
}

/// A plan that is being played. What a bus keeps of its own meanwhile is in `own`.
pub struct Runner<'a, L: Language> {
    pub link: &'a mut dyn Link,
    pub plan: &'a Plan<L>,
    at_mismatch: AtMismatch,
    unmet: Vec<usize>,
    /// Ends the conversation when it is set.
    pub interrupt: Option<&'a AtomicBool>,
    strict: bool,
    /// Why nothing more can be played: the recording is full, or the link is in trouble.
    pub full: Option<Halt>,
    /// The first check on something that the link does not show.
    pub unseen: Option<Stop>,
    pub ports: Vec<PortState<L>>,
    /// When the line before was done.
    pub line_before: Instant,
    deadline: Span,
    /// The step that is under way, or the last one.
    pub place: TextSpan,
    pub own: L::State,
}

impl<'a, L: Language> Runner<'a, L> {
    pub fn new(plan: &'a Plan<L>, link: &'a mut dyn Link, at_mismatch: AtMismatch) -> Self {
        let port = |_| PortState {
            received: Vec::new(),
            next: 0,
        };
        Self {
            ports: (0..L::ports(plan)).map(port).collect(),
            line_before: link.now(),
            deadline: plan.deadline,
            own: L::state(plan, link),
            link,
            plan,
            at_mismatch,
            unmet: Vec::new(),
            interrupt: None,
            strict: plan.strict,
            full: None,
            unseen: None,
            place: TextSpan::default(),
        }
    }
}

impl<L: Language> Runner<'_, L> {
    fn play(&mut self) -> Result<(), Stop> {
        let plan = self.plan;
        self.place = plan
            .steps
            .first()
            .map_or(TextSpan::default(), |step| step.span);
        self.halted()?;
        L::begin(self)?;
        let mut first = Ok(());
        for step in &plan.steps {
            self.place = step.span;
            let result = self.step(step);
            self.halted()?;
            self.unmet
                .extend(result.is_err().then_some(step.span.start));
            first = first.and(result);
            if first.is_err() && self.at_mismatch == AtMismatch::Stop {
                return first;
            }
        }
        self.settle();
        let last = self.nothing_unasked(self.place);
        self.unmet.extend(last.is_err().then_some(self.place.start));
        first.and(last)
    }

    fn step(&mut self, step: &PlannedStep<L>) -> Result<(), Stop> {
        self.link.step(step.span.start);
        if let PlannedAction::Receive(ring, expected) = &step.action {
            let received = self.receive(step, *ring, expected);
            if received.is_err() && self.at_mismatch == AtMismatch::GoOn {
                // The next line is about what follows it.
                self.settle();
                self.forget(*ring);
            }
            return received;
        }
        let in_time = self.pass_until_due(step);
        if in_time.is_err() && self.at_mismatch == AtMismatch::Stop {
            return in_time;
        }
        in_time.and(self.act(step))
    }

    /// Lets time pass until a step with a time in front is due.
    fn pass_until_due(&mut self, step: &PlannedStep<L>) -> Result<(), Stop> {
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

    fn act(&mut self, step: &PlannedStep<L>) -> Result<(), Stop> {
        match &step.action {
            PlannedAction::Send(port, pieces) => {
                self.send(*port, pieces);
                Ok(())
            }
            PlannedAction::Receive(..) => Ok(()),
            PlannedAction::Wait(time) => {
                self.line_before = self.line_before.max(self.link.now()) + *time;
                self.pass_until(self.line_before);
                Ok(())
            }
            PlannedAction::Own(act) => L::act(self, act, step),
        }
    }

    /// Whether playing stops at the first line that is not met.
    pub fn stops_at_mismatch(&self) -> bool {
        self.at_mismatch == AtMismatch::Stop
    }

    /// Sends the pieces of a `>` line. Returns when the last one will have left.
    pub fn send(&mut self, port: usize, pieces: &[L::Sent]) -> Instant {
        L::by_hand(&mut self.own, port);
        self.transmit(port, pieces)
    }

    /// Sends pieces of a line or of a job. Returns when the last one will have left.
    pub fn transmit(&mut self, port: usize, pieces: &[L::Sent]) -> Instant {
        let from = self.link.now();
        self.line_before = L::transmit(self.link, port, pieces);
        L::sent(&mut self.own, port, pieces, (from, self.line_before));
        self.line_before
    }

    /// Takes the next received byte that no step has taken.
    pub fn take_next(&mut self, port: usize) -> Option<(Instant, L::Received)> {
        self.fetch();
        let port = &mut self.ports[port];
        let piece = port.received.get(port.next).copied()?;
        port.next += 1;
        Some(piece)
    }

    /// Lets time pass up to `until`, with a pause for the link where it wants one and there is room for it.
    pub fn pass_until(&mut self, until: Instant) {
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
    pub fn pause(&mut self) {
        self.fetch();
        if !self.link.busy() {
            self.link.pause();
        }
    }

    /// Injects faults, or what happens to drives, at once; where it `settles`, when everything that was sent has left and is answered.
    pub fn happen(&mut self, settles: bool, faults: &[PlacedFault]) {
        if settles {
            self.settle();
        }
        for fault in faults {
            self.link.inject(0, *fault, Moment::Now);
        }
        self.line_before = self.line_before.max(self.link.now());
    }

    /// Lets time pass until everything that was sent has returned or is lost.
    pub fn settle(&mut self) {
        let end = self.link.now() + L::ROUND;
        while self.link.busy() && self.link.now() < end && self.wait(end) {}
        self.fetch();
    }

    /// Lets time pass until something happens. False where nothing will, or where the record is full.
    pub fn wait(&mut self, until: Instant) -> bool {
        loop {
            self.notice();
            if self.full.is_some() {
                self.fetch();
                return false;
            }
            // Time stops on its way where the bus wants to look at something.
            let more = self.link.wait(until.min(L::next_look(&self.own)));
            L::look(self);
            self.fetch();
            if more || self.link.now() >= until {
                return more;
            }
        }
    }

    pub fn fetch(&mut self) {
        for (index, port) in self.ports.iter_mut().enumerate() {
            while let Some(piece) = L::fetch(&mut self.own, self.link, index) {
                port.received.push(piece);
                L::received(&mut self.own, index, &port.received);
            }
        }
    }

    /// Drops input that no line expects, so that the next line does not see it.
    pub fn forget(&mut self, port: usize) {
        self.ports[port].next = self.ports[port].received.len();
    }

    fn receive(
        &mut self,
        step: &PlannedStep<L>,
        port: usize,
        wanted: &[L::Wanted],
    ) -> Result<(), Stop> {
        let window = match step.when {
            PlannedWhen::Now => None,
            PlannedWhen::After(window) => Some((self.line_before, window)),
            PlannedWhen::At(window) => Some((Instant::START, window)),
        };
        self.expect(step.span, port, wanted, window)
    }

    /// The next pieces must be these; with a window, the first of them must come in it.
    pub fn expect(
        &mut self,
        span: TextSpan,
        port: usize,
        wanted: &[L::Wanted],
        window: Option<(Instant, PlannedWindow)>,
    ) -> Result<(), Stop> {
        let first = self.ports[port].next;
        let tolerance = self.link.time_tolerance();
        for (index, wanted_piece) in wanted.iter().enumerate() {
            let until = match window {
                Some((base, window)) if index == 0 => {
                    base + window.to + window.tolerance + tolerance
                }
                _ => self.link.now().max(self.line_before) + self.deadline,
            };
            let arrived = self.next_piece(port, first + index, until);
            if arrived.is_none() {
                // It may only be late.
                self.settle();
            }
            let received = &self.ports[port].received[first..];
            let failed = |message: String| {
                let found = L::difference(port, (first, index), wanted, received);
                Stop::failed(span, message).with(found)
            };
            let Some((at, piece)) = arrived else {
                if let Some((at, piece)) = received.get(index) {
                    let piece = L::show(*piece);
                    let message =
                        format!("{piece} came at {at}, expected at {until} at the latest");
                    return Err(Stop::failed(span, message));
                }
                return Err(failed(format!(
                    "nothing more was received up to {}, where {} is expected",
                    until.min(self.link.now()),
                    L::describe(wanted_piece)
                )));
            };
            let resolved = L::resolve(wanted_piece, &received[..index]);
            if !L::matches(&resolved, piece) {
                return Err(failed(format!(
                    "the master received {} where {} is expected",
                    L::show(piece),
                    L::describe(&resolved)
                )));
            }
            if let Some((base, window)) = window.filter(|_| index == 0) {
                let earliest = base + window.from - window.tolerance;
                if at + tolerance < earliest {
                    let message = format!(
                        "{} came at {at}, expected at {} at the earliest",
                        L::show(piece),
                        base + window.from
                    );
                    return Err(Stop::failed(span, message));
                }
            }
            self.ports[port].next = first + index + 1;
            self.line_before = at;
        }
        Ok(())
    }

    /// Waits for the `index`-th piece received.
    fn next_piece(
        &mut self,
        port: usize,
        index: usize,
        until: Instant,
    ) -> Option<(Instant, L::Received)> {
        loop {
            self.fetch();
            if let Some(piece) = self.ports[port].received.get(index) {
                return Some(*piece).filter(|(at, _)| *at <= until);
            }
            if self.link.now() >= until || !self.wait(until) {
                return None;
            }
        }
    }

    /// A strict scenario asks for everything.
    pub fn nothing_unasked(&self, span: TextSpan) -> Result<(), Stop> {
        let ports = self.ports.iter().enumerate().filter(|_| self.strict);
        for (index, port) in ports {
            let unasked = &port.received[port.next..];
            if let Some((at, piece)) = unasked.first() {
                let message = format!(
                    "{} was received at {at}, but no line asks for it (the scenario is strict)",
                    L::show(*piece)
                );
                let found = L::difference(index, (port.next, 0), &[], unasked);
                return Err(Stop::failed(span, message).with(found));
            }
        }
        Ok(())
    }
}

/// What a plan needs that a rig may lack, in words.
#[must_use]
pub fn needs<L: Language>(plan: &Plan<L>) -> Vec<&'static str> {
    plan.needs
        .iter()
        .map(|need: &Capability| need.name())
        .collect()
}
