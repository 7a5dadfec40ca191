//! Octets over ports in real time, whatever bus speaks them.
//!
//! Time is the computer's monotonic clock. A received byte is stamped with the time at which it was read. If several bytes are read at
//! once, each is assumed to have arrived a byte time before the next. Bytes to send are handed to the operating system a little ahead of
//! the line, so that a busy computer leaves no gaps in a telegram. What a bus knows of the bytes under way it says by an [`Accounting`].

use super::inner::InnerLink;
use super::lateness::Lateness;
use super::port_end::{Accounting, MOST_RECORDED, PortEnd};
use super::tamper::Tamper;
use super::{HARMLESS, Lead, LinkFault, Moment, Trouble};
use crate::port::{LastWords, Switch, Wire, WireParts, wake_on_time};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
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

/// How late an adapter may give back what was sent: it collects octets for some 16 ms, and its computer may stall.
const ECHO: Span = Span::from_millis(500);

/// How much longer than the bus itself needs an answer may take to come, because of adapters and a busy computer.
pub const SLACK: Span = Span::from_millis(30);

/// How long the bench does not look at its ports, or sleeps after the end of its wait, before that counts.
pub const HELD_UP: Span = Span::from_millis(4);

/// How long octets delayed by an adapter or a computer may keep arriving after the last one that was sent.
const MOST_HELD_UP: Span = Span::from_millis(2_000);

/// The longest sleep: the link checks for a request to end at least this often.
const NAP: Span = Span::from_millis(50);

/// The link dozes if the bytes already sent occupy every line for more than this time: no answer is urgent then.
const CALM: Span = Span::from_millis(4);

/// How long the link dozes: a few byte times.
const DOZE: Span = Span::from_millis(2);

/// How long before an expected answer the link wakes up and polls: waking up takes longer than processing the answer.
const AWAKE: Span = Span::from_micros(40);

/// How long the link keeps polling after an answer was due. It sleeps while it waits for a later answer.
pub const STAY: Span = Span::from_micros(150);

/// Where a fault can be put: at the port of the bench, or at an inner link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spot {
    /// On what leaves through a port.
    Out(usize),
    /// On what comes to a port.
    In(usize),
    /// On what an interposer passes on, by its place among the inner links.
    Inner(usize),
}

/// The ports of a link in real time.
#[derive(Debug)]
pub struct Pump<A> {
    pub ports: Vec<PortEnd<A>>,
    pub inner: Vec<InnerLink>,
    octet_time: Span,
    /// How exact its times are.
    pub tolerance: Span,
    /// When the conversation started.
    start: time::Instant,
    /// The last time that [`Self::now`] returned. A byte that had not arrived by then is stamped later than this.
    told: Cell<Instant>,
    /// How late the operating system wakes this thread.
    pub late: Lateness,
    /// When the ports were last polled.
    looked: Instant,
    /// Until when nothing had come that was not read by then.
    watched: Instant,
    /// What was read last had come since then.
    pub since: Instant,
    /// Set while the caller busy-polls: it is expected to call [`Self::wait`] again before this time.
    pub awake: Option<Instant>,
    /// Edge-triggered: input already reported and still unread is not reported again.
    lying: bool,
    /// Faults to inject at a time, in order of time.
    scheduled: VecDeque<(Instant, Spot, LinkFault)>,
    interrupt: Arc<AtomicBool>,
    /// Incremented at every poll of the ports.
    beats: Arc<AtomicU64>,
    pub trouble: Option<Trouble>,
}

impl<A: Accounting> Pump<A> {
    /// A pump for these wires, each with the accounting of its bus. When `interrupt` is set, it stops sending with
    /// [`Trouble::Interrupted`].
    pub fn new(
        wires: impl IntoIterator<Item = (Wire, A)>,
        inner: Vec<InnerLink>,
        octet_time: Span,
        interrupt: Arc<AtomicBool>,
    ) -> Self {
        wake_on_time();
        let end = |(wire, accounting)| PortEnd::new(wire, accounting);
        Self {
            ports: wires.into_iter().map(end).collect(),
            inner,
            octet_time,
            tolerance: Span::ZERO,
            start: time::Instant::now(),
            told: Cell::new(Instant::START),
            late: Lateness::new(time::Instant::now()),
            looked: Instant::START,
            watched: Instant::START,
            since: Instant::START,
            awake: None,
            lying: false,
            scheduled: VecDeque::new(),
            interrupt,
            beats: Arc::default(),
            trouble: None,
        }
    }

    /// Whether every port shows line errors at their byte, and sends them.
    pub fn has_line_errors(&self) -> bool {
        let has = |port: &PortEnd<A>| {
            let abilities = port.wire.abilities();
            abilities.shows_errors && abilities.sends_wrong_parity
        };
        self.ports.iter().all(has) && self.inner.iter().all(InnerLink::has_line_errors)
    }

    pub fn inject(&mut self, spot: Spot, fault: LinkFault, moment: Moment) {
        match moment {
            Moment::At(at) => {
                let place = self.scheduled.partition_point(|(other, ..)| *other <= at);
                self.scheduled.insert(place, (at, spot, fault));
            }
            Moment::Now => {
                if let Some(tamper) = self.tamper(spot) {
                    tamper.suffer(fault);
                }
            }
            Moment::Byte(byte) => {
                if let Some(tamper) = self.tamper(spot) {
                    tamper.arm(byte, fault);
                }
            }
        }
    }

    /// The time of the conversation.
    pub fn now(&self) -> Instant {
        let now = self.at(time::Instant::now());
        self.told.set(now);
        now
    }

    /// Sends octets after those that wait; returns when the last one has left.
    pub fn send(&mut self, port: usize, octets: &[u8]) -> Instant {
        let now = self.now();
        let rest = !self.port_busy(port, now);
        let (octet_time, looked, tolerance) = (self.octet_time, self.looked, self.tolerance);
        let sound = self.trouble.is_none();
        let Some(end) = self.ports.get_mut(port).filter(|_| sound) else {
            return now;
        };
        if rest {
            end.accounting.rest();
            let inner = self.inner.iter_mut().filter(|inner| inner.ring == port);
            inner.for_each(InnerLink::rest);
        }
        if !octets.is_empty() {
            let echo_is_due = looked >= end.free + ECHO;
            end.pause(now, octet_time, tolerance);
            let silent = end
                .echo
                .as_ref()
                .is_some_and(|echo| rest && echo_is_due && echo.owed() > 0);
            if silent {
                let name = end.wire.name();
                let text = format!(
                    "{name}: the adapter has given back nothing of what was sent: set `echo = false`"
                );
                self.trouble = Some(Trouble::Garbled(text));
                return now;
            }
        }
        for octet in octets {
            end.send(now, *octet, octet_time);
        }
        let free = end.free;
        self.give(now);
        free
    }

    /// Takes the next octet that was received.
    pub fn receive(&mut self, port: usize) -> Option<(Instant, Received)> {
        if !self.has_come(self.ports.get(port)?) {
            return None;
        }
        self.lying = false;
        self.ports.get_mut(port)?.received.pop_front()
    }

    /// As [`Line::wait`](super::Line::wait).
    pub fn wait(&mut self, until: Instant) -> bool {
        let now = self.at(time::Instant::now());
        if let Some(until) = self.awake.take() {
            self.late.woken(self.clock(until), self.clock(now));
        }
        self.give(now);
        let until = self.due(now).map_or(until, |due| due.min(until));
        let early = self.ports.iter().any(|port| port.wire.has_early());
        if (self.lying || !self.any_has_come()) && !early && self.trouble.is_none() && now < until {
            self.pass(now, until);
        } else {
            self.take(now);
        }
        self.lying = self.any_has_come();
        self.awake = self.awake.filter(|_| !self.lying);
        self.trouble.is_none()
    }

    /// As [`Line::attend`](super::Line::attend).
    pub fn attend(&mut self, port: usize, at: Instant) {
        if let Some(port) = self.ports.get_mut(port) {
            port.attended = Some(at);
        }
    }

    /// As [`Line::lead`](super::Line::lead).
    pub fn lead(&self) -> Lead {
        let late = self.lateness();
        let least = match self.ports.iter().all(|port| port.wire.is_prompt()) {
            true => Span::ZERO,
            false => ADAPTER,
        };
        Lead {
            far: LEAD,
            near: late.saturating_sub(HARMLESS).clamp(least, LEAD),
        }
    }

    /// As [`Link::begin`](super::Link::begin).
    pub fn begin(&mut self) {
        let now = self.look();
        self.start = self.clock(now);
        self.told.set(Instant::START);
        self.lying = false;
        self.looked = Instant::START;
        self.watched = Instant::START;
        self.awake = None;
        self.scheduled.clear();
        self.ports.iter_mut().for_each(|port| port.begin(now));
        self.inner.iter_mut().for_each(InnerLink::begin);
    }

    /// As [`Link::record`](super::Link::record).
    pub fn forget_record(&mut self) {
        for port in &mut self.ports {
            port.log = [Vec::new(), Vec::new()];
        }
        for inner in &mut self.inner {
            inner.log.clear();
        }
    }

    /// As [`Link::busy`](super::Link::busy).
    pub fn busy(&self) -> bool {
        let now = self.now();
        let late = |inner: &InnerLink| inner.busy() || self.lags(inner);
        let relays = self.inner.iter().any(late);
        let ports = (0..self.ports.len()).any(|port| self.port_busy(port, now));
        self.trouble.is_none() && (relays || ports)
    }

    /// Whether the port at an inner link has not yet shown all bytes that the bench has: its adapter may be slower than the
    /// bench's.
    fn lags(&self, inner: &InnerLink) -> bool {
        let port = self.ports.get(inner.ring);
        port.is_some_and(|port| {
            inner.carried < port.incoming.count() && self.looked < port.last_arrival + SLACK
        })
    }

    fn port_busy(&self, index: usize, now: Instant) -> bool {
        let Some(port) = self.ports.get(index) else {
            return false;
        };
        if !port.queue.is_empty() || port.wire.waiting() > 0 || now < port.free {
            return true;
        }
        // A bus may send without end: then only time decides.
        // Bytes that an interposer has dropped do not come back; bytes that it has inserted do.
        let inner = self.inner.iter().filter(|inner| inner.ring == index);
        let (taken, given) = inner.fold((0, 0), |(taken, given), inner| {
            (taken + inner.taken, given + inner.given)
        });
        // What is still coming has only been held up.
        let coming = port.last_arrival.min(port.free + MOST_HELD_UP);
        let last = match port.accounting.is_owed() {
            true => port.free.max(coming),
            false => port.free,
        };
        // A byte counts as lost only after a poll later than its time.
        !port.accounting.is_even(taken, given) && self.looked < last + self.round(port)
    }

    /// As [`PortLink::beats`](super::PortLink::beats).
    pub fn beats(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.beats)
    }

    /// As [`PortLink::last_words`](super::PortLink::last_words).
    pub fn last_words(&self, parts: WireParts) -> std::io::Result<Vec<LastWords>> {
        let ports = self.ports.iter();
        ports.map(|end| end.wire.last_words(parts)).collect()
    }

    /// As [`PortLink::resume`](super::PortLink::resume).
    pub fn resume(&mut self) {
        if self.trouble == Some(Trouble::Interrupted) {
            self.trouble = None;
            self.interrupt = Arc::default();
        }
    }

    /// As [`PortLink::take_unplaced`](super::PortLink::take_unplaced).
    pub fn take_unplaced(&mut self) -> u64 {
        let ports = self.ports.iter_mut();
        ports.map(|port| std::mem::take(&mut port.unplaced)).sum()
    }

    /// As [`PortLink::take_switches`](super::PortLink::take_switches).
    pub fn take_switches(&mut self) -> Vec<Switch> {
        let ports = self.ports.iter_mut();
        ports.flat_map(|port| port.wire.take_switches()).collect()
    }

    fn at(&self, time: time::Instant) -> Instant {
        let since = time.saturating_duration_since(self.start);
        Instant::START + Span::from_nanos(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Converts a time of the conversation to the computer's clock.
    fn clock(&self, at: Instant) -> time::Instant {
        self.start + time::Duration::from_nanos(at.since_start().as_nanos())
    }

    /// How long a byte may take to return, including the recent lateness of the computer. A byte counts as lost only after one more poll.
    pub fn round(&self, port: &PortEnd<A>) -> Span {
        port.accounting.latest(self.octet_time) + SLACK.max(self.tolerance) + self.lateness()
    }

    /// The recent lateness of the computer.
    pub fn lateness(&self) -> Span {
        self.late.at(self.clock(self.told.get()))
    }

    /// Injects due faults and hands due bytes to the operating system.
    fn give(&mut self, now: Instant) {
        self.beats.fetch_add(1, Ordering::Relaxed);
        while let Some(&(at, spot, fault)) = self.scheduled.front()
            && at <= now
        {
            self.scheduled.pop_front();
            if let Some(tamper) = self.tamper(spot) {
                tamper.suffer(fault);
            }
        }
        if self.interrupt.load(Ordering::Relaxed) && self.trouble.is_none() {
            self.trouble = Some(Trouble::Interrupted);
        }
        for port in &mut self.ports {
            if self.trouble.is_some() {
                port.queue.clear();
            } else if let Err(trouble) = port.transmit(now) {
                self.trouble = Some(trouble);
            }
        }
    }

    fn take(&mut self, now: Instant) {
        self.looked = now;
        self.since = std::mem::replace(&mut self.watched, now);
        let told = self.told.get();
        for port in &mut self.ports {
            if self.trouble.is_none() {
                self.trouble = port.collect(told, now, self.octet_time).err();
            }
        }
        // Interposers forward bytes even if the conversation has ended with trouble.
        for inner in &mut self.inner {
            if let Err(trouble) = inner.pump(now, self.octet_time, MOST_RECORDED) {
                self.trouble.get_or_insert(trouble);
            }
        }
    }

    fn tamper(&mut self, spot: Spot) -> Option<&mut Tamper> {
        match spot {
            Spot::Out(port) => self.ports.get_mut(port).map(|end| &mut end.outgoing),
            Spot::In(port) => self.ports.get_mut(port).map(|end| &mut end.incoming),
            Spot::Inner(inner) => self.inner.get_mut(inner).map(|link| &mut link.tamper),
        }
    }

    /// Whether a byte of a port can be fetched. A byte delayed by a fault has not arrived yet.
    fn has_come(&self, port: &PortEnd<A>) -> bool {
        let next = port.received.front();
        next.is_some_and(|(at, _)| *at <= self.told.get() || *at <= self.now())
    }

    /// Whether a byte of any port can be fetched.
    fn any_has_come(&self) -> bool {
        self.ports.iter().any(|port| self.has_come(port))
    }

    /// The next time at which the link must act even if no byte arrives.
    fn due(&self, now: Instant) -> Option<Instant> {
        let queues = self.ports.iter().filter_map(|port| {
            let (start, exact, _) = port.queue.front()?;
            // Due bytes go out together, so that the next call is some time away.
            let lead = if *exact { Span::ZERO } else { AT_LEAST_AHEAD };
            Some(*start - lead)
        });
        let faults = self.scheduled.front().map(|(at, ..)| *at);
        // Bytes delayed on the last link.
        let fronts = self.ports.iter().filter_map(|port| port.received.front());
        let queues = queues.chain(fronts.map(|(at, _)| *at).filter(|at| *at > now));
        let relays = self.inner.iter().filter_map(InnerLink::due);
        // When a byte that has not come back counts as lost.
        let expecting = self.ports.iter().filter(|port| port.accounting.is_owed());
        let lost = expecting.map(|port| port.free + self.round(port));
        let lost = lost.filter(|at| *at > self.looked);
        queues.chain(faults).chain(relays).chain(lost).min()
    }

    /// Waits until `until` or until a byte arrives, then polls the ports.
    fn pass(&mut self, now: Instant, until: Instant) {
        let calm = now + CALM;
        let awaited = self.awaited(now);
        if self.inner.is_empty() && self.ports.iter().all(|port| port.free > calm) {
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
            let came = self.listen(wake.since(now));
            let woken = time::Instant::now();
            self.late.woken(self.clock(wake), woken);
            let woken = self.at(woken);
            // Where it is woken after the end of its wait, it has not watched all the time.
            self.watched = match came {
                true if woken > wake + HELD_UP => now,
                true => woken,
                false => wake,
            };
        }
        self.look();
    }

    /// Hands due bytes to the operating system and reads what has arrived.
    pub fn look(&mut self) -> Instant {
        let now = self.at(time::Instant::now());
        self.give(now);
        self.take(now);
        now
    }

    /// When the next byte is due for which the link must be awake: the answer announced by `Line::attend`, or the last byte sent. `None`
    /// for a port behind an adapter, whose delivery times are unpredictable.
    pub fn awaited(&self, now: Instant) -> Option<Instant> {
        let out = |port: &&PortEnd<A>| port.accounting.is_owed() && port.wire.is_prompt();
        let home = |port: &PortEnd<A>| port.free + port.accounting.soonest(self.octet_time);
        let due = self.ports.iter().filter(out);
        let due = due.flat_map(|port| port.attended.into_iter().chain([home(port)]));
        due.filter(|at| now < *at + STAY).min()
    }

    /// Waits for the ports for at most `span`. Returns whether input arrived.
    fn listen(&mut self, span: Span) -> bool {
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::try_from(span.as_nanos()).unwrap_or(0).min(999_999_999),
        };
        let mut fds: Vec<_> = self.ports.iter().map(|port| port.wire.poll_fd()).collect();
        fds.extend(self.inner.iter().flat_map(InnerLink::poll_fds));
        match poll(&mut fds, Some(&timeout)) {
            Ok(ready) => ready > 0,
            // It is not known when the signal came.
            Err(Errno::INTR | Errno::AGAIN) => true,
            Err(error) => {
                let text = format!("failed to wait for the ports: {error}");
                self.trouble.get_or_insert(Trouble::Lost(text));
                true
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{PortAddress, PortSettings, open};
    use harness_proto::line::Rate;
    use std::io::Write as _;
    use std::net::TcpListener;

    /// A bus on which nothing answers.
    #[derive(Debug)]
    struct Silent;

    impl Accounting for Silent {
        fn rest(&mut self) {}
        fn sent(&mut self, _octet: u8) {}
        fn came(&mut self, _octet: Received) {}

        fn is_owed(&self) -> bool {
            false
        }

        fn is_even(&self, _taken: u64, _given: u64) -> bool {
            true
        }

        fn soonest(&self, _octet_time: Span) -> Span {
            Span::ZERO
        }

        fn latest(&self, _octet_time: Span) -> Span {
            Span::ZERO
        }
    }

    fn pump() -> (TcpListener, Pump<Silent>) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let settings = PortSettings {
            address: PortAddress::Tcp(address),
            format: Rate::default().into(),
            marks: false,
            low_latency: false,
        };
        let wire = open(&settings).expect("a wire");
        let octet_time = Rate::default().byte_time();
        let pump = Pump::new([(wire, Silent)], Vec::new(), octet_time, Arc::default());
        (listener, pump)
    }

    /// Input that arrived while the bench did something else may have come at any time since; input that it waited for came when it woke up.
    #[test]
    fn what_comes_while_nothing_looks_came_at_any_time() {
        let (listener, mut pump) = pump();
        let (mut peer, _) = listener.accept().expect("a peer");
        let began = pump.look();
        peer.write_all(&[0x80]).expect("it takes an octet");
        while pump.receive(0).is_none() {
            let before = pump.looked;
            let end = pump.now() + Span::from_millis(1);
            while pump.now() < end {}
            pump.look();
            assert_eq!(pump.since, before);
        }
        let waits = pump.now();
        assert!(began < waits);
        let answers = std::thread::spawn(move || peer.write_all(&[0x81]));
        while pump.receive(0).is_none() {
            assert!(
                pump.wait(waits + Span::from_millis(60_000)),
                "{:?}",
                pump.trouble
            );
        }
        assert!(pump.since >= waits);
        answers
            .join()
            .expect("no panic")
            .expect("it takes an octet");
    }

    /// A pump waits for nothing that its bus does not owe: it is at rest when the last byte has left.
    #[test]
    fn a_bus_says_what_it_owes() {
        let (_peer, mut pump) = pump();
        let free = pump.send(0, &[0x10, 0x20]);
        assert_eq!(pump.awaited(Instant::START), None);
        while pump.now() < free {
            assert!(pump.wait(free), "{:?}", pump.trouble);
        }
        assert!(!pump.busy());
    }
}
