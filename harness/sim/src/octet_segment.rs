//! A half-duplex segment of octets that all stations share: RS-485 with several masters and several slaves.
//!
//! Each station hears every octet of the others, at the end of its last stop bit, with what the receiver noticed. A station hears nothing
//! while it sends. Octets of two stations that overlap are both damaged: each other station reads them with a framing error.
//! All times are exact: an octet takes the bits of the line's [`Format`], and no result depends on how [`OctetSegment::run_until`] cuts the time.
//!
//! A line on which no station has anything to do costs nothing.

mod faults;
mod host;

pub use faults::{LineFault, LineFaultAt, TelegramFault};
pub use host::LineHost;

use crate::fault::{Flips, LinkFault};
use crate::record::LineByte;
use faults::{flipped, noticed};
use harness_proto::line::{Format, LineError, Received};
use harness_proto::time::{Instant, Span};

/// Idle bits between a telegram and its repetition by [`TelegramFault::Doubled`]: the shortest reply delay of PROFIBUS.
const REPEAT_BITS: u64 = 11;

/// An octet that a station sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Octet {
    /// The data bits.
    pub byte: u8,
    /// Bits that the transmitter inverts.
    pub flips: Flips,
    /// How long the line is idle between the octet before it, or the begin of the telegram, and this octet.
    pub pause: Span,
}

impl From<u8> for Octet {
    fn from(byte: u8) -> Self {
        Self {
            byte,
            ..Self::default()
        }
    }
}

/// When a station wants to begin its next telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wish {
    /// Not before.
    pub ready: Instant,
    /// How many bits the line must have been idle; 0 for a station that does not listen before it sends.
    pub idle_bits: u64,
}

/// What takes part in a shared line.
pub trait LineStation {
    /// The last stop bit of another station's octet has passed at `at`.
    fn hear(&mut self, at: Instant, octet: Received);
    /// When it wants to begin its next telegram; `None` while it has none.
    fn wants(&self) -> Option<Wish>;
    /// Its next telegram begins at `at`. The station puts the octets into the empty `into`, and no longer wants to send them.
    fn begin(&mut self, at: Instant, into: &mut Vec<Octet>);
    /// The last octet of its telegram has ended at `at`.
    fn sent(&mut self, at: Instant);
    /// When it does something by itself; `None` while it only waits for octets.
    fn next_action(&self) -> Option<Instant>;
    /// Does everything that is due up to and including `to`.
    fn advance(&mut self, to: Instant);
}

impl<S: LineStation + ?Sized> LineStation for Box<S> {
    fn hear(&mut self, at: Instant, octet: Received) {
        (**self).hear(at, octet);
    }
    fn wants(&self) -> Option<Wish> {
        (**self).wants()
    }
    fn begin(&mut self, at: Instant, into: &mut Vec<Octet>) {
        (**self).begin(at, into);
    }
    fn sent(&mut self, at: Instant) {
        (**self).sent(at);
    }
    fn next_action(&self) -> Option<Instant> {
        (**self).next_action()
    }
    fn advance(&mut self, to: Instant) {
        (**self).advance(to);
    }
}

/// An octet that waits for its turn.
#[derive(Clone, Copy, Debug)]
struct QueuedOctet {
    octet: Octet,
    /// Whether the station sends it, rather than a fault.
    genuine: bool,
    /// Its numbers, of its sender and of all, once it was counted.
    counted: Option<(u64, u64)>,
}

/// An octet on the line.
#[derive(Clone, Copy, Debug)]
struct Flying {
    start: Instant,
    end: Instant,
    sent: Option<u8>,
    received: Option<Received>,
}

/// What the line keeps of a station.
#[derive(Clone, Debug, Default)]
struct LineMember {
    /// The telegram under way, and the place of its next octet.
    telegram: Vec<QueuedOctet>,
    next: usize,
    /// When its next octet begins.
    begins: Instant,
    /// The octet under way.
    flying: Option<Flying>,
    /// Whether the telegram is to be sent once more.
    again: bool,
    /// The end of its last octet.
    sent_until: Instant,
    /// The telegram that it sent last.
    former: Vec<Octet>,
    octets: u64,
    telegrams: u64,
    unplugged: bool,
    record: Vec<LineByte>,
}

impl LineMember {
    fn is_sending(&self) -> bool {
        self.next < self.telegram.len() || self.flying.is_some()
    }

    /// Puts a telegram on the way, its first octet to begin at `at`.
    fn load(&mut self, at: Instant, octets: &[Octet]) {
        self.telegram.clear();
        self.telegram
            .extend(octets.iter().map(|&octet| QueuedOctet {
                octet,
                genuine: true,
                counted: None,
            }));
        self.next = 0;
        self.begins = at + self.pause();
    }

    /// The pause in front of the next octet.
    fn pause(&self) -> Span {
        self.telegram
            .get(self.next)
            .map_or(Span::ZERO, |waiting| waiting.octet.pause)
    }
}

/// What happens next; at one instant in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum LineEvent {
    /// An octet ends.
    End,
    /// A station does something by itself.
    Act,
    /// The next octet of a telegram begins.
    Octet,
    /// A telegram begins.
    Telegram,
}

/// The line.
#[derive(Debug)]
pub struct OctetSegment<S> {
    format: Format,
    bit: Span,
    octet: Span,
    stations: Vec<S>,
    members: Vec<LineMember>,
    faults: Vec<LineFaultAt>,
    octets: u64,
    telegrams: u64,
    /// The end of the last octet or break so far.
    busy_until: Instant,
    /// The end of the last break.
    broken_until: Instant,
    now: Instant,
    keeps_record: bool,
    /// Kept for its allocation.
    scratch: Vec<Octet>,
}

impl<S: LineStation> OctetSegment<S> {
    /// A line with these stations. It keeps a record until [`OctetSegment::keep_no_record`].
    #[must_use]
    pub fn new(format: Format, stations: Vec<S>) -> Self {
        let bit = 3_000_000_000u64
            .checked_div(format.bits_per_second.into())
            .unwrap_or(0);
        Self {
            format,
            bit: Span::from_units(bit),
            octet: format.octet_time(),
            members: vec![LineMember::default(); stations.len()],
            stations,
            faults: Vec::new(),
            octets: 0,
            telegrams: 0,
            busy_until: Instant::START,
            broken_until: Instant::START,
            now: Instant::START,
            keeps_record: true,
            scratch: Vec::new(),
        }
    }

    /// Keeps no record from now on, for long runs.
    pub fn keep_no_record(&mut self) {
        self.keeps_record = false;
        self.members
            .iter_mut()
            .for_each(|member| member.record.clear());
    }

    /// Keeps a record again, of what happens from now on.
    pub fn record_anew(&mut self) {
        self.keep_no_record();
        self.keeps_record = true;
    }

    /// The octets of a station so far, in order of time. An octet without a sent value was inserted by a fault.
    #[must_use]
    pub fn record(&self, place: usize) -> &[LineByte] {
        &self.members[place].record
    }

    /// Takes the record of a station out; it goes on empty.
    pub fn take_record(&mut self, place: usize) -> Vec<LineByte> {
        std::mem::take(&mut self.members[place].record)
    }

    /// The format of its octets.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// How long one bit takes.
    #[must_use]
    pub const fn bit_time(&self) -> Span {
        self.bit
    }

    /// The time up to which the line has run.
    #[must_use]
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// The end of the last octet or break that has begun so far.
    #[must_use]
    pub const fn busy_until(&self) -> Instant {
        self.busy_until
    }

    /// How many octets of all stations have begun.
    #[must_use]
    pub const fn octets(&self) -> u64 {
        self.octets
    }

    /// How many telegrams of all stations have begun.
    #[must_use]
    pub const fn telegrams(&self) -> u64 {
        self.telegrams
    }

    /// The number of stations.
    #[must_use]
    pub const fn stations(&self) -> usize {
        self.stations.len()
    }

    /// A station.
    #[must_use]
    pub fn station(&self, place: usize) -> &S {
        &self.stations[place]
    }

    /// A station, to be given work or changed.
    pub fn station_mut(&mut self, place: usize) -> &mut S {
        &mut self.stations[place]
    }

    /// Plans a fault.
    pub fn inject(&mut self, placed: LineFaultAt) {
        self.faults.push(placed);
    }

    /// Planned faults whose octet or telegram was not sent.
    #[must_use]
    pub fn unused_faults(&self) -> &[LineFaultAt] {
        &self.faults
    }

    /// Pulls the plug of a station, or puts it in: without it the station neither sends nor hears.
    pub fn unplug(&mut self, place: usize, unplugged: bool) {
        self.members[place].unplugged = unplugged;
    }

    /// Forgets the record, planned faults and the counts: the next octet and the next telegram are the first ones.
    pub fn begin(&mut self) {
        self.faults.clear();
        (self.octets, self.telegrams) = (0, 0);
        for member in &mut self.members {
            member.record.clear();
            (member.octets, member.telegrams) = (0, 0);
        }
    }

    /// Whether a telegram is under way.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.members.iter().any(LineMember::is_sending)
    }

    /// When something happens next; `None` while all stations wait.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        self.next().map(|(at, ..)| at)
    }

    /// Runs up to and including `to`.
    pub fn run_until(&mut self, to: Instant) {
        while let Some((at, event, place)) = self.next().filter(|(at, ..)| *at <= to) {
            self.now = self.now.max(at);
            match event {
                LineEvent::End => self.stream(place, to),
                LineEvent::Act => self.stations[place].advance(at),
                LineEvent::Octet => self.begin_octet(place, at),
                LineEvent::Telegram => self.begin_telegrams(at),
            }
        }
        self.now = self.now.max(to);
        for station in &mut self.stations {
            station.advance(to);
        }
    }

    /// Ends the octet of a station. As long as the octets of its telegram follow each other up to `to`, and nothing else happens before
    /// one of them ends, the search for the next event is left out.
    fn stream(&mut self, place: usize, to: Instant) {
        loop {
            self.end(place);
            let acts = self.stations.iter().filter_map(S::next_action).min();
            let member = &self.members[place];
            let follows = member.next < member.telegram.len() && member.begins == self.now;
            if !follows || acts.is_some_and(|at| at <= self.now) || self.others_send(place) {
                return;
            }
            self.begin_octet(place, self.now);
            let Some(end) = self.members[place].flying.as_ref().map(|flying| flying.end) else {
                return;
            };
            let begins = |other: usize| self.start_of(other).is_some_and(|at| at < end);
            let disturbed = (0..self.stations.len()).any(|other| other != place && begins(other));
            if end > to || disturbed || acts.is_some_and(|at| at < end) {
                return;
            }
            self.now = end;
        }
    }

    fn others_send(&self, place: usize) -> bool {
        let mut others = self.members.iter().enumerate();
        others.any(|(other, member)| other != place && member.is_sending())
    }

    /// What happens next, when, and to which station.
    fn next(&self) -> Option<(Instant, LineEvent, usize)> {
        let mut first: Option<(Instant, LineEvent, usize)> = None;
        let mut note = |event: (Instant, LineEvent, usize)| {
            if first.is_none_or(|known| event < known) {
                first = Some(event);
            }
        };
        for (place, (station, member)) in self.stations.iter().zip(&self.members).enumerate() {
            if let Some(flying) = &member.flying {
                note((flying.end, LineEvent::End, place));
            } else if member.next < member.telegram.len() {
                note((member.begins, LineEvent::Octet, place));
            } else if let Some(at) = self.start_of(place) {
                note((at, LineEvent::Telegram, place));
            }
            if let Some(at) = station.next_action() {
                note((at, LineEvent::Act, place));
            }
        }
        first
    }

    /// When the next telegram of a station that sends nothing now begins, as far as is known by now.
    fn start_of(&self, place: usize) -> Option<Instant> {
        let wish = self.stations[place].wants()?;
        let free = if wish.idle_bits == 0 {
            Instant::START
        } else {
            self.busy_until + self.bit * wish.idle_bits
        };
        Some(wish.ready.max(free).max(self.now))
    }

    /// Begins all telegrams that are due at `at`: stations that have waited for the same idle time begin together.
    fn begin_telegrams(&mut self, at: Instant) {
        let due = |line: &Self, place: usize| {
            !line.members[place].is_sending()
                && line.start_of(place).is_some_and(|start| start <= at)
        };
        let places: Vec<usize> = (0..self.stations.len())
            .filter(|&place| due(self, place))
            .collect();
        for place in places {
            self.begin_telegram(place, at);
        }
    }

    fn begin_telegram(&mut self, place: usize, at: Instant) {
        let mut octets = std::mem::take(&mut self.scratch);
        octets.clear();
        self.stations[place].begin(at, &mut octets);
        self.telegrams += 1;
        let member = &mut self.members[place];
        member.telegrams += 1;
        let numbers = (member.telegrams, self.telegrams);
        let mut start = at;
        while let Some(fault) = self.telegram_fault(place, numbers) {
            let member = &mut self.members[place];
            match fault {
                TelegramFault::Lost => octets.clear(),
                TelegramFault::Doubled => member.again = true,
                TelegramFault::Late(span) => start += span,
                TelegramFault::Former => octets.clone_from(&member.former),
            }
        }
        let member = &mut self.members[place];
        member.load(start, &octets);
        if octets.is_empty() {
            member.again = false;
            self.stations[place].sent(at);
        } else {
            std::mem::swap(&mut member.former, &mut octets);
        }
        self.scratch = octets;
    }

    /// Takes out the next fault that was planned for a telegram with these numbers.
    fn telegram_fault(&mut self, place: usize, numbers: (u64, u64)) -> Option<TelegramFault> {
        self.take_fault(place, numbers, |fault| match fault {
            LineFault::Telegram(fault) => Some(fault),
            LineFault::Octet(_) => None,
        })
    }

    fn octet_fault(&mut self, place: usize, numbers: (u64, u64)) -> Option<LinkFault> {
        self.take_fault(place, numbers, |fault| match fault {
            LineFault::Octet(fault) => Some(fault),
            LineFault::Telegram(_) => None,
        })
    }

    fn take_fault<F>(
        &mut self,
        place: usize,
        (of_sender, of_all): (u64, u64),
        kind: impl Fn(LineFault) -> Option<F>,
    ) -> Option<F> {
        if self.faults.is_empty() {
            return None;
        }
        let found = self.faults.iter().position(|placed| {
            let here = match placed.station {
                Some(station) => station == place && placed.number == of_sender,
                None => placed.number == of_all,
            };
            here && kind(placed.fault).is_some()
        })?;
        kind(self.faults.remove(found).fault)
    }

    /// Counts the next octet of a station, unless it is counted already; gives its numbers. Octets of faults have none.
    fn count(&mut self, place: usize) -> Option<(u64, u64)> {
        let member = &mut self.members[place];
        let waiting = &mut member.telegram[member.next];
        if waiting.genuine && waiting.counted.is_none() {
            member.octets += 1;
            self.octets += 1;
            waiting.counted = Some((member.octets, self.octets));
        }
        waiting.counted
    }

    /// Begins the next octet of a station.
    fn begin_octet(&mut self, place: usize, at: Instant) {
        let numbers = self.count(place);
        let member = &self.members[place];
        let QueuedOctet { octet, genuine, .. } = member.telegram[member.next];
        let sent = genuine.then_some(octet.byte);
        let mut received = Some(Received {
            byte: octet.byte ^ octet.flips.data,
            error: noticed(octet.flips),
        });
        let mut held = None;
        while let Some(fault) = numbers.and_then(|numbers| self.octet_fault(place, numbers)) {
            let member = &mut self.members[place];
            match fault {
                LinkFault::Flip(flips) => received = received.map(|byte| flipped(byte, flips)),
                LinkFault::Replace(byte) => received = Some(Received::good(byte)),
                LinkFault::Drop => received = None,
                LinkFault::Duplicate | LinkFault::Insert(_) => {
                    let (place, byte) = match fault {
                        LinkFault::Insert(byte) => (member.next, byte),
                        _ => (member.next + 1, octet.byte),
                    };
                    let inserted = QueuedOctet {
                        octet: byte.into(),
                        genuine: false,
                        counted: None,
                    };
                    member.telegram.insert(place, inserted);
                    if place == member.next {
                        return;
                    }
                }
                LinkFault::Delay(span) => {
                    member.begins = at + span;
                    return;
                }
                LinkFault::Break(span) => held = Some(span),
                LinkFault::Overrun => {
                    received = Some(Received::bad(octet.byte, LineError::Overrun));
                }
                LinkFault::Cut => member.unplugged = true,
                LinkFault::Join => member.unplugged = false,
            }
        }
        self.fly(place, at, sent, received, held);
    }

    /// Puts an octet on the line; `held` is the time for which the line is held at 0 from its start on.
    fn fly(
        &mut self,
        place: usize,
        start: Instant,
        sent: Option<u8>,
        mut received: Option<Received>,
        held: Option<Span>,
    ) {
        let end = start + self.octet;
        let unplugged = self.members[place].unplugged;
        if unplugged || start < self.broken_until {
            received = None;
        } else if let Some(span) = held {
            received = Some(Received::bad(0, LineError::Break));
            self.broken_until = start + span;
        }
        if received.is_some() {
            let mut hit = false;
            let others = self.members.iter_mut().enumerate();
            for (_, other) in others.filter(|(other, _)| *other != place) {
                if let Some(flying) = &mut other.flying
                    && flying.end > start
                    && let Some(octet) = &mut flying.received
                {
                    octet.error = Some(LineError::Framing);
                    hit = true;
                }
            }
            if hit && let Some(octet) = &mut received {
                octet.error = Some(LineError::Framing);
            }
        }
        if !unplugged {
            self.busy_until = self.busy_until.max(end).max(self.broken_until);
        }
        self.members[place].flying = Some(Flying {
            start,
            end,
            sent,
            received,
        });
    }

    /// Ends the octet that a station has on the line.
    fn end(&mut self, place: usize) {
        let member = &mut self.members[place];
        let Some(flying) = member.flying.take() else {
            return;
        };
        let Flying { start, end, .. } = flying;
        member.sent_until = end;
        member.next += 1;
        member.begins = end + member.pause();
        if self.keeps_record {
            member.record.push(LineByte {
                at: end,
                sent: flying.sent,
                received: flying.received.map(|octet| octet.byte),
                error: flying.received.and_then(|octet| octet.error),
                solicited: true,
            });
        }
        let done = member.next == member.telegram.len();
        if done && member.again {
            member.again = false;
            let octets = std::mem::take(&mut member.former);
            member.load(end + self.bit * REPEAT_BITS, &octets);
            member.former = octets;
        } else if done {
            self.stations[place].sent(end);
        }
        let Some(octet) = flying.received else {
            return;
        };
        for (other, station) in self.stations.iter_mut().enumerate() {
            let member = &self.members[other];
            // A station that has sent during any part of the octet has not heard it.
            let deaf = member.flying.is_some() || member.sent_until > start || member.unplugged;
            if other != place && !deaf {
                station.hear(end, octet);
            }
        }
    }
}
