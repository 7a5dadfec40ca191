//! A line or a link behind a guard.

use super::Watch;
use super::gate::{Denied, Gate};
use crate::link::{
    Capability, Lead, Line, Link, Moment, Octets, PlacedFault, Trouble, wait_keeping,
};
use crate::medium::{HeardPiece, Medium, Out};
use harness_proto::limit::LimitSetting;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How far ahead a [kept](Line::keep) line is filled. A computer that stalls for half of this time leaves no gap.
const KEPT: Span = Span::from_millis(40);

/// Why a conversation on simulated drives ends that is recorded.
const RECORD_FULL: &str = "it exchanges more than a capture can hold of one request: ask for less at a time, or end the capture first";

/// The longest wait at a time, in milliseconds.
const ONE_DAY: u64 = 86_400_000;

/// Why the work ends at its deadline.
pub const OVERDUE: &str = "`max_run` of the rig's file is over";

/// Counts what a link has carried.
type TrafficCounter<L> = fn(&L) -> u64;

/// A line or a link that sends nothing that the [gates](Gate) of its ports deny. After a denial it is in
/// [trouble](Trouble::Denied), and nothing passes before [`Self::reset_after_denial`].
#[derive(Debug)]
pub struct Guarded<L> {
    inner: L,
    /// One a port.
    gates: Vec<Box<dyn Gate>>,
    trouble: Option<Trouble>,
    /// The settings that denied what is the trouble.
    denying: Vec<LimitSetting>,
    capabilities: Vec<Capability>,
    /// When the present conversation began, on the guard's clock, which is never set back.
    origin: Instant,
    refused: usize,
    watch: Option<Box<dyn Watch>>,
    /// Input of port 0 that arrived while the watch looked and belongs to the conversation.
    unasked: VecDeque<(Instant, HeardPiece)>,
    /// Set when the program is to end; only read if the link behind the guard does not read it itself.
    interrupt: Arc<AtomicBool>,
    /// A fault has been put on a link in the present conversation.
    faulty: bool,
    /// Whether the lines are [kept](Line::keep).
    keeps: bool,
    /// When the longest run is over that the rig's file allows.
    deadline: Option<std::time::Instant>,
    /// How much the link behind the guard may have carried, and how that is counted; `None` where its record needs no limit.
    most_carried: Option<(u64, TrafficCounter<L>)>,
}

impl<L: Line> Guarded<L> {
    /// A line behind one gate a port. What it can do is `capabilities`: those of the link that the gates do not deny as a whole.
    pub fn behind(inner: L, gates: Vec<Box<dyn Gate>>, capabilities: Vec<Capability>) -> Self {
        Self {
            inner,
            gates,
            trouble: None,
            denying: Vec::new(),
            capabilities,
            origin: Instant::START,
            refused: 0,
            watch: None,
            unasked: VecDeque::new(),
            interrupt: Arc::default(),
            faulty: false,
            keeps: false,
            deadline: None,
            most_carried: None,
        }
    }

    /// It turned out that the link behind the guard cannot do this.
    pub fn lose(&mut self, capability: Capability) {
        self.capabilities.retain(|known| *known != capability);
    }

    /// A drive has shown that it monitors time-outs.
    pub fn expect_time_outs(&mut self) {
        for gate in &mut self.gates {
            gate.expect_time_outs();
        }
    }

    /// [Keeps](Line::keep) the lines from now on, where no gate limits the number of pieces.
    pub fn keep_lines(&mut self) {
        self.keeps = self.gates.iter().all(|gate| gate.may_keep());
    }

    /// Assumes that the drives have just been made and have heard nothing; see [`Gate::assume_fresh`].
    pub fn assume_fresh(&mut self) {
        for gate in &mut self.gates {
            gate.assume_fresh();
        }
    }

    /// Whether, by what was sent, no drive is in the middle of a message.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.trouble().is_none() && self.gates.iter().all(|gate| gate.at_rest())
    }

    /// After a denial: lets permitted pieces pass again, for the safe state.
    pub fn reset_after_denial(&mut self) {
        if !matches!(self.trouble, Some(Trouble::Interlock(_))) {
            self.trouble = None;
        }
        for gate in &mut self.gates {
            gate.reset_after_denial();
        }
    }

    /// Lets nothing stop the way to a safe state: no watch, no deadline, no number of pieces. Trouble from an
    /// interlock is cleared.
    pub fn clear_the_way(&mut self) {
        self.watch = None;
        self.deadline = None;
        self.gates.iter_mut().for_each(|gate| gate.lift_caps());
        if matches!(self.trouble, Some(Trouble::Interlock(_))) {
            self.trouble = None;
        }
    }

    /// Ends the work at this time, as an interlock does.
    pub fn set_deadline(&mut self, deadline: Option<std::time::Instant>) {
        self.deadline = deadline;
    }

    /// Ends the work if its deadline has passed. A denial, after which work may continue, is replaced.
    pub fn end_if_overdue(&mut self) {
        let over = self
            .deadline
            .is_some_and(|deadline| deadline <= std::time::Instant::now());
        if over && !self.trouble.as_ref().is_some_and(Trouble::ends_a_run) {
            self.trouble = Some(Trouble::Interlock(OVERDUE.to_owned()));
        }
    }

    /// Waits up to the deadline, if that comes first. The caller checks again afterwards.
    fn wait_until(&mut self, until: Instant) -> bool {
        let Some(deadline) = self.deadline.filter(|_| self.trouble().is_none()) else {
            return self.inner.wait(until);
        };
        let left = deadline.saturating_duration_since(std::time::Instant::now());
        let most = u64::try_from(left.as_millis()).unwrap_or(u64::MAX);
        // Not less than a wait can tell from nothing.
        let end = self.inner.now() + Span::from_millis(most.min(ONE_DAY) + 1);
        self.inner.wait(until.min(end)) || end < until && self.trouble().is_none()
    }

    /// Waits until a gate lets this pass, and keeps the lines meanwhile. Returns whether it may be sent then.
    ///
    /// A wait in the middle of a telegram is a silence itself, so the gate may ask for another one.
    fn wait_at_gate(&mut self, port: usize, what: Out<'_>) -> bool {
        loop {
            let now = self.guard_time();
            let gate = self.gates.get(port);
            let Some(until) = gate.and_then(|gate| gate.waits_until(now, what)) else {
                return true;
            };
            let end = self.inner.now() + until.since(now);
            // A simulated link says of drives that have nothing to do that nothing will come, although time goes on.
            if !wait_keeping(self, end) && self.guard_time() == now || self.trouble().is_some() {
                return self.trouble().is_none();
            }
        }
    }

    /// The gate of a port, by its type; `None` where the port has none of this type.
    pub fn gate<G: Gate>(&self, port: usize) -> Option<&G> {
        let gate: &dyn Any = self.gates.get(port)?.as_ref();
        gate.downcast_ref()
    }

    /// The same, to be changed.
    pub fn gate_mut<G: Gate>(&mut self, port: usize) -> Option<&mut G> {
        let gate: &mut dyn Any = self.gates.get_mut(port)?.as_mut();
        gate.downcast_mut()
    }

    /// Copies what the gates of another line to the same drives know of them, for a rehearsal on a model.
    pub fn know_as<M>(&mut self, other: &Guarded<M>) {
        for (gate, other) in self.gates.iter_mut().zip(&other.gates) {
            gate.know_as(other.as_ref());
        }
    }

    /// The link behind the guard.
    pub fn inner(&self) -> &L {
        &self.inner
    }

    /// The link behind the guard, for callers that send nothing. What is sent past the guard is not judged.
    pub fn inner_mut(&mut self) -> &mut L {
        &mut self.inner
    }

    /// Sets the watch that looks at drives in every [pause](Line::pause).
    pub fn set_watch(&mut self, watch: Option<Box<dyn Watch>>) {
        self.watch = watch;
    }

    /// Ends the conversation in [trouble](Trouble::Interrupted) once this is set, for a link that does not look at it itself.
    pub fn set_interrupt(&mut self, interrupt: Arc<AtomicBool>) {
        self.interrupt = interrupt;
    }

    /// Runs `act` without the watch and the deadline: nothing may stop the way to a safe state.
    pub(crate) fn unwatched<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> T {
        let (watch, deadline) = (self.watch.take(), self.deadline.take());
        let result = act(self);
        self.watch = watch;
        self.deadline = deadline;
        result
    }

    /// Lets the watch check everything, due or not. Afterwards the link is in [trouble](Self::trouble) if the work must not continue.
    pub fn look_at_all(&mut self) {
        if let Some(mut watch) = self.watch.take() {
            self.look(watch.as_mut(), |watch, line| watch.look_at_all(line));
            self.watch = Some(watch);
        }
    }

    /// Checks now, and puts the link in trouble if the work must not continue.
    fn look(
        &mut self,
        watch: &mut dyn Watch,
        look: impl FnOnce(&mut dyn Watch, &mut dyn Line) -> Result<(), Trouble>,
    ) {
        if self.trouble().is_some() {
            return;
        }
        let before = self.addressed();
        let seen = look(watch, self);
        self.unasked.extend(watch.take_unasked());
        // A link that is in trouble itself has ended the look.
        if let Err(trouble) = seen
            && self.trouble().is_none()
        {
            self.trouble = Some(trouble);
        }
        self.address_again(before);
    }

    /// Queries drives outside any conversation. A short address has the same meaning afterwards as before.
    pub fn aside<T>(&mut self, ask: impl FnOnce(&mut Self) -> T) -> T {
        let before = self.addressed();
        let result = ask(self);
        self.address_again(before);
        result
    }

    /// What each gate addressed last.
    fn addressed(&self) -> Vec<Option<u8>> {
        self.gates.iter().map(|gate| gate.addressed()).collect()
    }

    fn address_again(&mut self, before: Vec<Option<u8>>) {
        for (port, before) in before.into_iter().enumerate() {
            let gate = self.gates.get(port);
            if let Some(restore) = gate.and_then(|gate| gate.restore(before)) {
                restore(self);
            }
        }
    }

    /// Whether drives can be asked something in between, so that nothing is changed by it.
    fn can_pause(&self) -> bool {
        !self.faulty && self.at_rest() && self.gates.iter().all(|gate| gate.can_pause())
    }

    /// The time on the guard's clock.
    fn guard_time(&self) -> Instant {
        self.on_guard_clock(self.inner.now())
    }

    /// A time of the conversation on the guard's clock.
    fn on_guard_clock(&self, at: Instant) -> Instant {
        self.origin + at.since_start()
    }

    /// The settings of the rig's `[limits]` that have denied something; empty where it is denied whatever they are.
    #[must_use]
    pub fn denying(&self) -> &[LimitSetting] {
        &self.denying
    }

    fn deny(&mut self, denied: Denied) {
        if self.trouble.is_none() {
            self.trouble = Some(Trouble::Denied(denied.why));
            self.denying = denied.settings;
        }
    }
}

/// The denial of what would go through a port that the rig's file does not have.
fn no_port(port: usize) -> Denied {
    Denied::never(format!("ring {} is not in the rig's file", port + 1))
}

impl<L: Line> Line for Guarded<L> {
    fn pause_due(&self) -> Option<Instant> {
        let due = self.watch.as_ref()?.due()?;
        let since = due.since_start().saturating_sub(self.origin.since_start());
        Some(Instant::START + since)
    }

    fn pause(&mut self) {
        let now = self.guard_time();
        if !self.can_pause() {
            return;
        }
        if let Some(mut watch) = self.watch.take() {
            self.look(watch.as_mut(), |watch, line| {
                watch.look(now, line).map_err(Trouble::Interlock)
            });
            self.watch = Some(watch);
        }
    }

    fn medium(&self, port: usize) -> Medium {
        self.inner.medium(port)
    }

    fn now(&self) -> Instant {
        self.inner.now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        if !self.wait_at_gate(port, what) {
            self.refused = what.len();
            return self.inner.now();
        }
        let now = self.inner.now();
        let guard_time = self.on_guard_clock(now);
        let Some(gate) = self.gates.get_mut(port) else {
            self.deny(no_port(port));
            return now;
        };
        self.refused = what.len();
        if self.trouble.is_some() {
            return now;
        }
        let (admitted, denied) = gate.admit(guard_time, what);
        self.refused = what.len() - admitted;
        if let Some(watch) = &mut self.watch {
            watch.sent(what.first(admitted));
        }
        let end = self.inner.send(port, what.first(admitted));
        // An adapter may have no words for a frame.
        self.refused += self.inner.refused();
        let left = self.on_guard_clock(end);
        // Who only asks when the line is free ends no silence.
        if let Some(gate) = self.gates.get_mut(port).filter(|_| admitted > 0) {
            gate.ends(left);
        }
        denied.into_iter().for_each(|denied| self.deny(denied));
        end
    }

    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        let now = self.guard_time();
        let gate = self.gates.get(port);
        self.trouble().is_none() && gate.is_some_and(|gate| gate.permits(now, what))
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        if let Some(trouble) = self.trouble() {
            return Some(trouble.to_string());
        }
        let now = self.guard_time();
        let gate = self.gates.get(port);
        let denied = gate.map_or_else(|| Some(no_port(port)), |gate| gate.denies(now, what));
        denied.map(|denied| denied.why)
    }

    fn refused(&self) -> usize {
        self.refused
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        let unasked = (port == 0).then(|| self.unasked.pop_front()).flatten();
        let (at, heard) = match unasked {
            Some(piece) => piece,
            None => {
                let (at, heard) = self.inner.receive(port)?;
                if let Some(gate) = self.gates.get_mut(port) {
                    gate.hear(&heard);
                }
                (at, heard)
            }
        };
        if let Some(watch) = &mut self.watch
            && let Err(why) = watch.hear(&heard)
        {
            self.trouble.get_or_insert(Trouble::Interlock(why));
        }
        Some((at, heard))
    }

    fn wait(&mut self, until: Instant) -> bool {
        if self.interrupt.load(Ordering::Relaxed) && self.trouble.is_none() {
            self.trouble = Some(Trouble::Interrupted);
        }
        if let Some((most, carried)) = self.most_carried
            && self.trouble.is_none()
            && carried(&self.inner) > most
        {
            self.trouble = Some(Trouble::Denied(RECORD_FULL.to_owned()));
        }
        if self.trouble.is_none() {
            self.end_if_overdue();
        }
        self.trouble != Some(Trouble::Interrupted) && self.wait_until(until)
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        self.inner.attend(ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.inner.trouble().or(self.trouble.as_ref())
    }

    fn fail(&mut self, trouble: Trouble) {
        self.trouble.get_or_insert(trouble);
    }

    fn lead(&self) -> Lead {
        self.inner.lead()
    }

    /// Nothing is added inside a telegram.
    fn keep(&mut self) -> Option<Instant> {
        if !self.keeps || self.trouble().is_some() {
            return None;
        }
        let byte_time = self.byte_time();
        // Virtual time waits for the caller.
        let ahead = match self.inner.lead() {
            Lead::NONE => byte_time * 2,
            _ => KEPT,
        };
        let now = self.inner.now();
        for port in 0..self.gates.len() {
            let free = self.inner.send_octets(port, &[]).max(now);
            let missing = (now + ahead).since(free).units() / byte_time.units();
            if missing > 0
                && let Some(filler) = self.gates[port].filler()
            {
                let count = usize::try_from(missing).unwrap_or_default();
                self.send_octets(port, &vec![filler; count]);
            }
        }
        Some(now + Span::from_nanos(ahead.as_nanos() / 2))
    }
}

impl<L: Link> Guarded<L> {
    /// Ends the conversation in [trouble](Trouble::Denied) when the link has carried this many more pieces: its record has no bound of its
    /// own.
    pub fn limit_record(&mut self, most: Option<u64>) {
        let now = self.inner.carried();
        self.most_carried =
            most.map(|most| (now.saturating_add(most), L::carried as TrafficCounter<L>));
    }
}

impl<L: Link> Link for Guarded<L> {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.origin = self.guard_time();
        self.inner.begin();
        self.unasked.clear();
        self.faulty = false;
        for gate in &mut self.gates {
            gate.begin();
        }
    }

    fn step(&mut self, place: usize) {
        self.inner.step(place);
    }

    fn busy(&self) -> bool {
        self.inner.busy()
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        self.inner.reaches(ring, link)
    }

    fn damages_parity(&self, ring: usize, link: usize) -> bool {
        self.inner.damages_parity(ring, link)
    }

    fn listens(&self, ring: usize, link: usize) -> bool {
        self.inner.listens(ring, link)
    }

    fn tapped(&mut self, ring: usize, link: usize) -> Option<Vec<Received>> {
        self.inner.tapped(ring, link)
    }

    fn time_tolerance(&self) -> Span {
        self.inner.time_tolerance()
    }

    fn unwatched_since(&self) -> Option<Instant> {
        self.inner.unwatched_since()
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        self.faulty |= !matches!(fault, PlacedFault::Stimulus(..));
        let settled = moment == Moment::Now && !self.inner.busy();
        let gate = self.gates.get_mut(port);
        let judged = gate.map_or_else(
            || Err(no_port(port)),
            |gate| gate.fault(fault, moment, settled),
        );
        match judged {
            Ok(()) => self.inner.inject(port, fault, moment),
            Err(denied) => self.deny(denied),
        }
    }

    fn probe(&mut self, port: usize, octets: &[u8]) -> Vec<Received> {
        let now = self.guard_time();
        let Some(gate) = self.gates.get_mut(port) else {
            return Vec::new();
        };
        if self.trouble.is_some() {
            return Vec::new();
        }
        // A simulated link probes a copy of itself.
        let copy = self.capabilities.contains(&Capability::Simulator);
        if let Err(denied) = gate.probe(now, octets, copy) {
            self.deny(denied);
            return Vec::new();
        }
        let answers = self.inner.probe(port, octets);
        if !copy {
            for &answer in &answers {
                gate.hear(&HeardPiece::Octet(answer));
            }
        }
        answers
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.inner.beside()
    }

    fn unused_faults(&self) -> Vec<String> {
        self.inner.unused_faults()
    }

    fn record(&mut self, on: bool) {
        self.inner.record(on);
    }

    fn carried(&self) -> u64 {
        self.inner.carried()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.inner.drives(ring)
    }

    fn trace(&self, ring: usize) -> Trace {
        self.inner.trace(ring)
    }
}
