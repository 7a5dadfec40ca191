//! Inner links of a real ring: taps that listen, interposers that pass every byte on, with faults where a scenario
//! puts them.
//!
//! An interposer stands between two drives with its own two line ends: it reads a byte whole before it passes it on,
//! so it delays the ring by one byte time and by what the computer needs; [`Delay`] measures the latter.

use super::Trouble;
use super::stamp::stamped;
use super::tamper::Tamper;
use crate::port::{Outgoing, Wire};
use harness_proto::line::{LineError, Received};
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use rustix::event::PollFd;
use std::collections::VecDeque;
use std::time;

/// Where an inner link is listened to or cut open.
#[derive(Debug)]
pub enum InnerPorts {
    /// A receiver beside the link.
    Tap(Wire),
    /// One port: its receiver hears the drive in front, its transmitter feeds the drive behind.
    Interposer(Wire),
    /// Two ports: the first hears the drive in front, the second feeds the drive behind.
    TwoPortInterposer(Wire, Wire),
}

/// How long bytes were inside the program on their way through an interposer. What a fault holds back is not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Delay {
    /// How many bytes were passed on.
    pub bytes: u64,
    /// All their times together.
    pub total: time::Duration,
    pub longest: time::Duration,
}

impl Delay {
    fn note(&mut self, delay: time::Duration) {
        self.bytes += 1;
        self.total += delay;
        self.longest = self.longest.max(delay);
    }

    /// The mean; zero where nothing was passed on.
    #[must_use]
    pub fn mean(&self) -> time::Duration {
        let bytes = u32::try_from(self.bytes).unwrap_or(u32::MAX);
        self.total.checked_div(bytes).unwrap_or_default()
    }
}

/// A byte to pass on.
#[derive(Clone, Copy, Debug)]
struct HeldByte {
    start: Instant,
    outgoing: Outgoing,
    /// Since when it could be passed on.
    ready: time::Instant,
}

/// An inner link that the bench has a port at.
#[derive(Debug)]
pub struct InnerLink {
    pub ring: usize,
    /// Counted from the master's outgoing link.
    pub place: usize,
    ports: InnerPorts,
    pub tamper: Tamper,
    queue: VecDeque<HeldByte>,
    free: Instant,
    last_arrival: Instant,
    pub log: Vec<LineByte>,
    pub carried: u64,
    /// Bytes that an interposer has taken from the ring, and those that it has given back, since the ring was last at
    /// rest.
    pub taken: u64,
    pub given: u64,
    delay: Delay,
}

impl InnerLink {
    /// The `place`-th link of a ring, counted from the master's outgoing one.
    #[must_use]
    pub fn new(ring: usize, place: usize, ports: InnerPorts) -> Self {
        Self {
            ring,
            place,
            ports,
            tamper: Tamper::default(),
            queue: VecDeque::new(),
            free: Instant::START,
            last_arrival: Instant::START,
            log: Vec::new(),
            carried: 0,
            taken: 0,
            given: 0,
            delay: Delay::default(),
        }
    }

    /// Whether bytes pass through, so that they can be changed.
    #[must_use]
    pub fn passes(&self) -> bool {
        !matches!(self.ports, InnerPorts::Tap(_))
    }

    /// Whether it has one UART, whose one parity setting is for both directions: switched for a byte that leaves, it damages those that come.
    pub fn shares_parity(&self) -> bool {
        matches!(&self.ports, InnerPorts::Interposer(wire) if wire.is_uart())
    }

    /// What passing bytes on has cost.
    #[must_use]
    pub fn delay(&self) -> Delay {
        self.delay
    }

    pub fn has_line_errors(&self) -> bool {
        let (up, down) = match &self.ports {
            InnerPorts::Tap(wire) => return wire.abilities().shows_errors,
            InnerPorts::Interposer(wire) => (wire, wire),
            InnerPorts::TwoPortInterposer(up, down) => (up, down),
        };
        up.abilities().shows_errors && down.abilities().sends_wrong_parity
    }

    pub(crate) fn poll_fds(&self) -> impl Iterator<Item = PollFd<'_>> {
        let (first, second) = match &self.ports {
            InnerPorts::Tap(wire) | InnerPorts::Interposer(wire) => (wire, None),
            InnerPorts::TwoPortInterposer(up, down) => (up, Some(down)),
        };
        std::iter::once(first).chain(second).map(Wire::poll_fd)
    }

    pub fn begin(&mut self) {
        self.tamper = Tamper::default();
        self.queue.clear();
        self.free = Instant::START;
        self.last_arrival = Instant::START;
        self.log.clear();
        self.carried = 0;
        self.rest();
    }

    /// The ring is at rest: nothing is under way.
    pub fn rest(&mut self) {
        (self.taken, self.given) = (0, 0);
    }

    /// When something waits to be passed on.
    pub fn due(&self) -> Option<Instant> {
        self.queue.front().map(|held| held.start)
    }

    pub fn busy(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Reads what was received and passes on what is due.
    pub fn pump(
        &mut self,
        now: Instant,
        byte_time: Span,
        most_recorded: usize,
    ) -> Result<(), Trouble> {
        let mut bytes = Vec::new();
        let (up, passes) = match &mut self.ports {
            InnerPorts::Tap(wire) => (wire, false),
            InnerPorts::Interposer(wire) | InnerPorts::TwoPortInterposer(wire, _) => (wire, true),
        };
        let result = up.receive(&mut bytes);
        let read = time::Instant::now();
        let bytes: Vec<_> = stamped(bytes, now, byte_time, &mut self.last_arrival).collect();
        for (at, byte) in bytes {
            self.carried += 1;
            let seen = if passes {
                self.pass(at, byte, byte_time, read)
            } else {
                let (value, error) = (Some(byte.byte), byte.error);
                vec![LineByte::seen(at, value, value, error)]
            };
            if self.log.len() < most_recorded {
                self.log.extend(seen);
            }
        }
        result.and_then(|()| self.transmit(now))
    }

    fn pass(
        &mut self,
        at: Instant,
        byte: Received,
        byte_time: Span,
        read: time::Instant,
    ) -> Vec<LineByte> {
        let start = at.max(self.free);
        let passed = self.tamper.pass(byte, start);
        let mut free = start + passed.delay;
        self.taken += 1;
        self.given += passed.bytes().count() as u64 + u64::from(passed.hold.is_some());
        let ready = read + time::Duration::from_nanos(free.since(at).as_nanos());
        let mut hold = |start, outgoing| {
            self.queue.push_back(HeldByte {
                start,
                outgoing,
                ready,
            });
        };
        for received in passed.bytes() {
            let outgoing = match received.error {
                None | Some(LineError::Overrun) => Outgoing::Byte(received.byte),
                Some(LineError::Break) => Outgoing::Break(byte_time * 2),
                Some(_) => Outgoing::WrongParity(received.byte),
            };
            hold(free, outgoing);
            // The next byte is not held back: the line itself takes them one after another.
        }
        if let Some(span) = passed.hold {
            hold(free, Outgoing::Break(span));
            free += span;
        }
        if passed.delay > Span::ZERO || passed.hold.is_some() {
            self.free = free;
        }
        passed.seen(byte.byte, at, byte_time).collect()
    }

    fn transmit(&mut self, now: Instant) -> Result<(), Trouble> {
        let down = match &mut self.ports {
            InnerPorts::Tap(_) => return Ok(()),
            InnerPorts::Interposer(wire) | InnerPorts::TwoPortInterposer(_, wire) => wire,
        };
        let mut gone = Vec::new();
        while let Some(held) = self.queue.front().copied() {
            if held.start > now {
                break;
            }
            self.queue.pop_front();
            down.send(held.outgoing)?;
            gone.push(held.ready);
        }
        down.flush()?;
        for ready in gone {
            self.delay.note(ready.elapsed());
        }
        Ok(())
    }
}
