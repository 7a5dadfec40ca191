//! What the engine of fuzz runs knows of this bus.

use super::act::{Count, Harm, TelegramAct, TelegramActKind, TelegramTalk};
use super::generate::{self, TelegramSpice};
use super::idiom::idiom;
use super::oracle::{self, TelegramDifference};
use super::play::{PlayedAct, TelegramsSeen, play};
use super::text::steps;
use crate::judge::Symptom;
use crate::language::Nordac;
use crate::manual::MANUAL;
use crate::report::TelegramReport;
use crate::rig::rate;
use crate::serve;
use crate::simulate::Setup;
use harness_bench::bus_name::BusName;
use harness_bench::capture::runs::HeardTelegram;
use harness_bench::explore::line::{ActBounds, LineBus};
use harness_bench::explore::pool::hash;
use harness_bench::explore::{Dice, Differing};
use harness_bench::manual::Manual;
use harness_bench::rig::Rig;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::shown::SegmentReport;
use harness_proto::nordac::{PpoType, Properties};
use harness_proto::profibus::Telegram;
use harness_proto::time::Instant;
use harness_sim::nordac::deviation::DEVIATIONS;

/// A slave as conversations address it: its address, and the PPO type that it is set to.
type Station = (u8, PpoType);

impl Differing for TelegramDifference {
    fn is_like(&self, other: &Self) -> bool {
        (self.what, &self.part) == (other.what, &other.part)
    }
    fn key(&self) -> String {
        self.signature()
    }
    fn signature(&self) -> String {
        let slave = self
            .slave
            .map_or(String::new(), |slave| format!("slave {slave}: "));
        format!(
            "{slave}{}, {} (NORDAC {})",
            self.part,
            self.what.words(),
            self.section
        )
    }
    fn about(&self) -> &str {
        &self.about
    }
    fn place(&self) -> Option<usize> {
        Some(self.telegram)
    }
    fn is_time(&self) -> bool {
        // Virtual time is the same in every attempt.
        false
    }
}

impl LineBus for Nordac {
    const BUS: BusName = BusName::Nordac;
    const MANUAL: Manual = MANUAL;
    const REPORT: &'static dyn SegmentReport = &TelegramReport;
    const USUAL_SECTION: &'static str = "3.1";
    const DRIVES: &'static str = "NORDAC inverters";
    const DRIVE: &'static str = "slave";
    const BOUNDS: ActBounds = ActBounds {
        times: u8::MAX,
        wait_us: 5_000_000,
        total_us: 60_000_000,
    };
    const NEEDED: &'static [TelegramSpice] = &[
        TelegramSpice::Motion,
        TelegramSpice::Tasks,
        TelegramSpice::Services,
    ];

    type Words = Self;
    type What = TelegramActKind;
    type Spice = TelegramSpice;
    type Station = Station;
    type Setup = Setup;
    type Properties = Properties;
    type Said = HeardTelegram;
    type Done = PlayedAct;
    type Difference = TelegramDifference;

    fn fits(what: &TelegramActKind) -> bool {
        what.fits()
    }

    fn sends(what: &TelegramActKind) -> bool {
        use TelegramActKind::{Ask, Octets};
        matches!(what, Ask(_) | Octets { .. })
    }

    fn weight(what: &TelegramActKind) -> u64 {
        what.weight()
    }

    fn simpler(what: &TelegramActKind) -> Vec<TelegramActKind> {
        let mut all = Vec::new();
        match what {
            TelegramActKind::Ask(request) => {
                let mut plain = request.clone();
                plain.harm = None;
                plain.count = Count::Next;
                all.push(TelegramActKind::Ask(plain));
                for at in 0..request.data.len() {
                    let mut lower = request.clone();
                    lower.data[at] = 0;
                    all.push(TelegramActKind::Ask(lower));
                }
            }
            TelegramActKind::Octets { octets, harm } => {
                let shorter = |harm: Option<Harm>, octets: &[u8]| TelegramActKind::Octets {
                    octets: octets.to_vec(),
                    harm,
                };
                all.push(shorter(None, octets));
                if octets.len() > 1 {
                    all.push(shorter(*harm, &octets[..octets.len() / 2]));
                    all.push(shorter(*harm, &octets[..octets.len() - 1]));
                }
            }
            TelegramActKind::Link { .. }
            | TelegramActKind::Fault { .. }
            | TelegramActKind::Restart { .. } => {}
        }
        all
    }

    fn begin(station: Station, dice: &mut Dice) -> (Vec<TelegramAct>, usize) {
        generate::begin(station, dice)
    }

    fn idiom(spice: TelegramSpice, station: Station, dice: &mut Dice) -> Vec<TelegramAct> {
        idiom(spice, station.into(), dice)
    }

    fn part(spice: TelegramSpice, station: Station, dice: &mut Dice) -> Vec<TelegramAct> {
        generate::part(spice, station.into(), dice)
    }

    fn close(
        _: &[TelegramAct],
        (station, _): (Station, &[Station]),
        dice: &mut Dice,
    ) -> Vec<TelegramAct> {
        generate::close(station.into(), dice)
    }

    fn wait(dice: &mut Dice) -> u64 {
        generate::wait(dice)
    }

    fn change(what: &mut TelegramActKind, dice: &mut Dice) {
        generate::change(what, dice);
    }

    fn header(rig: &Rig, stations: &[Station]) -> Vec<String> {
        let rate = rig.port().map(|port| format!("rate {}", rate(port).name()));
        let slaves = stations.iter().flat_map(|(address, ppo)| {
            let there = format!("slave {address} ppo {}", ppo.number());
            [there, format!("slave {address} parameter 1621 = 2")]
        });
        rate.into_iter().chain(slaves).collect()
    }

    fn simulated(header: &Source) -> Result<Setup, Problems> {
        Ok(serve::bench(Some(&[]), Some(header))?.setup)
    }

    fn plant(setup: &mut Setup, slave: u8, name: &str) -> Option<bool> {
        let known = DEVIATIONS.named(name)?;
        let mut slaves = setup.slaves.iter_mut();
        let wrong = slaves.find(|wrong| wrong.address == slave);
        Some(wrong.map(|wrong| wrong.deviation = Some(known)).is_some())
    }

    fn model(setup: &Setup, properties: &[Properties]) -> Setup {
        let mut model = setup.clone();
        model.master = None;
        for (slave, values) in model.slaves.iter_mut().zip(properties) {
            slave.deviation = None;
            slave.properties = *values;
        }
        model
    }

    fn play(setup: &Setup, talk: &TelegramTalk) -> TelegramsSeen {
        play(setup, talk)
    }

    fn features(_: &TelegramTalk, seen: &TelegramsSeen) -> Vec<u32> {
        features(seen)
    }

    fn begins(setup: &Setup) -> Vec<Vec<Properties>> {
        vec![vec![Properties::default(); setup.slaves.len()]]
    }

    fn neighbours(setup: &Setup, place: usize, properties: &Properties) -> Vec<Properties> {
        oracle::neighbours(properties, setup.slaves[place].posicon).collect()
    }

    fn lines(setup: &Setup, values: &[Properties]) -> Vec<String> {
        oracle::lines(setup, values)
    }

    fn same(expected: &HeardTelegram, seen: &HeardTelegram) -> bool {
        expected == seen
    }

    fn unlike(expected: &HeardTelegram, seen: &HeardTelegram) -> i64 {
        oracle::unlike(expected, seen)
    }

    fn difference(
        setup: &Setup,
        place: usize,
        plays: (&TelegramsSeen, &TelegramsSeen),
        under: Vec<String>,
    ) -> Option<TelegramDifference> {
        oracle::difference(setup, place, plays, under)
    }

    fn basis(found: &TelegramDifference) -> (&str, &[String], bool) {
        (&found.section, &found.under, found.what == Symptom::Time)
    }

    fn steps(
        setup: &Setup,
        talk: &TelegramTalk,
        seen: &TelegramsSeen,
        timed: Option<usize>,
        text: &mut String,
    ) {
        steps(talk, seen, timed, setup.rate.octet_time(), text);
    }
}

/// What a case shows: which reply followed which act and which reply before it, and what the replies say.
fn features(seen: &TelegramsSeen) -> Vec<u32> {
    let mut found = Vec::new();
    let mut before = 0;
    let mut replies = seen.said.iter().peekable();
    let ends = seen.done.iter().skip(1).map(|done| done.at);
    let ends = ends.chain([Instant::NEVER]);
    for (done, end) in seen.done.iter().zip(ends) {
        let request = done.sent.as_ref().map_or(1, |sent| kind(&sent.octets));
        let mut reply = 0;
        while let Some(next) = replies.next_if(|next| next.at <= end) {
            reply = hash(&[reply, kind(&next.octets), u32::from(next.error.is_some())]);
        }
        found.push(hash(&[1, request, reply]));
        found.push(hash(&[2, before, reply]));
        before = reply;
    }
    found
}

/// A number for what a telegram is: of an exchange its control or status word and its parameter channel's task and number, of other
/// services their data.
fn kind(octets: &[u8]) -> u32 {
    let Some(Telegram::Pdu(pdu)) = Telegram::decode(octets).value() else {
        return hash(&[3, octets.first().copied().unwrap_or(0).into()]);
    };
    let data = pdu.data();
    let sap = pdu.dsap().map_or(0, |sap| 1 + u32::from(sap));
    let head = hash(&[sap, u32::from(pdu.fc().0 & 0x4F), data.len() as u32]);
    let word = |at: usize| {
        data.get(at..at + 2)
            .map_or(0, |word| u32::from(word[0]) << 8 | u32::from(word[1]))
    };
    match (pdu.dsap(), data.len()) {
        (None, 20 | 12) => hash(&[head, word(0), word(8)]),
        (None, _) => hash(&[head, word(0)]),
        (Some(_), _) => {
            let all: Vec<_> = data.iter().take(8).map(|octet| u32::from(*octet)).collect();
            hash(&[&[head][..], &all].concat())
        }
    }
}
