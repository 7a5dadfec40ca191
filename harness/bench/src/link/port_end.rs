//! One port of the bench's own station, over a stream of octets: what waits for the operating system, and what was received.

use super::Trouble;
use super::echo::Echo;
use super::stamp::stamped;
use super::tamper::Tamper;
use crate::port::{Outgoing, Wire};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use std::collections::VecDeque;
use std::fmt;

/// How far ahead of the line bytes are given to the operating system.
pub const AHEAD: Span = Span::from_millis(100);

/// Bytes of a conversation that are recorded on each link; more are counted only.
pub const MOST_RECORDED: usize = 4_000_000;

/// Octets of a conversation that may come beyond what [`MOST_A_REPLY`] and the rate explain: far more than any buffer in between holds.
const MOST_UNEXPLAINED: u64 = 1_000_000;

/// Octets that may come for each octet that was sent, on any bus: a reply of PROFIBUS DP has at most 255.
const MOST_A_REPLY: u64 = 300;

/// The longest silence before an octet with a wrong parity bit. Drives that monitor time-outs allow 10 ms without a byte (ND21 9.9), and
/// switching the parity takes some of them.
pub const LONGEST_SILENCE: Span = Span::from_millis(6);

/// How much later than due an octet may leave a USB adapter, which gets its octets each millisecond.
const ADAPTER: Span = Span::from_millis(2);

/// What a bus knows of the octets that are under way at a port.
pub trait Accounting: fmt::Debug + Send {
    /// Nothing is under way.
    fn rest(&mut self);

    /// An octet leaves.
    fn sent(&mut self, octet: u8);

    /// An octet was received.
    fn came(&mut self, octet: Received);

    /// How long the line is idle before what is sent together.
    fn idle(&self) -> Span {
        Span::ZERO
    }

    /// How long after an octet the last one that it causes comes back; `None` where none comes while others are sent.
    fn returns(&self, _octet_time: Span) -> Option<Span> {
        None
    }

    /// Whether more octets were sent than received.
    fn is_owed(&self) -> bool;

    /// Whether every expected octet was received, if interposers have meanwhile taken and given these numbers of octets.
    fn is_even(&self, taken: u64, given: u64) -> bool;

    /// How long after an octet its answer comes at the soonest.
    fn soonest(&self, octet_time: Span) -> Span;

    /// How long after an octet its answer comes at the latest, where nothing is lost.
    fn latest(&self, octet_time: Span) -> Span;
}

/// One port of the bench's own station.
#[derive(Debug)]
pub struct PortEnd<A> {
    pub wire: Wire,
    pub accounting: A,
    /// What has not been given to the operating system, with the time at which its start bit is due, and whether
    /// it must not be sooner.
    pub queue: VecDeque<(Instant, bool, Outgoing)>,
    /// When the line is free for the next byte.
    pub free: Instant,
    /// The next byte must not be given to the operating system before that.
    exact: bool,
    /// What comes while its parity is switched for an octet that leaves has no known line status.
    pub shares_parity: bool,
    /// What an adapter gives back that hears itself; `None` for one that does not.
    pub echo: Option<Echo>,
    /// When the awaited reply is due.
    pub attended: Option<Instant>,
    pub received: VecDeque<(Instant, Received)>,
    pub last_arrival: Instant,
    pub outgoing: Tamper,
    pub incoming: Tamper,
    pub log: [Vec<LineByte>; 2],
    pub carried: u64,
    /// Octets of this conversation that have come, and that were sent.
    came: u64,
    sent: u64,
    pub unplaced: u64,
}

impl<A: Accounting> PortEnd<A> {
    pub fn new(wire: Wire, accounting: A) -> Self {
        Self {
            shares_parity: wire.is_uart(),
            wire,
            accounting,
            queue: VecDeque::new(),
            free: Instant::START,
            exact: false,
            echo: None,
            attended: None,
            received: VecDeque::new(),
            last_arrival: Instant::START,
            outgoing: Tamper::default(),
            incoming: Tamper::default(),
            log: [Vec::new(), Vec::new()],
            carried: 0,
            came: 0,
            sent: 0,
            unplaced: 0,
        }
    }

    /// Begins a conversation at `now` on the clock of the one before. Bytes that the operating system has still occupy the line.
    pub fn begin(&mut self, now: Instant) {
        let given = self.queue.front().map_or(self.free, |(start, ..)| *start);
        self.queue.clear();
        self.free = Instant::START + given.since(now);
        self.exact = false;
        self.attended = None;
        self.received.clear();
        self.last_arrival = Instant::START;
        self.accounting.rest();
        (self.carried, self.came, self.sent) = (0, 0, 0);
        self.outgoing = Tamper::default();
        self.incoming = Tamper::default();
        self.log = [Vec::new(), Vec::new()];
    }

    /// Leaves the line idle before the next byte, for as long as the bus says, counted from the last byte in either direction. `tolerance` is
    /// what the bench's times may be off by.
    pub fn pause(&mut self, now: Instant, octet_time: Span, tolerance: Span) {
        let idle = self.accounting.idle();
        let last = self.free.max(self.last_arrival);
        let quiet = self.silence(now, octet_time, tolerance);
        let free = (last + idle).max(self.free + quiet).max(now);
        if idle.max(quiet) > Span::ZERO && free > self.free {
            self.free = free;
            self.exact = free > now;
        }
    }

    /// How long an octet with a wrong parity bit waits after one that it would follow without a pause: until that one has come back, so that
    /// nothing comes while the parity is switched. After a pause it waits for nothing, since the pause may be meant; nor does it where the
    /// silence would be longer than drives or the stated times of a scenario allow.
    fn silence(&self, now: Instant, octet_time: Span, tolerance: Span) -> Span {
        let follows = self.sent > 0 && now < self.free + octet_time;
        let wanted = self.shares_parity && follows && self.outgoing.damages_next_parity();
        let back = self.accounting.returns(octet_time).filter(|_| wanted);
        let allowed = LONGEST_SILENCE.min(tolerance);
        back.map(|back| back + ADAPTER)
            .filter(|silence| *silence <= allowed)
            .unwrap_or(Span::ZERO)
    }

    /// Queues a byte of the bench's.
    pub fn send(&mut self, now: Instant, byte: u8, byte_time: Span) {
        let start = self.free.max(now);
        let passed = self.outgoing.pass(Received::good(byte), start);
        let begun = start + passed.delay;
        let mut exact = std::mem::take(&mut self.exact) || passed.delay > Span::ZERO;
        let mut free = begun;
        let mut queue = |outgoing, length: Span| {
            self.queue
                .push_back((free, std::mem::take(&mut exact), outgoing));
            free += length;
            self.accounting.sent(byte);
        };
        for received in passed.bytes() {
            let outgoing = match received.error {
                None => Outgoing::Byte(received.byte),
                Some(_) => Outgoing::WrongParity(received.byte),
            };
            queue(outgoing, byte_time);
        }
        if let Some(span) = passed.hold {
            queue(Outgoing::Break(span), span.max(byte_time));
        }
        // A lost byte takes its byte time too.
        self.free = free.max(begun + byte_time);
        self.carried += 1;
        self.sent += 1;
        if self.log[0].len() < MOST_RECORDED {
            self.log[0].extend(passed.seen(byte, begun + byte_time, byte_time));
        }
    }

    /// Gives the operating system the bytes that are due.
    pub fn transmit(&mut self, now: Instant) -> Result<(), Trouble> {
        while let Some(&(start, exact, outgoing)) = self.queue.front() {
            let lead = if exact { Span::ZERO } else { AHEAD };
            if start > now + lead {
                break;
            }
            self.queue.pop_front();
            if let Some(echo) = &mut self.echo {
                echo.sent(outgoing);
            }
            self.wire.send(outgoing)?;
        }
        self.wire.flush()
    }

    /// Reads what was received.
    pub fn collect(&mut self, told: Instant, now: Instant, byte_time: Span) -> Result<(), Trouble> {
        let mut bytes = Vec::new();
        let mut result = self.wire.receive(&mut bytes);
        if let Some(echo) = &mut self.echo
            && let Err(wrong) = echo.remove(&mut bytes, self.wire.name())
        {
            result = Err(wrong);
        }
        if !bytes.is_empty() {
            self.last_arrival = self.last_arrival.max(told);
        }
        self.unplaced += self.wire.take_unplaced();
        self.came += bytes.len() as u64;
        if result.is_ok() && self.came > self.most_explained(now, byte_time) {
            result = Err(Trouble::Garbled(format!(
                "{}: {} bytes have come in {}, more than a line of this rate can carry: check `port` and `line`, or what is connected there",
                self.wire.name(),
                self.came,
                now.since_start()
            )));
        }
        for (at, byte) in stamped(bytes, now, byte_time, &mut self.last_arrival) {
            self.accounting.came(byte);
            self.carried += 1;
            let passed = self.incoming.pass(byte, at);
            let recording = self.log[1].len() < MOST_RECORDED;
            for byte in passed.seen(byte.byte, at + passed.delay, byte_time) {
                let arrival = byte.arrival().map(|received| (byte.at, received));
                self.received.extend(arrival);
                self.log[1].extend(recording.then_some(byte));
            }
        }
        result
    }

    /// How many octets can have come by now from anything that belongs on a line: a peer that floods the port would fill the memory.
    fn most_explained(&self, now: Instant, byte_time: Span) -> u64 {
        let at_rate = now.since_start().units() / byte_time.units().max(1);
        let asked = self.sent.saturating_mul(MOST_A_REPLY);
        // A clock may be wrong, never by half.
        MOST_UNEXPLAINED + asked.saturating_add(at_rate.saturating_mul(2))
    }
}
