//! Simulated NORDAC inverters on a segment that clients share as masters, in real time.
//!
//! A stream has no idle times that count: a telegram of a client is known by its octets. It leaves after 33 idle bits, without a gap. Octets that
//! begin no telegram, and those of one that does not go on, leave as they came.

use super::language::Nordac;
use super::language::now::{ONLY, now};
use super::live::Recorder;
use super::simulate::Bench;
use harness_bench::counted::counted;
use harness_bench::medium::ErrorMarks;
use harness_bench::scenario::parse::header::{Part, read};
use harness_bench::scenario::plan::{Plan, plan as settle};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_bench::serve::{ControlAnswer, ServedBus, step_at_once};
use harness_bench::web::LiveView;
use harness_proto::decode::Decoded;
use harness_proto::line::{LineError, Received};
use harness_proto::marks::{BadMark, Unmark, mark};
use harness_proto::nordac::Parameter;
use harness_proto::nordac::pkw::Index;
use harness_proto::profibus::fdl::{MAX_TELEGRAM, SD1, SD2, SD3, Telegram};
use harness_proto::profibus::{BusRate, rate::SYN_BITS};
use harness_proto::time::{Instant, Span};
use harness_sim::fault::Flips;
use harness_sim::nordac::Drive;
use harness_sim::nordac::slave::Refusal;
use harness_sim::octet_segment::{Octet, Wish};
use std::collections::VecDeque;

/// How much of a client's octets waits for the line at most: the rest stays with the client.
const WAITING: Span = Span::from_millis(500);
/// The most time that is made up for at once. A program that was stopped for longer resumes where it was.
const CATCH_UP: Span = Span::from_millis(1_000);
/// Behind this time without another octet, a telegram that is not complete leaves as it is. Serial adapters deliver what they have within 16 ms.
const GAP: Span = Span::from_millis(20);
/// How long octets for a client are collected.
const BATCH: Span = Span::from_micros(100);
/// While nothing happens: how often the drives are advanced.
const IDLE: Span = Span::from_millis(20);
/// Most octets that wait for a client. Further ones are lost, as in a serial port that is not read.
const UNREAD: usize = 64 << 10;

/// A client's place.
#[derive(Clone, Debug, Default)]
struct Seat {
    taken: bool,
    unmark: Unmark,
    /// Octets of the client that are no telegram yet, and when the last of them came.
    begun: Vec<Received>,
    begun_at: Instant,
    /// When the line will have carried what the client has sent.
    sent_by: Instant,
    /// For the client.
    outbox: VecDeque<u8>,
    lost: u64,
}

/// A segment of drives with places for masters.
#[derive(Debug)]
pub(crate) struct SegmentServer {
    pub(super) bench: Bench,
    pub(super) plan: Plan<Nordac>,
    marks: ErrorMarks,
    /// What a live page shows, while one is open.
    pub(super) recorder: Option<Recorder>,
    seats: Vec<Seat>,
    /// Why each slave refuses what its master sets it up with, as far as it was said.
    refusals: Vec<Option<Refusal>>,
    /// The segment's time `base.1` is the clock's time `base.0`.
    base: (Instant, Instant),
    clock: Instant,
}

/// The slave without which a bench would have none.
const USUAL: u8 = 8;

/// The slaves of a header, and those with these addresses; by default that is `USUAL`, if there is no header. The bus controls these: their interface
/// is 2 (1621), unless the header says another.
///
/// # Errors
/// The header has mistakes. Steps after it are ignored.
pub(crate) fn bench(
    addresses: Option<&[u8]>,
    header: Option<&Source>,
) -> Result<Plan<Nordac>, Problems> {
    let usual = if header.is_none() { &[USUAL][..] } else { &[] };
    let lines = addresses
        .unwrap_or(usual)
        .iter()
        .map(|address| format!("slave {address}\nslave {address} parameter 1621 = 2\n"));
    let setup = Source::new("setup", lines.collect::<String>());
    let mut scenario: Scenario<Nordac> = read(&setup, Part::Header)?;
    if let Some(header) = header {
        let more: Scenario<Nordac> = read(header, Part::Header)?;
        scenario.header.rate = more.header.rate.or(scenario.header.rate);
        scenario.header.slaves.extend(more.header.slaves);
    }
    scenario.steps.clear();
    settle(&scenario, header.unwrap_or(&setup), None)
}

impl SegmentServer {
    /// Serves the slaves of a plan to this number of clients.
    pub(crate) fn new(plan: Plan<Nordac>, clients: usize, marks: ErrorMarks) -> Self {
        let mut bench = Bench::with_guests(&plan.setup, clients.saturating_sub(1));
        bench.line().keep_no_record();
        Self {
            base: (Instant::START, bench.time()),
            bench,
            plan,
            marks,
            recorder: None,
            refusals: Vec::new(),
            seats: vec![Seat::default(); clients],
            clock: Instant::START,
        }
    }

    /// Whether a client has the place of a master.
    pub(super) fn has_master(&self) -> bool {
        self.seats.iter().any(|seat| seat.taken)
    }

    pub(super) fn rate(&self) -> BusRate {
        self.plan.setup.rate
    }

    /// Sends telegrams that are complete, and what can no longer become one; with `all` also the begin of one.
    fn send(&mut self, seat: usize, all: bool) {
        let rate = self.rate();
        let Some(client) = self.seats.get_mut(seat) else {
            return;
        };
        let begun: Vec<u8> = client.begun.iter().map(|octet| octet.byte).collect();
        let mut sent = 0;
        while sent < begun.len() {
            let rest = &begun[sent..];
            let length = match Telegram::decode(rest) {
                Decoded::Value { used, .. } => used,
                Decoded::Bad { .. } => match spoiled(rest) {
                    Some(length) if length <= rest.len() || all => length.min(rest.len()),
                    _ => break,
                },
                Decoded::NeedMore if all => rest.len(),
                Decoded::NeedMore => break,
            };
            let octets = client.begun[sent..sent + length].iter().map(octet);
            let octets: Vec<Octet> = octets.collect();
            let idle = rate.bit_time() * SYN_BITS;
            let free = client.sent_by.max(self.bench.time()) + idle;
            client.sent_by = free + rate.octet_time() * octets.len() as u64;
            let wish = Wish {
                ready: self.bench.time(),
                idle_bits: SYN_BITS,
            };
            if let Some(host) = self.bench.client(seat) {
                host.send(wish, octets);
            }
            sent += length;
        }
        client.begun.drain(..sent);
    }

    /// Hands over what the clients' places have heard.
    fn fetch(&mut self) {
        for (place, seat) in self.seats.iter_mut().enumerate() {
            let Some(host) = self.bench.client(place) else {
                continue;
            };
            while let Some((_, read)) = host.receive() {
                let marked = mark(read);
                let octets = match self.marks {
                    ErrorMarks::None => std::slice::from_ref(&read.byte),
                    ErrorMarks::InBand => marked.as_bytes(),
                };
                if !seat.taken {
                } else if seat.outbox.len() + octets.len() > UNREAD {
                    seat.lost += 1;
                } else {
                    seat.outbox.extend(octets);
                }
            }
            host.forget();
        }
    }

    fn on_clock(&self, at: Instant) -> Instant {
        let (from, to) = self.base;
        from + at.since(to)
    }
}

/// How many octets leave together where no telegram begins: a telegram with a mistake in it by its announced length, and anything else up to the
/// next octet with which a telegram may begin. `None` while the length has not come.
fn spoiled(octets: &[u8]) -> Option<usize> {
    match *octets {
        [SD1, ..] => Some(6),
        [SD3, ..] => Some(14),
        [SD2, length, again, SD2, ..] if length == again && (4..=249).contains(&length) => {
            Some(usize::from(length) + 6)
        }
        _ => {
            let next = octets[1..]
                .iter()
                .position(|octet| [SD1, SD2, SD3].contains(octet));
            Some(next.map_or(octets.len(), |next| next + 1))
        }
    }
}

/// An octet of a client as it leaves: a mark becomes the error that it stands for.
fn octet(read: &Received) -> Octet {
    let flips = match read.error {
        None => Flips::default(),
        Some(LineError::Parity | LineError::Overrun) => Flips {
            parity: true,
            ..Flips::default()
        },
        Some(LineError::Framing | LineError::Break) => Flips {
            stop: true,
            ..Flips::default()
        },
    };
    Octet {
        flips,
        ..Octet::from(read.byte)
    }
}

impl ServedBus for SegmentServer {
    fn seats(&self) -> usize {
        self.seats.len()
    }

    fn masters(&self) -> usize {
        self.seats.len()
    }

    fn name(&self, seat: usize) -> String {
        format!("master {}", seat + 1)
    }

    fn title(&self, seat: usize) -> String {
        let slaves = counted(self.plan.setup.slaves.len() as u64, "slave");
        format!(
            "{}: {slaves}, {} kbit/s",
            self.name(seat),
            self.rate().name()
        )
    }

    fn come(&mut self, seat: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.taken = true;
            seat.unmark = Unmark::default();
        }
    }

    fn go(&mut self, seat: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.taken = false;
            seat.begun.clear();
            seat.outbox.clear();
            seat.lost = 0;
        }
    }

    fn room(&self, seat: usize) -> usize {
        let Some(seat) = self.seats.get(seat) else {
            return 0;
        };
        let octet = self.rate().octet_time().units().max(1);
        let waiting = seat.sent_by.since(self.bench.time());
        let room = WAITING.saturating_sub(waiting).units() / octet;
        // At a low rate too a whole telegram has room.
        usize::try_from(room).map_or(MAX_TELEGRAM, |room| room.min(MAX_TELEGRAM))
    }

    fn receive(&mut self, seat: usize, octets: &[u8]) -> Result<(), BadMark> {
        let Some(client) = self.seats.get_mut(seat) else {
            return Ok(());
        };
        let mut wrong = Ok(());
        for &octet in octets {
            match self.marks {
                ErrorMarks::None => client.begun.push(Received::good(octet)),
                ErrorMarks::InBand => match client.unmark.push(octet) {
                    None => {}
                    Some(Err(bad)) => wrong = wrong.and(Err(bad)),
                    Some(Ok(octet)) => client.begun.push(octet),
                },
            }
        }
        client.begun_at = self.clock;
        self.send(seat, false);
        wrong
    }

    fn advance(&mut self, clock: Instant) {
        self.clock = self.clock.max(clock);
        let (from, to) = self.base;
        let due = to + self.clock.since(from);
        let most = self.bench.time() + CATCH_UP;
        self.bench.run_to(due.min(most));
        if due > most {
            self.base = (self.clock, self.bench.time());
        }
        for seat in 0..self.seats.len() {
            let client = &self.seats[seat];
            if !client.begun.is_empty() && self.clock >= client.begun_at + GAP {
                self.send(seat, true);
            }
        }
        self.fetch();
    }

    fn transmit(&mut self, seat: usize) -> &[u8] {
        let seat = self.seats.get_mut(seat);
        seat.map_or(&[], |seat| seat.outbox.make_contiguous())
    }

    fn transmitted(&mut self, seat: usize, count: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            let count = count.min(seat.outbox.len());
            seat.outbox.drain(..count);
        }
    }

    fn lost(&self, seat: usize) -> u64 {
        self.seats.get(seat).map_or(0, |seat| seat.lost)
    }

    fn awaited(&self) -> Option<Instant> {
        None
    }

    fn deadline(&self) -> Instant {
        let idle = self.clock + IDLE;
        let begun = self.seats.iter().filter(|seat| !seat.begun.is_empty());
        let gap = begun.map(|seat| seat.begun_at + GAP).min().unwrap_or(idle);
        let event = self.bench.next_event().map_or(idle, |at| self.on_clock(at));
        event
            .max(self.clock + BATCH)
            .min(gap)
            .min(idle)
            .max(self.clock)
    }

    /// A fault (`! telegram 3: lost`), something that happens to a slave from outside the bus (`slave 8 fault on`), or a check of a parameter
    /// (`? slave 8 parameter 1202 = 100`). `state 8` asks what a drive shows.
    fn control(&mut self, line: &str) -> Option<ControlAnswer> {
        let said = line.split('#').next().unwrap_or_default().trim();
        if said.is_empty() {
            return None;
        }
        if let Some(address) = said.strip_prefix("state ") {
            let drive = address
                .trim()
                .parse()
                .ok()
                .and_then(|address| self.bench.drive(address));
            return Some(match drive {
                Some(drive) => ControlAnswer::State(state(drive)),
                None => ControlAnswer::Error(
                    "`state` and the first address of a slave expected: `state 8`".to_owned(),
                ),
            });
        }
        let source = match Source::from_bytes("control".to_owned(), line.trim_end().into()) {
            Ok(source) => source,
            Err(error) => return Some(ControlAnswer::Error(error.to_string())),
        };
        let bench = &mut self.bench;
        let act = |act: &_, span| now(bench, act, span);
        Some(step_at_once(&source, &self.plan, ONLY, act))
    }

    fn remarks(&mut self) -> Vec<String> {
        let slaves = self.plan.setup.slaves.iter();
        let now = slaves.map(|slave| (slave.address, self.bench.drive(slave.address)));
        let now: Vec<_> = now
            .map(|(slave, drive)| (slave, drive.and_then(|drive| drive.slave().refusal())))
            .collect();
        self.refusals.resize(now.len(), None);
        let mut news = Vec::new();
        for ((slave, why), said) in now.into_iter().zip(&mut self.refusals) {
            if let Some(why) = why.filter(|why| *said != Some(*why)) {
                news.push(format!("slave {slave}: {why}"));
            }
            *said = why;
        }
        news
    }

    fn live(&mut self) -> &mut dyn LiveView {
        self
    }
}

/// What a drive shows outside the bus: states, and the size of its frequency in 0.1 Hz.
fn state(drive: &Drive) -> String {
    let (slave, inverter) = (drive.slave(), drive.inverter());
    let row = Parameter::of(1813);
    let frequency = row.and_then(|row| inverter.parameter(row, Index::default()));
    let refused = slave.refusal().map(|why| format!(" refused=\"{why}\""));
    format!(
        "power={} address={} dp={} state={} frequency={}{}",
        if drive.is_powered() { "on" } else { "off" },
        slave.address(),
        slave.state().name(),
        inverter.state().short(),
        frequency.unwrap_or_default(),
        refused.unwrap_or_default(),
    )
}
