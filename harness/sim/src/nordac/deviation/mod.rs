//! Wrong drives and wrong masters: named deviations, for tests that must find them.
//!
//! A [`Deviant`] wraps a right [`Drive`] and is the only place that injects deviations: it changes the telegrams before the drive answers
//! them, and the replies. The drive itself is unchanged. [`DEVIATIONS`] is the table. [`MASTER_DEVIATIONS`] does the same for a master.

mod hears;
mod master;
mod parts;
mod reads;
mod sends;

pub use master::{MASTER_DEVIATIONS, MasterDeviation, MasterLine};

use super::drive::Drive;
use crate::deviation::{self, DeviationTable};
use crate::octet_segment::{LineStation, Octet, Wish};
use harness_proto::line::Received;
use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::Telegram;
use harness_proto::time::Instant;
use parts::{Parts, Reply};
use reads::{Collector, Raw};
use std::hash::{Hash as _, Hasher};

/// A way in which a drive breaks the bus standard or the manual.
pub type Deviation = deviation::Deviation<DpInjection>;

/// How a drive is made to deviate.
#[derive(Clone, Copy)]
pub struct DpInjection(How);

/// Where it deviates.
#[derive(Clone, Copy)]
enum How {
    /// It reads these octets as a telegram where a right drive reads none.
    Reads(fn(&Raw) -> Option<Vec<u8>>),
    /// It answers this request in place of the one on the line.
    Hears(fn(&Context<'_>, &mut Parts)),
    /// It sends this in place of its reply.
    Sends(fn(&Context<'_>, &mut Reply)),
    /// Both.
    Both(fn(&Context<'_>, &mut Parts), fn(&Context<'_>, &mut Reply)),
}

/// The deviations of a drive: those of what it reads, of what it hears, and of what it sends.
pub static DEVIATIONS: DeviationTable<DpInjection> =
    DeviationTable(&[reads::DEVIATIONS, hears::DEVIATIONS, sends::DEVIATIONS]);

/// What a deviant drive remembers.
#[derive(Clone, Debug, Default)]
struct SlaveMemory {
    /// The reply before the present one.
    reply: Vec<u8>,
    /// The inputs of the exchange before the present one.
    inputs: Image,
    /// The outputs of the exchange before the present one.
    outputs: Image,
    /// Requests answered so far.
    answered: u64,
}

/// What a deviation knows.
struct Context<'a> {
    drive: &'a Drive,
    memory: &'a SlaveMemory,
    /// The request as it is on the line.
    request: &'a Parts,
}

impl Context<'_> {
    fn ppo(&self) -> PpoType {
        self.drive.slave().ppo()
    }

    fn address(&self) -> u8 {
        self.drive.slave().address()
    }
}

/// A drive with one deviation, or none.
#[derive(Clone, Debug)]
pub struct Deviant {
    drive: Drive,
    deviation: Option<&'static Deviation>,
    collector: Collector,
    memory: SlaveMemory,
    /// The replies that wait, in order of time.
    replies: Vec<(Instant, Vec<u8>)>,
}

impl Deviant {
    /// Wraps a drive.
    #[must_use]
    pub fn new(drive: Drive, deviation: Option<&'static Deviation>) -> Self {
        Self {
            collector: Collector::new(drive.rate()),
            drive,
            deviation,
            memory: SlaveMemory::default(),
            replies: Vec::new(),
        }
    }

    /// See [`Drive::hash_state`].
    pub fn hash_state(&self, at: Instant, sum: &mut impl Hasher) {
        self.drive.hash_state(at, sum);
        if self.deviation.is_some() {
            let memory = &self.memory;
            (&memory.reply, memory.inputs, memory.outputs).hash(sum);
            (memory.answered % 5).hash(sum);
        }
    }

    /// The right drive inside.
    #[must_use]
    pub const fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The right drive inside.
    pub const fn drive_mut(&mut self) -> &mut Drive {
        &mut self.drive
    }

    /// Takes an octet that has ended at a time of the line's own clock, when the drive's clock stands at `at`.
    pub fn hear_at(&mut self, at: Instant, ended: Instant, octet: Received) {
        let raw = self.collector.hear(ended, octet);
        let how = self.deviation.map(|deviation| deviation.injection.0);
        let telegram = match (self.drive.receive(ended, octet), how, raw) {
            (None, Some(How::Reads(reads)), Some(raw)) if self.drive.is_powered() => {
                reads(&raw).and_then(|octets| Telegram::decode(&octets).value())
            }
            (telegram, ..) => telegram,
        };
        if self.drive.torn() {
            self.replies.clear();
        }
        if let Some(telegram) = telegram {
            self.answer(at, &telegram);
        }
    }

    fn answer(&mut self, at: Instant, telegram: &Telegram) {
        self.drive.advance(at);
        let Some(request) = telegram.pdu().map(Parts::of) else {
            self.drive.answer(at, telegram);
            return;
        };
        let how = self.deviation.map(|deviation| deviation.injection.0);
        let mut heard = request.clone();
        if let Some(How::Hears(hears) | How::Both(hears, _)) = how {
            hears(&self.seen(&request), &mut heard);
        }
        for before in std::mem::take(&mut heard.before) {
            self.hear(at, &before);
        }
        for _ in 0..heard.times {
            self.hear(at, &heard);
        }
        let right = self.drive.take_reply();
        let delay = self.drive.slave().reply_delay_bits();
        let mut reply = Reply {
            octets: right.map(|(_, octets)| octets.to_vec()).unwrap_or_default(),
            delay: own_delay(
                right.as_ref().map(|(ready, _)| *ready),
                at,
                self.drive.rate().bit_time().units(),
            )
            .unwrap_or(delay),
            times: 1,
        };
        let image = reply.image(self.drive.slave().ppo());
        let outputs = request.image(self.drive.slave().ppo());
        if let Some(How::Sends(sends) | How::Both(_, sends)) = how {
            sends(&self.seen(&request), &mut reply);
        }
        self.memory.inputs = image.unwrap_or(self.memory.inputs);
        self.memory.outputs = outputs.unwrap_or(self.memory.outputs);
        if !reply.octets.is_empty() {
            self.memory.answered += 1;
            self.memory.reply.clone_from(&reply.octets);
            let bit = self.drive.rate().bit_time();
            self.replies.clear();
            for number in 0..reply.times {
                let ready = at + bit * (reply.delay * (number + 1));
                self.replies.push((ready, reply.octets.clone()));
            }
        }
    }

    fn hear(&mut self, at: Instant, parts: &Parts) {
        if let Some(telegram) = parts.telegram() {
            self.drive.answer(at, &telegram);
        }
    }

    fn seen<'a>(&'a self, request: &'a Parts) -> Context<'a> {
        Context {
            drive: &self.drive,
            memory: &self.memory,
            request,
        }
    }
}

/// How many bits after the request a reply begins.
fn own_delay(ready: Option<Instant>, at: Instant, bit: u64) -> Option<u64> {
    ready.and_then(|ready| ready.since(at).units().checked_div(bit))
}

impl LineStation for Deviant {
    fn hear(&mut self, at: Instant, octet: Received) {
        self.hear_at(at, at, octet);
    }

    fn wants(&self) -> Option<Wish> {
        self.replies.first().map(|(ready, _)| Wish {
            ready: *ready,
            idle_bits: 0,
        })
    }

    fn begin(&mut self, _at: Instant, into: &mut Vec<Octet>) {
        if !self.replies.is_empty() {
            let (_, octets) = self.replies.remove(0);
            into.extend(octets.into_iter().map(Octet::from));
        }
    }

    fn sent(&mut self, at: Instant) {
        self.collector.skip(at);
        self.drive.sent(at);
    }

    fn next_action(&self) -> Option<Instant> {
        self.drive.next_action()
    }

    fn advance(&mut self, to: Instant) {
        LineStation::advance(&mut self.drive, to);
    }
}
