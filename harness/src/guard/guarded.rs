//! A line or a link behind a guard.

use super::Watch;
use crate::buses::novobus::driver::Axis;
use crate::buses::novobus::language::run::over_bus::read_byte;
use crate::link::{
    Capability, DriveFault, Lead, Line, Link, LinkFault, Moment, Octets, PlacedFault, Trouble,
};
use crate::medium::{Heard, Medium, Out};
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::guard::{Cause, Denial, Found, Guard, Limits, Setting};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why no frame leaves through this guard.
const NO_GATE: &str = "frames are not sent: the guard judges the bytes of a ring only";

/// How much SYNCO a [kept](Line::keep) line has ahead. A computer that stands still for half of it leaves no gap.
const KEPT: Span = Span::from_millis(40);

/// A line or a link that sends nothing that the limits do not allow. After a denial it is in
/// [trouble](Trouble::Denied), and nothing passes before [`Self::reset_after_denial`].
#[derive(Debug)]
pub struct Guarded<L> {
    inner: L,
    rings: Vec<Ring>,
    limits: Limits,
    trouble: Option<Trouble>,
    /// The settings that denied what is the trouble.
    denying: Vec<Setting>,
    capabilities: Vec<Capability>,
    /// When the present conversation began, on the guard's clock, which is never set back.
    origin: Instant,
    refused: usize,
    watch: Option<Box<dyn Watch>>,
    /// Set when the program is to end; only looked at where the link behind the guard does not look itself.
    interrupt: Arc<AtomicBool>,
    /// A fault has been put on a link in the present conversation.
    faulty: bool,
    /// Whether the lines are [kept](Line::keep).
    keeps: bool,
}

#[derive(Debug)]
struct Ring {
    guard: Guard,
    size: RingSize,
    /// Data bits to be inverted in a byte that is sent damaged, by the number of the byte.
    damaged: BTreeMap<u64, u8>,
    /// Bytes handed on, denied ones not counted: the numbers of the link's own.
    sent: u64,
}

/// What is to be done about a fault.
enum Verdict {
    /// It changes no byte: at most an error is noticed.
    Harmless,
    /// A byte that the master sends arrives with these data bits inverted, and with an error.
    Damages { byte: u64, data: u8 },
    /// Drives may be out of step after it.
    Doubt,
    /// It cannot be judged what drives make of it.
    Open,
}

impl<L: Line> Guarded<L> {
    /// A guarded line with rings of these sizes, in doubt until it was [synchronised](Self::synchronise).
    pub fn over_line(inner: L, sizes: &[RingSize], limits: Limits) -> Self {
        let ring = |&size| Ring {
            guard: Guard::new(size, limits),
            size,
            damaged: BTreeMap::new(),
            sent: 0,
        };
        Self {
            inner,
            rings: sizes.iter().map(ring).collect(),
            limits,
            trouble: None,
            denying: Vec::new(),
            capabilities: Vec::new(),
            origin: Instant::START,
            refused: 0,
            watch: None,
            interrupt: Arc::default(),
            faulty: false,
            keeps: false,
        }
    }

    /// [Keeps](Line::keep) the lines from now on: a drive has shown that it monitors time-outs (ND21 9.9).
    pub(crate) fn keep_lines(&mut self) {
        self.keeps = true;
    }

    /// Sends 17 zeros and the check sequence on every ring (ND21 9.8), waits until they have come round, and takes what came. Behind
    /// it commands pass, as far as they are allowed.
    pub fn synchronise(&mut self) {
        for (ring, size) in self.sizes().into_iter().enumerate() {
            let sent = self.send_octets(ring, &CHECK_SEQUENCE);
            let end = sent + self.byte_time() * (u64::from(size.drives()) + 8);
            while self.now() < end && self.wait(end) {}
            while self.receive(ring).is_some() {}
        }
    }

    /// Believes that the drives have just been made and have heard nothing; see [`Guard::assume_fresh`].
    pub fn assume_fresh(&mut self) {
        for ring in &mut self.rings {
            ring.guard.assume_fresh();
        }
    }

    /// Whether every drive waits for a telegram, as far as what was sent tells.
    #[must_use]
    pub fn at_rest(&self) -> bool {
        self.trouble().is_none() && self.rings.iter().all(|ring| ring.guard.at_rest())
    }

    /// After a denial: lets the recovery pass again, and what is allowed behind it, for the [safe state](super::safe_state).
    pub fn reset_after_denial(&mut self) {
        if !matches!(self.trouble, Some(Trouble::Interlock(_))) {
            self.trouble = None;
        }
        for ring in &mut self.rings {
            ring.guard.reset_after_denial();
        }
    }

    /// What it allows.
    pub(crate) const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The rings.
    pub(crate) fn sizes(&self) -> Vec<RingSize> {
        self.rings.iter().map(|ring| ring.size).collect()
    }

    /// Learns what was read of a drive.
    pub(crate) fn learn_of(&mut self, axis: Axis, found: &Found) {
        let Some(ring) = self.rings.get_mut(axis.ring()) else {
            return;
        };
        if let Ok(address) = ring.size.address_byte(axis.drive()) {
            ring.guard.learn(address, found);
        }
    }

    /// Knows of the drives what the guard of their likeness knows, for a rehearsal on a model of them.
    pub fn know_as<M>(&mut self, other: &Guarded<M>) {
        for (own, other) in self.rings.iter_mut().zip(&other.rings) {
            own.guard.know_as(&other.guard);
        }
    }

    /// The link behind the guard.
    pub fn inner(&self) -> &L {
        &self.inner
    }

    /// The link behind the guard, for callers that send nothing. Bytes sent past the guard are not checked.
    pub(crate) fn inner_mut(&mut self) -> &mut L {
        &mut self.inner
    }

    /// Sets the watch that looks at drives in every [pause](Line::pause). Trouble from an interlock is cleared: on the way to the safe
    /// state there is no watch, and nothing may stop it.
    pub fn set_watch(&mut self, watch: Option<Box<dyn Watch>>) {
        self.watch = watch;
        if matches!(self.trouble, Some(Trouble::Interlock(_))) {
            self.trouble = None;
        }
    }

    /// Ends the conversation in [trouble](Trouble::Interrupted) once this is set, for a link that does not look at it itself.
    pub(crate) fn set_interrupt(&mut self, interrupt: Arc<AtomicBool>) {
        self.interrupt = interrupt;
    }

    /// Looks now, and puts the link in [trouble](Trouble::Interlock) where something must not go on.
    pub fn look(&mut self, look: impl FnOnce(&mut dyn Line) -> Result<(), String>) {
        if self.trouble().is_some() {
            return;
        }
        let kept: Vec<_> = self.rings.iter().map(|ring| ring.guard.kept()).collect();
        if let Err(why) = look(self) {
            self.trouble = Some(Trouble::Interlock(why));
        }
        for (ring, kept) in kept.into_iter().enumerate() {
            let changed = |ring: &&Ring| ring.guard.kept() != kept;
            let Some(size) = self.rings.get(ring).filter(changed).map(|ring| ring.size) else {
                continue;
            };
            let drive = kept.map(|kept| kept.wrapping_add(size.drives()));
            if let Some(drive) = drive.filter(|drive| *drive < size.drives()) {
                // A short address goes on from the drive that it went on from before (9.2).
                let _again = read_byte(self, size.drives(), (ring, drive), ram::STATUS);
            }
        }
    }

    /// Whether drives can be asked something in between, so that nothing is changed by it.
    fn can_pause(&self) -> bool {
        let restorable = |ring: &Ring| {
            let drive = ring
                .guard
                .kept()
                .map(|kept| kept.wrapping_add(ring.size.drives()));
            drive.is_none_or(|drive| drive < ring.size.drives())
        };
        !self.faulty && self.at_rest() && self.rings.iter().all(restorable)
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
    pub fn denying(&self) -> &[Setting] {
        &self.denying
    }

    fn deny(&mut self, text: String, cause: Option<Cause>) {
        if self.trouble.is_none() {
            self.trouble = Some(Trouble::Denied(text));
            let denying = cause.map(|cause| self.limits.denying(cause).collect());
            self.denying = denying.unwrap_or_default();
        }
    }
}

impl Ring {
    /// Judges a byte as it will be, and as it would be if the port did not damage it.
    fn admit(&mut self, now: Instant, byte: u8) -> Result<(), Denial> {
        let number = self.sent + 1;
        match self.damaged.get(&number) {
            None => self.guard.admit(now, byte, false)?,
            Some(data) => {
                self.guard.clone().admit(now, byte, false)?;
                self.guard.admit(now, byte ^ data, true)?;
                self.damaged.remove(&number);
            }
        }
        self.sent = number;
        Ok(())
    }
}

impl<L: Link> Guarded<L> {
    /// A guarded link, in doubt until it was [synchronised](Self::synchronise). What the limits deny is no capability of it.
    pub fn new(inner: L, limits: Limits) -> Self {
        // A link has one ring or two; a ring that it does not have has no drives.
        let sizes: Vec<_> = (0..2)
            .map_while(|ring| RingSize::new(inner.drives(ring).into()).ok())
            .collect();
        let mut guarded = Self::over_line(inner, &sizes, limits);
        let has = |capability: &Capability| match capability {
            Capability::Motion => limits.motion,
            Capability::Eeprom => limits.eeprom,
            // A reset ends block and stop (ND21 11.8).
            Capability::Reset => limits.reset && limits.motion,
            _ => true,
        };
        let own = guarded.inner.capabilities().iter().copied();
        guarded.capabilities = own.filter(has).collect();
        guarded
    }

    /// What a fault may do to the bytes that drives hear.
    fn verdict(&self, ring: usize, fault: PlacedFault, moment: Moment) -> Verdict {
        let settled = moment == Moment::Now && !self.inner.busy();
        match fault {
            PlacedFault::Stimulus(..) | PlacedFault::Drive(_, DriveFault::Off) => Verdict::Harmless,
            PlacedFault::Link(link, LinkFault::Flip(flips)) if flips.noticed().is_some() => {
                let sent = self.rings.get(ring).map_or(0, |ring| ring.sent);
                match moment {
                    _ if flips.data == 0 => Verdict::Harmless,
                    Moment::Byte(byte) if link == 0 && byte > sent => {
                        let data = flips.data;
                        Verdict::Damages { byte, data }
                    }
                    Moment::Now if link == 0 && settled => {
                        let (byte, data) = (sent + 1, flips.data);
                        Verdict::Damages { byte, data }
                    }
                    _ => Verdict::Open,
                }
            }
            PlacedFault::Link(_, LinkFault::Cut | LinkFault::Delay(_)) => Verdict::Harmless,
            // Bytes are lost on the way: drives that nothing tells of it are out of step.
            PlacedFault::Drive(_, DriveFault::On) | PlacedFault::Link(_, LinkFault::Join)
                if settled =>
            {
                Verdict::Doubt
            }
            PlacedFault::Link(..) | PlacedFault::Drive(..) => Verdict::Open,
        }
    }
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
            self.look(|line| watch.look(now, line));
            self.watch = Some(watch);
        }
    }

    fn medium(&self, port: usize) -> Medium {
        self.inner.medium(port)
    }

    fn now(&self) -> Instant {
        self.inner.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        let now = self.inner.now();
        let guard_time = self.on_guard_clock(now);
        let Some(state) = self.rings.get_mut(ring) else {
            self.deny(format!("ring {} is not in the rig's file", ring + 1), None);
            return now;
        };
        self.refused = what.len();
        if self.trouble.is_some() {
            return now;
        }
        if !what.frames().is_empty() {
            self.deny(NO_GATE.to_owned(), None);
            return now;
        }
        let mut admitted = 0;
        let mut denial = None;
        for &byte in what.octets() {
            match state.admit(guard_time, byte) {
                Ok(()) => admitted += 1,
                Err(why) => {
                    denial = Some(why);
                    break;
                }
            }
        }
        self.refused = what.len() - admitted;
        let end = self.inner.send(ring, what.first(admitted));
        if let Some(denial) = denial {
            self.deny(format!("ring {}: {denial}", ring + 1), Some(denial.cause));
        }
        end
    }

    fn permits(&self, ring: usize, what: Out<'_>) -> bool {
        let Some(ring) = self.rings.get(ring) else {
            return false;
        };
        let mut guard = ring.guard.clone();
        let now = self.guard_time();
        let mut admits = |byte: &u8| guard.admit(now, *byte, false).is_ok();
        let judged = what.frames().is_empty();
        self.trouble().is_none() && judged && what.octets().iter().all(&mut admits)
    }

    fn refused(&self) -> usize {
        self.refused
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, Heard)> {
        self.inner.receive(ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        if self.interrupt.load(Ordering::Relaxed) && self.trouble.is_none() {
            self.trouble = Some(Trouble::Interrupted);
        }
        self.trouble != Some(Trouble::Interrupted) && self.inner.wait(until)
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        self.inner.attend(ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.inner.trouble().or(self.trouble.as_ref())
    }

    fn lead(&self) -> Lead {
        self.inner.lead()
    }

    /// Nothing is added inside a telegram, or where the number of bytes is limited.
    fn keep(&mut self) -> Option<Instant> {
        if !self.keeps || self.trouble().is_some() || self.limits.bytes_per_second.is_some() {
            return None;
        }
        let byte_time = self.byte_time();
        // Virtual time waits for the caller.
        let ahead = match self.inner.lead() {
            Lead::NONE => byte_time * 2,
            _ => KEPT,
        };
        let now = self.inner.now();
        for ring in 0..self.rings.len() {
            let free = self.inner.send_octets(ring, &[]).max(now);
            let missing = (now + ahead).since(free).units() / byte_time.units();
            if missing > 0 && self.rings[ring].guard.at_rest() {
                let count = usize::try_from(missing).unwrap_or_default();
                self.send_octets(ring, &vec![SYNCO; count]);
            }
        }
        Some(now + Span::from_nanos(ahead.as_nanos() / 2))
    }
}

impl<L: Link> Link for Guarded<L> {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        self.origin = self.guard_time();
        self.inner.begin();
        self.faulty = false;
        for ring in &mut self.rings {
            ring.sent = 0;
            ring.damaged.clear();
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

    fn listens(&self, ring: usize, link: usize) -> bool {
        self.inner.listens(ring, link)
    }

    fn tapped(&mut self, ring: usize, link: usize) -> Option<Vec<Received>> {
        self.inner.tapped(ring, link)
    }

    fn time_tolerance(&self) -> Span {
        self.inner.time_tolerance()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.faulty |= !matches!(fault, PlacedFault::Stimulus(..));
        if !self.limits.allow_everything() {
            match self.verdict(ring, fault, moment) {
                Verdict::Harmless => {}
                Verdict::Damages { byte, data } => {
                    if let Some(ring) = self.rings.get_mut(ring) {
                        *ring.damaged.entry(byte).or_default() ^= data;
                    }
                }
                Verdict::Doubt => {
                    if let Some(ring) = self.rings.get_mut(ring) {
                        ring.guard.doubt();
                        ring.guard.forget();
                    }
                }
                Verdict::Open => {
                    let why = format!(
                        "ring {}: the fault {fault:?} is not made: what drives take changed or lost bytes for cannot be \
                         judged, so it needs everything allowed in the rig's [limits], --allow-motion, and no `max_speed`",
                        ring + 1
                    );
                    self.deny(why, Some(Cause::InDoubt));
                    return;
                }
            }
        }
        self.inner.inject(ring, fault, moment);
    }

    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        let now = self.guard_time();
        let Some(state) = self.rings.get_mut(ring) else {
            return Vec::new();
        };
        if self.trouble.is_some() {
            return Vec::new();
        }
        let mut guard = state.guard.clone();
        if let Err(denial) = octets
            .iter()
            .try_for_each(|byte| guard.admit(now, *byte, false))
        {
            self.deny(format!("ring {}: {denial}", ring + 1), Some(denial.cause));
            return Vec::new();
        }
        // A simulated link probes a copy of itself.
        if !self.capabilities.contains(&Capability::Simulator) {
            state.guard = guard;
            state.sent += octets.len() as u64;
        }
        self.inner.probe(ring, octets)
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.inner.beside()
    }

    fn unused_faults(&self) -> Vec<String> {
        self.inner.unused_faults()
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
