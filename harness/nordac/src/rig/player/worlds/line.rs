//! The slaves of a line as one right drive: what they reply to a telegram, and how far that may be off where a motor moves.

use crate::simulate::SlaveSetup;
use harness_bench::qualify::worlds::RightDrive;
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::nordac::words::{State, zsw};
use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::fdl::{ED, MAX_TELEGRAM};
use harness_proto::profibus::{BusRate, Pdu, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::Inverter;
use harness_sim::nordac::deviation::Deviant;
use harness_sim::octet_segment::LineStation as _;
use std::collections::VecDeque;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::{Range, RangeInclusive};

/// The rate at which the slaves hear: a stream may hand a telegram over at once, whatever the rate of the line.
const HEARD_AT: BusRate = BusRate::K1500;

/// How long before the first telegram the slaves were switched on.
const SWITCHED_ON: Span = Span::from_millis(10_000);

/// The idle time in front of a telegram, and where a stream parts one.
const IDLE: Span = Span::from_millis(1);

/// Parameters that only the slave knows: warnings, hours, version and temperature, and after them the fault memory, of which only the last
/// fault is read (5.7).
const UNCOMPARED: [u16; 10] = [1807, 1808, 1812, 1825, 1801, 1802, 1803, 1804, 1805, 1806];

/// How many of them are the fault memory.
const FAULT_MEMORY: usize = 6;

/// The last fault, and what is kept of it that follows from the conversation in which it has come: its code, the frequency and the
/// parameter set (5.7).
const LAST_FAULT: u16 = 1801;
const FOLLOWS: [u16; 3] = [0, 2, 6];

/// The frequency and the voltage of a fault, by number and element; and the present frequency (5.7).
const PAST_FAULTS: RangeInclusive<u16> = 1801..=1805;
const MOVED: [u16; 2] = [2, 3];
const FREQUENCY: (u16, u16) = (1813, 0);

/// How many octets a telegram with a checksum has at least.
const SHORTEST: usize = 6;

/// The bits of the status word that compare the frequency.
const COMPARING: u16 = zsw::AT_SETPOINT | zsw::REFERENCE;

/// A telegram, or what came of one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Piece {
    /// Each with bit 8 where it has a line error.
    pub(super) octets: Vec<u16>,
    /// What came is no telegram.
    pub(super) damaged: bool,
    /// Something stood after the telegram that it answers: its reply need not have come to its end.
    pub(super) begun: bool,
    /// The reply to it is not compared.
    unread: bool,
    /// The inputs in it, if it carries them.
    inputs: Option<Inputs>,
    /// How far the numbers in the inputs may be off.
    bands: [u32; 3],
}

impl Hash for Piece {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (&self.octets, self.bands).hash(state);
    }
}

/// The inputs in a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Inputs {
    head: (u8, u8, u8, Option<u8>, Option<u8>),
    /// All but the numbers.
    rest: Image,
    /// Main actual value, second one and the value of a parameter.
    numbers: [i32; 3],
}

impl Inputs {
    fn of(pdu: &Pdu) -> Option<Self> {
        let carries = matches!(
            Service::of(pdu.ssap())?,
            Service::DataExchange | Service::RdInp
        );
        let mut ppo = PpoType::ALL.into_iter().filter(|_| carries);
        let ppo = ppo.find(|ppo| ppo.octets() == pdu.data().len())?;
        let mut rest = Image::decode(ppo, pdu.data())?;
        let [hiw, pzd4] = [rest.words[1], rest.words[3]].map(|word| i32::from(word.cast_signed()));
        let numbers = [hiw, pzd4, rest.pkw.pwe.cast_signed()];
        (rest.words[1], rest.words[3], rest.pkw.pwe) = (0, 0, 0);
        Some(Self {
            head: (pdu.da(), pdu.sa(), pdu.fc().0, pdu.dsap(), pdu.ssap()),
            rest,
            numbers,
        })
    }
}

impl Piece {
    pub(super) fn request(octets: Vec<u16>, unread: bool) -> Self {
        Self {
            octets,
            unread,
            ..Self::default()
        }
    }

    pub(super) fn of(octets: &[u16]) -> Self {
        let telegram = telegram(octets).filter(|telegram| telegram.1 == octets.len());
        let pdu = telegram.as_ref().and_then(|telegram| telegram.0.pdu());
        Self {
            damaged: telegram.is_none(),
            octets: octets.to_vec(),
            inputs: pdu.and_then(Inputs::of),
            ..Self::default()
        }
    }

    /// Whether what came are the same inputs, but for what moves.
    fn is_near(&self, came: &Self) -> bool {
        let (Some(said), Some(came)) = (self.inputs, came.inputs) else {
            return false;
        };
        // The bits that compare the frequency move with it.
        let moves = if self.bands[0] > 0 { COMPARING } else { 0 };
        let alike = |mut rest: Image| {
            rest.words[0] |= moves;
            rest
        };
        let mut numbers = said.numbers.iter().zip(came.numbers).zip(self.bands);
        said.head == came.head
            && alike(said.rest) == alike(came.rest)
            && numbers.all(|((said, came), band)| said.abs_diff(came) <= band)
    }
}

/// The slaves of a line, in scans of this number of milliseconds.
#[derive(Clone)]
pub(super) struct Line<const SCAN: u64> {
    slaves: Vec<Deviant>,
    /// The parameters whose values are not compared.
    uncompared: &'static [u16],
    /// Whether the slave was without a fault, so that a present one has come since.
    worked: bool,
    /// Whether a fault has come in this conversation: what is kept of it is compared after its acknowledgement too.
    failed: bool,
    /// Their clock.
    now: Instant,
    /// When the last octet had passed, on a clock of the line: what reaches them within a scan does so at one time.
    free: Instant,
    said: VecDeque<Piece>,
}

impl<const SCAN: u64> Line<SCAN> {
    pub(super) fn new(slaves: &[SlaveSetup]) -> Self {
        let remembers = slaves.iter().any(|slave| !slave.history.faults.is_empty());
        let slaves = slaves.iter();
        let slaves = slaves.map(|slave| slave.drive(HEARD_AT, Instant::START));
        let mut line = Self {
            slaves: slaves.collect(),
            uncompared: match remembers {
                true => &UNCOMPARED,
                false => &UNCOMPARED[..UNCOMPARED.len() - FAULT_MEMORY],
            },
            worked: false,
            failed: false,
            now: Instant::START,
            free: Instant::START,
            said: VecDeque::new(),
        };
        line.advance(Instant::START);
        line
    }

    /// Whether the slave, the only one, has a fault.
    fn has_fault(&self) -> bool {
        match &self.slaves[..] {
            [slave] => slave.drive().inverter().state() == State::Fault,
            _ => false,
        }
    }

    /// Octets reach the slaves now, after a pause on the line.
    fn takes(&mut self, octets: &[u8], pause: Span) {
        let octet = HEARD_AT.octet_time();
        let begin = self.free + pause;
        self.free = begin + octet * octets.len() as u64;
        for place in 0..self.slaves.len() {
            let slave = &mut self.slaves[place];
            let inverter = slave.drive().inverter();
            let stood = inverter.moves_until().is_none().then(|| wanted(inverter));
            for (place, byte) in (1..).zip(octets) {
                slave.hear_at(self.now, begin + octet * place, Received::good(*byte));
            }
            let mut sent = Vec::new();
            while self.slaves[place].wants().is_some() {
                let slave = &mut self.slaves[place];
                slave.begin(self.now, &mut sent);
                self.free += octet * sent.len() as u64;
                slave.sent(self.free);
                let reply: Vec<_> = sent.drain(..).map(|octet| octet.byte.into()).collect();
                for range in pieces(&reply, &[]) {
                    let mut piece = Piece::of(&reply[range]);
                    let inverter = self.slaves[place].drive().inverter();
                    piece.bands = self.bands(inverter, stood, piece.inputs.as_ref());
                    self.said.push_back(piece);
                }
            }
        }
        let has_fault = self.has_fault();
        self.failed |= self.worked && has_fault;
        self.worked |= !has_fault;
    }

    /// How far the numbers in a reply may be off: a motor moves within a scan, and what only the slave knows is anything. A motor that `stood`
    /// with what it was to reach, or is to reach now, is exact, as is one at rest.
    fn bands(&self, inverter: &Inverter, stood: Option<i32>, inputs: Option<&Inputs>) -> [u32; 3] {
        let Some(Inputs { rest, numbers, .. }) = inputs else {
            return [0; 3];
        };
        let step = inverter.moves_within(Self::SCAN);
        let [hiw, pzd4, value] = step.map(|step| u32::from(step) + 1);
        let exact = |stood| [0, stood, wanted(inverter)].contains(&numbers[0]);
        let stands = stood.is_some_and(exact);
        let (number, element) = (rest.pkw.number(), rest.pkw.ind >> 8);
        let follows = self.failed && number == LAST_FAULT && FOLLOWS.contains(&element);
        let past = PAST_FAULTS.contains(&number) && MOVED.contains(&element);
        let moved = past && numbers[2] != 0 || !stands && (number, element) == FREQUENCY;
        let pwe = match matches!(rest.pkw.ak(), 1 | 4) {
            true if self.uncompared.contains(&number) && !follows => u32::MAX,
            true if moved => value,
            _ => 0,
        };
        match stands {
            true => [0, 0, pwe],
            false => [hiw, pzd4, pwe],
        }
    }
}

/// The main actual value that a motor is to reach.
fn wanted(inverter: &Inverter) -> i32 {
    inverter.wanted_actual_value().cast_signed().into()
}

impl<const SCAN: u64> RightDrive for Line<SCAN> {
    type Piece = Piece;
    const SCAN: Span = Span::from_millis(SCAN);
    /// 0.1 % (our choice).
    const DRIFT: i64 = 1_000;

    fn due(&self) -> Option<Instant> {
        let slaves = self.slaves.iter();
        let due = slaves.flat_map(|slave| {
            let moves = slave.drive().inverter().moves_until();
            slave.next_action().into_iter().chain(moves)
        });
        // All times are whole scans, so that those of two worlds can be the same.
        let due = due.min()?.since(Instant::START + SWITCHED_ON).units();
        let scan = Self::SCAN.units();
        Some(Instant::START + Span::from_units(due.div_ceil(scan) * scan))
    }

    fn rests(&self) -> bool {
        let mut slaves = self.slaves.iter();
        slaves.all(|slave| slave.drive().inverter().moves_until().is_none())
    }

    fn advance(&mut self, to: Instant) {
        self.now = to + SWITCHED_ON;
        let slaves = self.slaves.iter_mut();
        slaves.for_each(|slave| slave.advance(self.now));
    }

    fn hear(&mut self, _: Instant, piece: &Piece) {
        self.takes(&narrow(&piece.octets), IDLE);
        if piece.unread {
            self.said.clear();
        }
    }

    fn hear_parted(&self, _: Instant, piece: &Piece) -> Option<Self> {
        let (_, used) = telegram(&piece.octets)?;
        let octets = narrow(&piece.octets);
        let (telegram, rest) = octets.split_at_checked(used)?;
        let parts = !(rest.is_empty() || piece.unread);
        let mut line = parts.then(|| self.clone())?;
        line.takes(telegram, IDLE);
        line.takes(rest, IDLE);
        Some(line)
    }

    fn say(&mut self) -> Option<Piece> {
        self.said.pop_front()
    }

    fn is(&self, said: &Piece, came: &Piece) -> bool {
        let begun = came.begun && said.octets.starts_with(&came.octets);
        said.octets == came.octets || begun || said.is_near(came)
    }

    fn is_damaged(came: &Piece) -> bool {
        came.damaged
    }

    fn state(&self) -> u64 {
        let mut sum = DefaultHasher::new();
        (self.worked, self.failed).hash(&mut sum);
        for slave in &self.slaves {
            slave.hash_state(self.now, &mut sum);
        }
        sum.finish()
    }
}

/// Octets without their line errors.
pub(super) fn narrow(octets: &[u16]) -> Vec<u8> {
    octets.iter().map(|octet| *octet as u8).collect()
}

/// The telegram that begins here, if it has no line error, and its number of octets.
pub(super) fn telegram(octets: &[u16]) -> Option<(Telegram, usize)> {
    let octets = octets.iter().take(MAX_TELEGRAM);
    let good = octets.map_while(|octet| u8::try_from(*octet).ok());
    match Telegram::decode(&good.collect::<Vec<_>>()) {
        Decoded::Value { value, used } => Some((value, used)),
        _ => None,
    }
}

/// How many octets the telegram has that begins here.
fn length(octets: &[u16]) -> Option<usize> {
    telegram(octets).map(|telegram| telegram.1)
}

/// Whether octets are telegrams and nothing else.
fn is_whole(octets: &[u16]) -> bool {
    octets.is_empty() || length(octets).is_some_and(|length| is_whole(&octets[length..]))
}

/// The places of telegrams in octets, and of what is none: that goes up to one of the ends, or to telegrams that have a checksum or follow the
/// end of one.
pub(super) fn pieces(octets: &[u16], ends: &[usize]) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut from = 0;
    while from < octets.len() {
        let end = ends.iter().copied().find(|end| *end > from);
        let end = end.unwrap_or(octets.len());
        let begins = |place: &usize| {
            let rest = &octets[*place..end];
            let ended = octets[*place - 1] == u16::from(ED);
            length(rest).is_some_and(|length| ended || length >= SHORTEST) && is_whole(rest)
        };
        let to = match length(&octets[from..]) {
            Some(length) => from + length,
            None => (from + 1..end).find(begins).unwrap_or(end),
        };
        all.push(from..to);
        from = to;
    }
    all
}
