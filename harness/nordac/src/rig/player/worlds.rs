//! Whether slaves could have sent what came behind an adapter.
//!
//! They are played again with every telegram of the bench. When a telegram has reached them is not known exactly: not before it had left the
//! bench, and not behind the time at which its reply was read. Slaves could have sent what came if for every telegram there is such a time with
//! which they send these very octets. So nothing is excused because it is late, and where a motor moves the reply says itself when it was asked.

mod line;

use crate::rig::known::Known;
use crate::rig::observed::{Agreement, Turn, WHOLE};
use crate::rig::settle::{Assumed, search};
use crate::simulate::SlaveSetup;
use harness_bench::rig::playing::observed::Beats;
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::nordac::properties::Description;
use harness_proto::nordac::words::{State, zsw};
use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::profibus::{BusRate, Pdu, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::deviation::Deviant;
use harness_sim::octet_segment::LineStation;
use line::{are_few, are_whole, damages, late_reply};

/// How exact the times of a right inverter are: one may look at its words and move its ramp in a cycle.
const CYCLE: Span = Span::from_millis(20);

/// How long an actual value stands at most where another one of the same motor changes.
const MOMENT: Span = Span::from_millis(1);

/// Parameters that follow a motor: the past faults with their frequencies, and the present one (5.7).
const FOLLOWING: [u16; 6] = [1801, 1802, 1803, 1804, 1805, 1813];

/// Parameters that only the slave knows: warnings, hours, version and temperature, and behind them the fault memory, of which only the last
/// fault is read (5.7).
const OWN: [u16; 10] = [1807, 1808, 1812, 1825, 1801, 1802, 1803, 1804, 1805, 1806];

/// How many of them are the fault memory.
const FAULT_MEMORY: usize = 6;

/// The last fault, and what is kept of it that follows from the conversation in which it has come: its code, the frequency and the
/// parameter set (5.7).
const LAST_FAULT: u16 = 1801;
const FOLLOWS: [u16; 3] = [0, 2, 6];

/// The rate at which the slaves hear: a stream may hand a telegram over at once, whatever the rate of the line.
const HEARD_AT: BusRate = BusRate::K1500;

/// How long before the first telegram the slaves were switched on.
const SWITCHED_ON: Span = Span::from_millis(10_000);

/// The most times in one window at which slaves do something by themselves that are looked at.
const MOST_EVENTS: usize = 16;

/// How often a window is halved in search of a time: after this number of halvings an hour is shorter than a bit.
const HALVES: usize = 48;

/// How many telegrams and replies a line loses in one attempt at most.
pub(super) const MOST_LOST: usize = 3;

/// The most ways to lose them that are tried for one telegram.
const MOST_WAYS: usize = 4;

/// Where the slaves differ from what came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Differs {
    /// Behind which telegram, counted from 0.
    pub(super) turn: usize,
    /// What they send if the telegram has reached them at once.
    pub(super) wanted: Vec<u8>,
    /// How many octets of it came.
    agreed: usize,
    /// A reply before was not read whole, and the bench has not waited for it: it may have sent into it.
    pub(super) torn: bool,
}

/// Whether right slaves of which this is `known`, with some values of the points that are not settled of them, could have sent what came over a
/// line that has lost this many telegrams or replies at most; returns behind which telegrams.
///
/// # Errors
/// Where the slaves as they are known differ.
pub(super) fn right_slaves_send(
    known: &[Known],
    (rate, most_lost): (BusRate, usize),
    turns: &[Turn],
    beats: &Beats,
) -> Result<Vec<usize>, Differs> {
    let send = |all: &Assumed| {
        beats.beat();
        let slaves = known.iter().zip(all);
        let slaves: Vec<_> = slaves.map(|(known, own)| known.model(*own)).collect();
        World::new(&slaves, rate).plays(turns, 0, most_lost)
    };
    let base: Assumed = known.iter().map(|own| own.properties).collect();
    let first = send(&base);
    if first.is_ok() {
        return first;
    }
    let may = |place: usize, property: &Description| !known[place].is_settled(property);
    match search(&base, may, |all| agreement(&send(all))).first() {
        None => first,
        Some((_, all)) => send(all),
    }
}

/// How far slaves send what came.
fn agreement(found: &Result<Vec<usize>, Differs>) -> Agreement {
    match found {
        Ok(_) => WHOLE,
        Err(own) => own.turn * 1024 + own.agreed.min(1023),
    }
}

/// Plays slaves that were just switched on with the telegrams of the bench. What came before the scenario is not compared.
///
/// # Errors
/// The first reply that they cannot have sent.
pub(super) fn could_send(
    slaves: &[SlaveSetup],
    rate: BusRate,
    turns: &[Turn],
) -> Result<(), Differs> {
    World::new(slaves, rate).plays(turns, 0, 0).map(|_| ())
}

/// Slaves as they may be.
#[derive(Clone)]
struct World {
    slaves: Vec<Deviant>,
    /// The parameters whose values are not compared.
    own: &'static [u16],
    /// Whether the slave was without a fault, so that a present one has come since.
    worked: bool,
    /// Whether a fault has come in this conversation: what is kept of it is compared behind its acknowledgement too.
    failed: bool,
    rate: BusRate,
    /// When the last octet had passed.
    free: Instant,
    /// By how much the time of the slaves is ahead of the bench's, at least and at most, in units.
    ahead: (i64, i64),
    /// What they have sent and the bench has not read: a computer that stood still reads it behind its next telegram.
    owed: Vec<Vec<u8>>,
    /// The bench has not waited for it: more octets than a telegram's had left, which a slave answers where a stream parts them.
    torn: bool,
    /// The actual value that came last.
    actual: Option<i16>,
}

/// A time moved by a number of units, later or earlier.
fn moved(at: Instant, units: i64) -> Instant {
    let span = Span::from_units(units.unsigned_abs());
    if units < 0 { at - span } else { at + span }
}

/// By how much one time is behind another one, in units.
fn behind(at: Instant, before: Instant) -> i64 {
    let units = |span: Span| i64::try_from(span.units()).unwrap_or(i64::MAX);
    units(at.since(before)) - units(before.since(at))
}

impl World {
    fn new(slaves: &[SlaveSetup], rate: BusRate) -> Self {
        let remembers = slaves.iter().any(|own| !own.history.faults.is_empty());
        let slaves = slaves.iter().map(|own| own.drive(HEARD_AT, Instant::START));
        Self {
            slaves: slaves.collect(),
            own: match remembers {
                true => &OWN,
                false => &OWN[..OWN.len() - FAULT_MEMORY],
            },
            worked: false,
            failed: false,
            rate,
            free: Instant::START,
            ahead: (0, 0),
            owed: Vec::new(),
            torn: false,
            actual: None,
        }
    }

    /// Takes the telegrams from a place on, of which the line may have lost some, or their replies; returns which.
    ///
    /// # Errors
    /// The first reply that the slaves cannot have sent.
    fn plays(self, turns: &[Turn], from: usize, most_lost: usize) -> Result<Vec<usize>, Differs> {
        let mut world = self;
        for (number, turn) in turns.iter().enumerate().skip(from) {
            let differs = match world.takes(number, turn, turns.get(number + 1)) {
                Ok(own) if own.owed.len() <= world.owed.len() || !are_few(&turns[number..]) => {
                    world = own;
                    continue;
                }
                // What did not come may come behind the next telegram, or this telegram with that one, or the line has lost one of them.
                Ok(own) => match own.plays(turns, number + 1, most_lost) {
                    Err(differs) => {
                        let late = late_reply(turns, number);
                        let late = late.map(|own| world.clone().plays(&own, number, most_lost));
                        match late {
                            Some(Ok(lost)) => return Ok(lost),
                            _ => differs,
                        }
                    }
                    lost => return lost,
                },
                Err(differs) => differs,
            };
            if most_lost == 0 {
                return Err(differs);
            }
            let soon = world.soon(turn);
            let (mut heard, reply) = world.hears(&turn.octets, soon);
            let (from, until) = world.window(turn, turns.get(number + 1));
            heard.ahead = (behind(soon, until), behind(soon, from));
            let sent = [&world.owed[..], &[reply]].concat();
            let unheard = turn.came.is_empty().then(|| (1, world.clone()));
            let damaged = damages(&sent, &turn.came).into_iter();
            let damaged = damaged.map(|(lost, owed)| {
                let world = heard.clone();
                (lost, Self { owed, ..world })
            });
            // Where a motor moves, what is left of a reply need not be that of this moment.
            let garbled = (!are_whole(&turn.came)).then(|| (1, heard.clone().owing_nothing()));
            let ways: Vec<_> = damaged.chain(garbled).chain(unheard).collect();
            for (lost, own) in ways.into_iter().filter(|own| own.0 <= most_lost) {
                let next = number + 1;
                if let Ok(more) = own.plays(turns, next, most_lost - lost) {
                    return Ok((next.saturating_sub(lost)..next).chain(more).collect());
                }
            }
            return Err(differs);
        }
        let owing = world.owed.len();
        match owing <= most_lost {
            true => Ok((turns.len() - owing..turns.len()).collect()),
            false => Err(Differs {
                turn: turns.len().saturating_sub(1),
                wanted: world.owed.concat(),
                agreed: 0,
                torn: world.torn,
            }),
        }
    }

    fn owing_nothing(mut self) -> Self {
        self.owed.clear();
        self
    }

    /// When a telegram has reached the slaves, if it has done so at once.
    fn soon(&self, turn: &Turn) -> Instant {
        let octets = HEARD_AT.octet_time() * turn.octets.len() as u64;
        let least = self.free + HEARD_AT.bit_time() * SYN_BITS + octets;
        least.max(turn.left + SWITCHED_ON)
    }

    /// When a telegram has reached the slaves at the earliest and at the latest, on the bench's clock.
    fn window(&self, turn: &Turn, next: Option<&Turn>) -> (Instant, Instant) {
        let left = turn.left + SWITCHED_ON;
        let read = turn.read.or(next.map(|own| own.left));
        let until = read.map_or(left, |own| (own + SWITCHED_ON).max(left));
        // A stream is not as slow as a line.
        (
            left - self.rate.octet_time() * turn.octets.len() as u64,
            until,
        )
    }

    /// The slaves behind a telegram and what came to it.
    fn takes(&self, number: usize, turn: &Turn, next: Option<&Turn>) -> Result<Self, Differs> {
        let octets = turn.octets.len() as u64;
        let least = self.free + HEARD_AT.bit_time() * SYN_BITS + HEARD_AT.octet_time() * octets;
        let (from, until) = self.window(turn, next);
        let soon = self.soon(turn);
        let (mut world, reply) = self.hears(&turn.octets, soon);
        if turn.step.is_none() {
            world.ahead = (behind(soon, until), behind(soon, from));
            return Ok(world.owing_nothing());
        }
        let first = moved(from - CYCLE, self.ahead.0).max(least);
        let last = moved(until + CYCLE, self.ahead.1).max(first);
        let found = match self.sends(&reply, turn) {
            true => Some((soon, world.clone())),
            false => self
                .at_any_time(turn, [first, soon.clamp(first, last), last], least)
                .or_else(|| self.in_parts(turn, soon)),
        };
        if let Some((at, mut world)) = found {
            // Times count from the last reply on that does not depend on its time.
            let (_, late) = self.hears(&turn.octets, last);
            if self.sends(&late, turn) {
                world.ahead = (behind(at, until), behind(at, from));
            }
            world.actual = actual(&turn.came).or(self.actual);
            return Ok(world.owing_nothing());
        }
        let sent = [&self.owed.concat()[..], &reply].concat();
        let came: Vec<u8> = turn.came.iter().map(|own| *own as u8).collect();
        if next.is_some() && sent.starts_with(&came) && turn.came.iter().all(|own| *own < 0x100) {
            world.owed.push(reply);
            let mut came = came.len();
            world.owed.retain_mut(|own| {
                let part = came.min(own.len());
                came -= part;
                own.drain(..part);
                !own.is_empty()
            });
            return Ok(world);
        }
        let pairs = sent.iter().zip(&turn.came);
        let agreed = pairs.take_while(|(own, came)| u16::from(**own) == **came);
        Err(Differs {
            turn: number,
            agreed: agreed.count(),
            wanted: sent,
            torn: self.torn,
        })
    }

    /// Whether a reply, behind what is owed, is what came.
    fn sends(&self, reply: &[u8], turn: &Turn) -> bool {
        let sent = wide(&[&self.owed.concat()[..], reply].concat());
        let alike = || {
            let sent = self.without_own(&sent)?;
            Some(sent == self.without_own(&turn.came)?)
        };
        sent == turn.came || alike() == Some(true)
    }

    /// A reply without the value of a parameter that only the slave knows; `None` where it shows none.
    fn without_own(&self, octets: &[u16]) -> Option<(u8, Image)> {
        let (pdu, ppo) = inputs(octets)?;
        let mut image = Image::decode(ppo, pdu.data()).filter(|_| ppo.has_pkw())?;
        let shows = matches!(image.pkw.ak(), 1 | 4);
        let number = image.pkw.number();
        let known = number == LAST_FAULT && FOLLOWS.contains(&(image.pkw.ind >> 8));
        if !shows || !self.own.contains(&number) || known && self.failed {
            return None;
        }
        image.pkw.pwe = 0;
        Some((pdu.fc().0, image))
    }

    /// Whether the slave, the only one, has a fault.
    fn has_fault(&self) -> bool {
        match &self.slaves[..] {
            [slave] => slave.drive().inverter().state() == State::Fault,
            _ => false,
        }
    }

    /// The slaves behind octets of which the last one ends at this time, and what they reply.
    fn hears(&self, octets: &[u8], end: Instant) -> (Self, Vec<u8>) {
        let mut world = self.clone();
        let octet = HEARD_AT.octet_time();
        let mut reply = Vec::new();
        world.free = end;
        for slave in &mut world.slaves {
            for (place, byte) in octets.iter().enumerate() {
                let at = end - octet * (octets.len() - 1 - place) as u64;
                slave.hear(at, Received::good(*byte));
            }
            while let Some(wish) = slave.wants() {
                let at = wish.ready.max(world.free);
                slave.advance(at);
                let mut sent = Vec::new();
                slave.begin(at, &mut sent);
                world.free = at + octet * sent.len() as u64;
                slave.sent(world.free);
                reply.extend(sent.iter().map(|own| own.byte));
            }
        }
        let has_fault = world.has_fault();
        world.failed |= world.worked && has_fault;
        world.worked |= !has_fault;
        (world, reply)
    }

    /// A time in a window at which a telegram leads to what came.
    fn at_any_time(
        &self,
        turn: &Turn,
        [first, soon, last]: [Instant; 3],
        least: Instant,
    ) -> Option<(Instant, Self)> {
        let mut times = vec![first, soon, last];
        times.extend(self.events(first, last));
        times.sort_unstable();
        times.dedup();
        let mut before: Option<(Instant, Option<i16>)> = None;
        let wanted = actual(&turn.came);
        for at in times {
            let (world, reply) = self.hears(&turn.octets, at);
            if self.sends(&reply, turn) {
                return Some((at, world));
            }
            let shown = actual(&wide(&reply));
            if let Some((earlier, start)) = before
                && let Some(found) = self.between(turn, (earlier, start), (at, shown), wanted)
            {
                return Some(found);
            }
            before = Some((at, shown));
        }
        if first > least {
            None
        } else {
            self.at_once(turn, first)
        }
    }

    /// The slaves behind octets of which more stand behind a telegram: a stream may make a pause between them.
    fn in_parts(&self, turn: &Turn, at: Instant) -> Option<(Instant, Self)> {
        let used = match Telegram::decode(&turn.octets) {
            Decoded::Value { used, .. } if used < turn.octets.len() => used,
            _ => return None,
        };
        let (telegram, rest) = turn.octets.split_at(used);
        let (world, mut reply) = self.hears(telegram, at);
        let (mut world, more) = world.hears(rest, world.free + MOMENT);
        reply.extend(more);
        let whole = self.sends(&reply, turn);
        let begun = wide(&reply).starts_with(&turn.came);
        world.torn |= !whole;
        (whole || begun).then_some((at, world))
    }

    /// The slaves behind a telegram that has reached them sooner behind the one before than they can be played: the motor has moved in the right
    /// direction, and not as far.
    fn at_once(&self, turn: &Turn, first: Instant) -> Option<(Instant, Self)> {
        let (world, reply) = self.hears(&turn.octets, first);
        let sent = wide(&reply);
        let (before, shown, wanted) = (self.actual?, actual(&sent)?, actual(&turn.came)?);
        let on_the_way = (before.min(shown)..=before.max(shown)).contains(&wanted);
        let alike = self.nearly_sends(turn, &sent, first);
        (on_the_way && alike && self.owed.is_empty()).then_some((first, world))
    }

    /// Whether a reply is what came but for its actual value, as far as this does not follow from the moment in which it has this value.
    fn nearly_sends(&self, turn: &Turn, sent: &[u16], at: Instant) -> bool {
        let (Some(own), Some(came)) = (Moving::of(sent), Moving::of(&turn.came)) else {
            return false;
        };
        let mut bits = [at - MOMENT, at + MOMENT].into_iter().filter_map(|at| {
            let (_, reply) = self.hears(&turn.octets, at.max(self.free));
            Moving::of(&wide(&reply)).map(|own| own.bits)
        });
        own.rest == came.rest
            && own
                .numbers
                .iter()
                .zip(came.numbers)
                .all(|(own, came)| own.abs_diff(came) <= 1)
            && (own.bits == came.bits || bits.any(|own| own == came.bits))
    }

    /// The times in a window at which slaves do something by themselves, and those right before.
    fn events(&self, first: Instant, last: Instant) -> Vec<Instant> {
        let mut times = Vec::new();
        let mut slaves = self.slaves.clone();
        for _ in 0..MOST_EVENTS {
            let due = slaves.iter().filter_map(LineStation::next_action).min();
            let Some(due) = due.filter(|own| *own <= last) else {
                break;
            };
            slaves.iter_mut().for_each(|own| own.advance(due));
            let both = [due - Span::from_units(1), due];
            times.extend(both.into_iter().filter(|own| *own >= first));
        }
        times
    }

    /// A time between two of which one leads to a lower actual value than what came has, and one to a higher one.
    fn between(
        &self,
        turn: &Turn,
        (mut from, start): (Instant, Option<i16>),
        (mut to, end): (Instant, Option<i16>),
        wanted: Option<i16>,
    ) -> Option<(Instant, Self)> {
        let (start, end, wanted) = (start?, end?, wanted?);
        let (low, high) = (start.min(end), start.max(end));
        if start == end || !(low..=high).contains(&wanted) {
            return None;
        }
        for _ in 0..HALVES {
            let middle = from + Span::from_units(to.since(from).units() / 2);
            if middle == from {
                break;
            }
            let (world, reply) = self.hears(&turn.octets, middle);
            if self.sends(&reply, turn) {
                return Some((middle, world));
            }
            let sent = wide(&reply);
            let shown = actual(&sent)?;
            if shown == wanted && self.owed.is_empty() && self.nearly_sends(turn, &sent, middle) {
                return Some((middle, world));
            }
            // Another value beside the actual one differs: it follows the motor in smaller or larger steps.
            let passed = if start < end {
                shown > wanted
            } else {
                shown < wanted
            };
            if passed || shown == wanted && end == wanted {
                to = middle;
            } else {
                from = middle;
            }
        }
        None
    }
}

/// The inputs in a reply that carries them.
fn inputs(octets: &[u16]) -> Option<(Pdu, PpoType)> {
    let octets: Vec<u8> = octets.iter().map(|own| *own as u8).collect();
    let Decoded::Value { value, used } = Telegram::decode(&octets) else {
        return None;
    };
    let pdu = value.pdu().filter(|_| used == octets.len())?;
    let service = Service::of(pdu.ssap())?;
    let carries = matches!(service, Service::DataExchange | Service::RdInp);
    let length = pdu.data().len();
    let ppo = PpoType::ALL.into_iter().find(|own| own.octets() == length);
    Some((*pdu, ppo.filter(|_| carries)?))
}

/// The main actual value (HIW) in a reply.
fn actual(octets: &[u16]) -> Option<i16> {
    let (pdu, ppo) = inputs(octets)?;
    let place = ppo.words_begin() + 2;
    let word = pdu.data().get(place..place + 2)?;
    Some(i16::from_be_bytes([word[0], word[1]]))
}

/// What follows a motor in a reply beside its main actual value, and the rest of the reply.
#[derive(PartialEq, Eq)]
struct Moving {
    /// Bits of the status word that compare the frequency.
    bits: u16,
    /// The value of a parameter, and the second actual value.
    numbers: [u16; 2],
    rest: (u8, Image),
}

impl Moving {
    fn of(octets: &[u16]) -> Option<Self> {
        let (pdu, ppo) = inputs(octets)?;
        let mut rest = Image::decode(ppo, pdu.data())?;
        let follows = zsw::AT_SETPOINT | zsw::REFERENCE;
        let bits = rest.words[0] & follows;
        let mut numbers = [0, rest.words[3]];
        if matches!(rest.pkw.ak(), 1 | 4) && FOLLOWING.contains(&rest.pkw.number()) {
            numbers[0] = rest.pkw.low_word();
            rest.pkw.pwe = 0;
        }
        rest.words[0] &= !follows;
        (rest.words[1], rest.words[3]) = (0, 0);
        Some(Self {
            bits,
            numbers,
            rest: (pdu.fc().0, rest),
        })
    }
}

/// Octets as they come without a line error.
fn wide(octets: &[u8]) -> Vec<u16> {
    octets.iter().map(|own| u16::from(*own)).collect()
}

#[cfg(test)]
mod tests;
