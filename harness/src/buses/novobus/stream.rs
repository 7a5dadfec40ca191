//! A link over streams of bytes: real rings, or simulated ones in another process.
//!
//! Time is the computer's monotonic clock. A received byte is stamped with the time at which it was read. If several bytes are read at
//! once, each is assumed to have arrived a byte time before the next. Bytes to send are handed to the operating system a little ahead of
//! the line, so that a busy computer leaves no gaps in a telegram.

use crate::link::inner::InnerLink;
use crate::link::lateness::Lateness;
use crate::link::ring::{MOST_RECORDED, Ring};
use crate::link::tamper::Tamper;
use crate::link::{
    Capability, HARMLESS, Lead, Line, Link, LinkFault, Moment, PlacedFault, PortLink, Trouble,
    link_name,
};
use crate::medium::{Heard, Medium, Out};
use crate::port::{LastWords, Wire, wake_on_time};
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, Trace};
use rustix::event::{Timespec, poll};
use rustix::io::Errno;
use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time;

/// How far ahead of the line queued bytes are handed to the operating system, at least.
const AT_LEAST_AHEAD: Span = Span::from_millis(50);

/// Maximum time ahead of the line at which a driver may hand over its bytes: longer than a busy computer is late, and too short for a
/// person to notice.
const LEAD: Span = Span::from_millis(16);

/// Minimum of [`Lead::near`] on a line with an adapter, which transfers bytes in blocks of a millisecond and may hold them for longer.
const ADAPTER: Span = Span::from_millis(4);

/// How much longer than the ring itself needs a byte may take to come back, because of adapters and a busy computer.
pub(crate) const SLACK: Span = Span::from_millis(30);

/// Default time tolerance of a rig.
pub const TOLERANCE: Span = Span::from_millis(5);

/// The longest sleep: the link checks for a request to end at least this often.
const NAP: Span = Span::from_millis(50);

/// The link dozes if the bytes already sent occupy every line for more than this time: no answer is urgent then.
const CALM: Span = Span::from_millis(4);

/// How long the link dozes: a few byte times.
const DOZE: Span = Span::from_millis(2);

/// How long before an expected answer the link wakes up and polls: waking up takes longer than processing the answer.
const AWAKE: Span = Span::from_micros(40);

/// How long the link keeps polling after an answer was due. It sleeps while it waits for a later answer.
const STAY: Span = Span::from_micros(150);

/// One or two rings over streams.
#[derive(Debug)]
pub struct StreamLink {
    rings: Vec<Ring>,
    inner: Vec<InnerLink>,
    rate: Rate,
    /// When the conversation started.
    start: time::Instant,
    /// The last time that [`Line::now`] returned. A byte that had not arrived by then is stamped later than this.
    told: Cell<Instant>,
    /// How late the operating system wakes this thread.
    late: Lateness,
    /// When the ports were last looked at.
    looked: Instant,
    /// Set while the caller busy-polls: it is expected to call [`Line::wait`] again before this time.
    awake: Option<Instant>,
    /// Edge-triggered: input already reported and still unread is not reported again.
    lying: bool,
    capabilities: Vec<Capability>,
    /// Faults to inject at a time, in order of time.
    scheduled: VecDeque<(Instant, usize, usize, LinkFault)>,
    interrupt: Arc<AtomicBool>,
    /// Incremented at every poll of the ports.
    beats: Arc<AtomicU64>,
    trouble: Option<Trouble>,
    recording: bool,
    tolerance: Span,
}

impl StreamLink {
    /// Creates a link over one wire per ring, each with its number of drives; there are one or two rings. When `interrupt` is set, the
    /// link stops sending with [`Trouble::Interrupted`].
    #[must_use]
    pub fn new(
        wires: Vec<(Wire, u8)>,
        inner: Vec<InnerLink>,
        rate: Rate,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        wake_on_time();
        let mut capabilities = vec![
            Capability::Memory,
            Capability::Motion,
            Capability::Eeprom,
            Capability::Reset,
        ];
        if wires.len() > 1 {
            capabilities.push(Capability::TwoRings);
        }
        if inner.iter().any(InnerLink::passes) {
            capabilities.push(Capability::Interposer);
        }
        if !inner.is_empty() {
            capabilities.push(Capability::Tap);
        }
        let shows = |(wire, _): &(Wire, u8)| wire.abilities().shows_errors;
        if wires.iter().all(shows) && inner.iter().all(InnerLink::shows_errors) {
            capabilities.push(Capability::LineErrors);
        }
        let rings = wires
            .into_iter()
            .map(|(wire, drives)| Ring::new(wire, drives));
        Self {
            rings: rings.collect(),
            inner,
            rate,
            start: time::Instant::now(),
            told: Cell::new(Instant::START),
            late: Lateness::new(time::Instant::now()),
            looked: Instant::START,
            awake: None,
            lying: false,
            capabilities,
            scheduled: VecDeque::new(),
            interrupt,
            beats: Arc::default(),
            trouble: None,
            recording: true,
            tolerance: TOLERANCE,
        }
    }

    /// Sets the time tolerance.
    pub fn set_time_tolerance(&mut self, tolerance: Span) {
        self.tolerance = tolerance;
    }

    /// Stops recording what the links carry.
    pub fn stop_recording(&mut self) {
        self.recording = false;
    }

    fn at(&self, time: time::Instant) -> Instant {
        let since = time.saturating_duration_since(self.start);
        Instant::START + Span::from_nanos(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Converts a time of the conversation to the computer's clock.
    fn clock(&self, at: Instant) -> time::Instant {
        self.start + time::Duration::from_nanos(at.since_start().as_nanos())
    }

    /// How long a byte may take to come back, with the recent lateness of the computer. A byte counts as lost only after one more poll.
    fn round(&self, ring: &Ring) -> Span {
        self.rate.byte_time() * (2 * u64::from(ring.drives) + 4)
            + SLACK.max(self.tolerance)
            + self.lateness()
    }

    /// The recent lateness of the computer.
    fn lateness(&self) -> Span {
        self.late.at(self.clock(self.told.get()))
    }

    /// Injects due faults and hands due bytes to the operating system.
    fn give(&mut self, now: Instant) {
        self.beats.fetch_add(1, Ordering::Relaxed);
        while let Some(&(at, ring, link, fault)) = self.scheduled.front()
            && at <= now
        {
            self.scheduled.pop_front();
            if let Some(tamper) = self.tamper(ring, link) {
                tamper.suffer(fault);
            }
        }
        if self.interrupt.load(Ordering::Relaxed) && self.trouble.is_none() {
            self.trouble = Some(Trouble::Interrupted);
        }
        for ring in &mut self.rings {
            if self.trouble.is_some() {
                ring.queue.clear();
            } else if let Err(trouble) = ring.transmit(now) {
                self.trouble = Some(trouble);
            }
        }
    }

    /// Reads what has arrived.
    fn take(&mut self, now: Instant) {
        self.looked = now;
        let told = self.told.get();
        for ring in &mut self.rings {
            if self.trouble.is_none() {
                let times = (told, now);
                let done = ring.collect(times, self.rate.byte_time(), self.recording);
                self.trouble = done.err();
            }
        }
        // Interposers forward bytes even if the conversation has ended with trouble.
        let most = if self.recording { MOST_RECORDED } else { 0 };
        for inner in &mut self.inner {
            if let Err(trouble) = inner.pump(now, self.rate.byte_time(), most) {
                self.trouble.get_or_insert(trouble);
            }
        }
    }

    fn tamper(&mut self, ring: usize, link: usize) -> Option<&mut Tamper> {
        let at = |inner: &&mut InnerLink| (inner.ring, inner.place) == (ring, link);
        if let Some(inner) = self
            .inner
            .iter_mut()
            .filter(|inner| inner.passes())
            .find(at)
        {
            return Some(&mut inner.tamper);
        }
        let ring = self.rings.get_mut(ring)?;
        match link {
            0 => Some(&mut ring.outgoing),
            link if link == usize::from(ring.drives) => Some(&mut ring.incoming),
            _ => None,
        }
    }

    /// Whether a byte of a ring can be fetched. A byte delayed on the last link has not arrived yet.
    fn has_come(&self, ring: &Ring) -> bool {
        let next = ring.received.front();
        next.is_some_and(|(at, _)| *at <= self.told.get() || *at <= self.now())
    }

    /// Whether a byte of any ring can be fetched.
    fn any_has_come(&self) -> bool {
        self.rings.iter().any(|ring| self.has_come(ring))
    }

    /// The next time at which the link must act even if no byte arrives.
    fn due(&self, now: Instant) -> Option<Instant> {
        let queues = self.rings.iter().filter_map(|ring| {
            let (start, exact, _) = ring.queue.front()?;
            // Due bytes go out together, so that the next call is some time away.
            let lead = if *exact { Span::ZERO } else { AT_LEAST_AHEAD };
            Some(*start - lead)
        });
        let faults = self.scheduled.front().map(|(at, ..)| *at);
        // Bytes delayed on the last link.
        let fronts = self.rings.iter().filter_map(|ring| ring.received.front());
        let queues = queues.chain(fronts.map(|(at, _)| *at).filter(|at| *at > now));
        let relays = self.inner.iter().filter_map(InnerLink::due);
        // When a byte that has not come back counts as lost.
        let expecting = self.rings.iter().filter(|ring| ring.sent > ring.came);
        let lost = expecting.map(|ring| ring.free + self.round(ring));
        let lost = lost.filter(|at| *at > self.looked);
        queues.chain(faults).chain(relays).chain(lost).min()
    }

    /// Waits until `until` or until a byte arrives, then polls the ports.
    fn pass(&mut self, now: Instant, until: Instant) {
        let calm = now + CALM;
        let awaited = self.awaited(now);
        if self.inner.is_empty() && self.rings.iter().all(|ring| ring.free > calm) {
            // Bytes that arrive meanwhile can wait, because the line is occupied for longer. Waking up for every byte would cost the most
            // time.
            let until = until.min(now + DOZE);
            std::thread::sleep(time::Duration::from_nanos(until.since(now).as_nanos()));
            self.late.woken(self.clock(until), time::Instant::now());
        } else if let Some(at) = awaited.filter(|at| *at - AWAKE <= now) {
            // The caller polls in a loop, which keeps the code and data for an answer in the caches.
            // Yielding here would cost a whole time slice on a busy computer.
            self.awake = Some(until.min(at + STAY));
        } else {
            let wake = awaited.map_or(until, |at| until.min(at - AWAKE));
            let wake = wake.min(now + NAP);
            self.listen(wake.since(now));
            self.late.woken(self.clock(wake), time::Instant::now());
        }
        self.look();
    }

    /// Hands due bytes to the operating system and reads what has arrived.
    fn look(&mut self) -> Instant {
        let now = self.at(time::Instant::now());
        self.give(now);
        self.take(now);
        now
    }

    /// When the next byte is due for which the link must be awake: the answer announced by [`Line::attend`], or the last byte sent. `None`
    /// for a ring behind an adapter, whose delivery times are unpredictable.
    fn awaited(&self, now: Instant) -> Option<Instant> {
        let out = |ring: &&Ring| ring.sent > ring.came && ring.wire.is_prompt();
        let home = |ring: &Ring| ring.free + self.rate.byte_time() * u64::from(ring.drives);
        let due = self.rings.iter().filter(out);
        let due = due.flat_map(|ring| ring.attended.into_iter().chain([home(ring)]));
        due.filter(|at| now < *at + STAY).min()
    }

    /// Waits for the ports, for at most `span`.
    fn listen(&mut self, span: Span) {
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::try_from(span.as_nanos()).unwrap_or(0).min(999_999_999),
        };
        let mut fds: Vec<_> = self.rings.iter().map(|ring| ring.wire.poll_fd()).collect();
        fds.extend(self.inner.iter().flat_map(InnerLink::poll_fds));
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) | Err(Errno::INTR | Errno::AGAIN) => {}
            Err(error) => {
                let text = format!("failed to wait for the ports: {error}");
                self.trouble.get_or_insert(Trouble::Lost(text));
            }
        }
    }
}

impl Line for StreamLink {
    fn medium(&self, _port: usize) -> Medium {
        self.rate.into()
    }

    fn now(&self) -> Instant {
        let now = self.at(time::Instant::now());
        self.told.set(now);
        now
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        let now = self.now();
        let rest = !self.ring_busy(ring, now);
        let byte_time = self.rate.byte_time();
        let recording = self.recording;
        let sound = self.trouble.is_none();
        let Some(own) = self.rings.get_mut(ring).filter(|_| sound) else {
            return now;
        };
        if rest {
            (own.sent, own.came) = (0, 0);
            let inner = self.inner.iter_mut().filter(|inner| inner.ring == ring);
            inner.for_each(InnerLink::rest);
        }
        for byte in what.octets() {
            own.send(now, *byte, byte_time, recording);
        }
        let free = own.free;
        self.give(now);
        free
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, Heard)> {
        if !self.has_come(self.rings.get(ring)?) {
            return None;
        }
        self.lying = false;
        let (at, octet) = self.rings.get_mut(ring)?.received.pop_front()?;
        Some((at, Heard::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let now = self.at(time::Instant::now());
        if let Some(until) = self.awake.take() {
            self.late.woken(self.clock(until), self.clock(now));
        }
        self.give(now);
        let until = self.due(now).map_or(until, |due| due.min(until));
        if (self.lying || !self.any_has_come()) && self.trouble.is_none() && now < until {
            self.pass(now, until);
        } else {
            self.take(now);
        }
        self.lying = self.any_has_come();
        self.awake = self.awake.filter(|_| !self.lying);
        self.trouble.is_none()
    }

    fn attend(&mut self, ring: usize, at: Instant) {
        if let Some(ring) = self.rings.get_mut(ring) {
            ring.attended = Some(at);
        }
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.trouble.as_ref()
    }

    fn lead(&self) -> Lead {
        let late = self.lateness();
        let least = match self.rings.iter().all(|ring| ring.wire.is_prompt()) {
            true => Span::ZERO,
            false => ADAPTER,
        };
        Lead {
            far: LEAD,
            near: late.saturating_sub(HARMLESS).clamp(least, LEAD),
        }
    }
}

impl StreamLink {
    /// Whether the port at an inner link has not yet shown all bytes that are back at the master: its adapter may be slower than the
    /// master's.
    fn lags(&self, inner: &InnerLink) -> bool {
        let ring = self.rings.get(inner.ring);
        ring.is_some_and(|ring| {
            inner.carried < ring.incoming.count() && self.looked < ring.last_arrival + SLACK
        })
    }

    fn ring_busy(&self, index: usize, now: Instant) -> bool {
        let Some(ring) = self.rings.get(index) else {
            return false;
        };
        if !ring.queue.is_empty() || ring.wire.waiting() > 0 || now < ring.free {
            return true;
        }
        // After a time-out drives send zeros without end (ND21 9.9): then only time decides.
        // Bytes that an interposer has dropped do not come back; bytes that it has inserted do.
        let inner = self.inner.iter().filter(|inner| inner.ring == index);
        let (taken, given) = inner.fold((0, 0), |(taken, given), inner| {
            (taken + inner.taken, given + inner.given)
        });
        let home = ring.came + taken == ring.sent + given;
        // A byte counts as lost only after a poll later than its time.
        !home && self.looked < ring.free + self.round(ring)
    }
}

impl PortLink for StreamLink {
    fn beats(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.beats)
    }

    fn last_words(&self, bytes: &dyn Fn(usize) -> Vec<u8>) -> std::io::Result<Vec<LastWords>> {
        let rings = self.rings.iter().enumerate();
        rings
            .map(|(ring, own)| own.wire.last_words(&bytes(ring)))
            .collect()
    }

    fn resume(&mut self) {
        if self.trouble == Some(Trouble::Interrupted) {
            self.trouble = None;
            self.interrupt = Arc::default();
        }
    }

    fn take_unplaced(&mut self) -> u64 {
        let rings = self.rings.iter_mut();
        rings.map(|ring| std::mem::take(&mut ring.unplaced)).sum()
    }

    fn take_gaps(&mut self) -> Vec<time::Duration> {
        let rings = self.rings.iter_mut();
        rings.flat_map(|ring| ring.wire.take_gaps()).collect()
    }

    fn inner_links(&self) -> &[InnerLink] {
        &self.inner
    }
}

impl Link for StreamLink {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        let now = self.look();
        self.start = self.clock(now);
        self.told.set(Instant::START);
        self.lying = false;
        self.looked = Instant::START;
        self.awake = None;
        self.scheduled.clear();
        self.rings.iter_mut().for_each(|ring| ring.begin(now));
        self.inner.iter_mut().for_each(InnerLink::begin);
    }

    fn busy(&self) -> bool {
        let now = self.now();
        let late = |inner: &InnerLink| inner.busy() || self.lags(inner);
        let relays = self.inner.iter().any(late);
        let rings = (0..self.rings.len()).any(|ring| self.ring_busy(ring, now));
        self.trouble.is_none() && (relays || rings)
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        // Planning and the capabilities of the rig exclude faults at other places.
        let PlacedFault::Link(link, fault) = fault else {
            return;
        };
        match moment {
            Moment::At(at) => {
                let place = self.scheduled.partition_point(|(other, ..)| *other <= at);
                self.scheduled.insert(place, (at, ring, link, fault));
            }
            Moment::Now => {
                if let Some(tamper) = self.tamper(ring, link) {
                    tamper.suffer(fault);
                }
            }
            Moment::Byte(byte) => {
                if let Some(tamper) = self.tamper(ring, link) {
                    tamper.arm(byte, fault);
                }
            }
        }
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        let drives = self.rings.get(ring).map(|ring| usize::from(ring.drives));
        let inner = |inner: &InnerLink| inner.passes() && (inner.ring, inner.place) == (ring, link);
        drives.is_some_and(|drives| link == 0 || link == drives) || self.inner.iter().any(inner)
    }

    fn listens(&self, ring: usize, link: usize) -> bool {
        let drives = self.rings.get(ring).map(|ring| usize::from(ring.drives));
        let inner = |inner: &InnerLink| (inner.ring, inner.place) == (ring, link);
        drives.is_some_and(|drives| link == 0 || link == drives) || self.inner.iter().any(inner)
    }

    fn time_tolerance(&self) -> Span {
        self.tolerance
    }

    fn unused_faults(&self) -> Vec<String> {
        let mut unused = Vec::new();
        for (index, ring) in self.rings.iter().enumerate() {
            let ends = [(0, &ring.outgoing), (ring.drives, &ring.incoming)];
            for (place, tamper) in ends {
                let place = link_name(index, ring.drives, usize::from(place));
                let faults = tamper.unused();
                unused.extend(faults.map(|(byte, fault)| format!("{place} byte {byte}: {fault}")));
            }
        }
        for inner in &self.inner {
            let place = link_name(inner.ring, self.drives(inner.ring), inner.place);
            let faults = inner.tamper.unused();
            unused.extend(faults.map(|(byte, fault)| format!("{place} byte {byte}: {fault}")));
        }
        unused
    }

    fn carried(&self) -> u64 {
        let rings: u64 = self.rings.iter().map(|ring| ring.carried).sum();
        rings + self.inner.iter().map(|inner| inner.carried).sum::<u64>()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.rings.get(ring).map_or(0, |ring| ring.drives)
    }

    fn trace(&self, ring: usize) -> Trace {
        let index = ring;
        let Some(ring) = self.rings.get(ring) else {
            return Trace::default();
        };
        let last = usize::from(ring.drives);
        let octets = |place: usize| match place {
            0 => ring.log[0].clone(),
            place if place == last => ring.log[1].clone(),
            place => {
                let at = |inner: &&InnerLink| (inner.ring, inner.place) == (index, place);
                let inner = self.inner.iter().find(at);
                inner.map(|inner| inner.log.clone()).unwrap_or_default()
            }
        };
        let channel = |place: usize| {
            let ends = (drive_before(place, last), drive_before(place + 1, last));
            Channel::of_octets(ends.0, ends.1, octets(place))
        };
        Trace {
            channels: (0..=last).map(channel).collect(),
            ..Trace::empty(ring.drives)
        }
    }
}

/// The drive in front of the `place`-th link of a ring of `drives`; `None` for the master.
fn drive_before(place: usize, drives: usize) -> Option<u8> {
    match place {
        0 => None,
        place => drives
            .checked_sub(place)
            .and_then(|drive| u8::try_from(drive).ok()),
    }
}

#[cfg(test)]
#[path = "stream_tests.rs"]
mod tests;
