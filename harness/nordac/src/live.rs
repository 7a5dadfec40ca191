//! The live page of inverters on PROFIBUS: telegrams as arrows between stations, time down.

use super::report::Reader;
use super::serve::SegmentServer;
use crate::value::hex;
use harness_bench::capture::runs::{TelegramRun, runs};
use harness_bench::counted::counted;
use harness_bench::serve::{ControlAnswer, ServedBus};
use harness_bench::web::{
    ARROWS, FaultPlace, LiveNews, LiveOrder, LivePicture, LiveRow, LiveScene, LiveView, MAX_ROWS,
};
use harness_proto::nordac::Parameter;
use harness_proto::nordac::pkw::Index;
use harness_proto::profibus::Telegram;
use harness_proto::profibus::rate::SYN_BITS;
use harness_sim::record::{Channel, Trace};
use std::collections::BTreeMap;

/// The faults of a telegram: as the language of scenarios writes them, and in words.
const FAULTS: [(&str, &str); 4] = [
    ("lost", "lost"),
    ("doubled", "doubled"),
    ("delay 3ms", "3 ms late"),
    (
        "former",
        "its station sends its former telegram in its place",
    ),
];

/// Which telegram a fault meets, from the next one on.
const PLACES: [&str; 2] = ["the next telegram", "the telegram after it, the reply"];

/// Octets of the page that may wait for the line.
const ROOM: usize = 128;

/// The station number of the page's own master, as in the printed examples.
const MASTER: u8 = 2;

/// What the page sends to the first slave: in words, and telegrams from the destination's service access point on. A set point of 50 % is
/// 2000 (NORDAC 3.1, 3.3).
const SCRIPTS: [(&str, &[&[u8]]); 5] = [
    (
        "Set_Prm and Chk_Cfg: start the data exchange with PPO type 1",
        &[
            &[
                0x80, 0x80, 0x6C, 0x3D, 0x3E, 0x80, 0, 0, 0x0B, 0x75, 0x31, 0,
            ],
            &[0x80, 0x80, 0x5C, 0x3E, 0x3E, 0xF3, 0xF1],
        ],
    ),
    ("Slave_Diag", &[&[0x80, 0x80, 0x6D, 0x3C, 0x3E]]),
    (
        "047E: OFF1, ready for switch-on",
        &[&[0, 0, 0x6D, 0, 0, 0, 0, 0, 0, 0, 0, 0x04, 0x7E, 0, 0]],
    ),
    (
        "047F with 2000: enable, 50 %",
        &[&[0, 0, 0x6D, 0, 0, 0, 0, 0, 0, 0, 0, 0x04, 0x7F, 0x20, 0]],
    ),
    (
        "parameter 1202 by the parameter channel",
        &[&[0, 0, 0x6D, 0x14, 0xB2, 0, 0, 0, 0, 0, 0, 0x04, 0x7E, 0, 0]],
    ),
];

/// A telegram with a variable length. The first two octets are added to the addresses: 80 where service access points follow.
fn telegram(slave: u8, octets: &[u8]) -> Vec<u8> {
    let [to, from, rest @ ..] = octets else {
        return Vec::new();
    };
    let body = [&[slave | to, MASTER | from][..], rest].concat();
    let length = u8::try_from(body.len()).unwrap_or(0);
    let sum = body
        .iter()
        .fold(0_u8, |sum, octet| sum.wrapping_add(*octet));
    [&[0x68, length, length, 0x68][..], &body, &[sum, 0x16]].concat()
}

/// The picture of telegrams with these columns.
fn picture(columns: Vec<String>) -> LivePicture {
    LivePicture {
        heading: "Telegrams",
        note: "A column is a station, a row is a telegram, and time goes down. A token that a master gives to itself has no row; such tokens \
               are counted in a row below those of the other telegrams.",
        columns,
        folded: ["time", "times"],
        legend: ARROWS.to_vec(),
    }
}

/// The picture of a bench with these slaves.
pub(super) fn picture_of_port(slaves: &[u8]) -> LivePicture {
    let names = slaves.iter().map(|slave| format!("slave {slave}"));
    picture(std::iter::once("bench".to_owned()).chain(names).collect())
}

/// A telegram that a bench with these slaves has sent or received.
pub(super) fn at_port(run: &TelegramRun, slaves: &[u8], reader: &mut Reader) -> LiveRow {
    let place = run.from.map_or(0, |slave| {
        let found = slaves.iter().position(|address| *address == slave);
        found.map_or(0, |place| place + 1)
    });
    let last = run.octets.last();
    let at = last.map_or(String::new(), |octet| octet.at.to_string());
    let whole = run.octets.iter().all(|octet| octet.error.is_none());
    arrow(run, slaves, slaves.len() + 1, place, whole, at, reader)
}

/// A telegram from the column of its station to that of its receiver, or to all; slaves have the columns after the first.
fn arrow(
    run: &TelegramRun,
    slaves: &[u8],
    columns: usize,
    place: usize,
    whole: bool,
    at: String,
    reader: &mut Reader,
) -> LiveRow {
    let Some(said) = run.said() else {
        let sent: Vec<_> = run.octets.iter().filter_map(|octet| octet.sent).collect();
        let words = format!("lost  [{}]", hex(&sent));
        return LiveRow::arrow(columns, (place, None), false, at, words);
    };
    let words = reader.read(&said);
    let mut all = slaves.iter();
    let to = match (run.from, words.to) {
        // The confirmation names no station.
        (Some(_), _) => Some(0),
        (None, Some(to)) => all.position(|slave| *slave == to).map(|place| place + 1),
        (None, None) => None,
    };
    let text = format!(
        "{}  {}  [{}]",
        words.service,
        words.meaning,
        hex(&said.octets)
    );
    LiveRow::arrow(columns, (place, to), whole, at, text)
}

/// What the page has seen of the line.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorder {
    reader: Reader,
    /// Octets of which no telegram is known to be complete, by the place of their station.
    begun: Trace,
    /// Telegrams of the line and runs of octets, as they were when the line was last quiet.
    counted: (u64, u64),
    /// Runs of octets so far.
    runs: u64,
}

impl SegmentServer {
    /// The slaves, by the address that they were set up with.
    fn slaves(&self) -> Vec<u8> {
        self.plan
            .setup
            .slaves
            .iter()
            .map(|slave| slave.address)
            .collect()
    }

    /// How many columns there are: a master, the slaves, and the other masters.
    fn columns(&self) -> usize {
        self.plan.setup.slaves.len() + self.seats()
    }

    /// The telegrams that are complete since the last call.
    fn runs(&mut self, recorder: &mut Recorder) -> Vec<TelegramRun> {
        let columns = self.columns();
        let channels = &mut recorder.begun.channels;
        // The place of a station stands in for its address: two masters are two senders.
        channels.resize_with(columns, || Channel::of_octets(None, None, Vec::new()));
        for (place, channel) in channels.iter_mut().enumerate() {
            channel.from = u8::try_from(place).ok();
            let octets = self.bench.line().take_record(place);
            if let Some(record) = channel.octets_mut() {
                record.extend(octets);
            }
        }
        let mut runs = runs(&recorder.begun);
        let idle = self.rate().bit_time() * SYN_BITS;
        let now = self.bench.time();
        let last = runs.last().and_then(|run| run.octets.last());
        let begun = last.is_some_and(|octet| now < octet.at + idle);
        let begun = begun.then(|| runs.pop()).flatten();
        recorder.runs += runs.len() as u64;
        for channel in &mut recorder.begun.channels {
            let from = channel.from;
            if let Some(record) = channel.octets_mut() {
                record.clear();
                record.extend(
                    begun
                        .iter()
                        .filter(|run| run.from == from)
                        .flat_map(|run| &run.octets),
                );
            }
        }
        runs
    }

    /// Telegrams that were lost since the line was last quiet: they have left no octet. `None` while a telegram is under way.
    fn lost(&mut self, recorder: &mut Recorder) -> Option<u64> {
        let line = self.bench.line();
        let begun = recorder
            .begun
            .channels
            .iter()
            .any(|channel| !channel.octets().is_empty());
        if line.is_busy() || begun {
            return None;
        }
        let now = (line.telegrams(), recorder.runs);
        let before = std::mem::replace(&mut recorder.counted, now);
        let (sent, arrived) = (now.0 - before.0, now.1 - before.1);
        Some(sent.saturating_sub(arrived)).filter(|lost| *lost > 0)
    }

    fn row(&self, recorder: &mut Recorder, run: &TelegramRun) -> LiveRow {
        let slaves = self.slaves();
        let place = usize::from(run.from.unwrap_or(0));
        let slave = place
            .checked_sub(1)
            .and_then(|place| slaves.get(place))
            .copied();
        let at = run
            .octets
            .last()
            .map_or(String::new(), |octet| octet.at.to_string());
        let whole = run
            .octets
            .iter()
            .all(|octet| octet.sent == octet.received && octet.error.is_none());
        let run = TelegramRun {
            from: slave,
            octets: run.octets.clone(),
        };
        let (columns, reader) = (self.columns(), &mut recorder.reader);
        arrow(&run, &slaves, columns, place, whole, at, reader)
    }

    fn station(&self, address: u8) -> Vec<String> {
        let Some(drive) = self.bench.drive(address) else {
            return Vec::new();
        };
        let (slave, inverter) = (drive.slave(), drive.inverter());
        let frequency = Parameter::of(1813)
            .and_then(|parameter| inverter.parameter(parameter, Index::default()));
        let [whole, tenths] = {
            let tenths = frequency.unwrap_or_default();
            [tenths / 10, tenths % 10]
        };
        let words = inverter.words();
        vec![
            slave.address().to_string(),
            if drive.is_powered() { "on" } else { "off" }.to_owned(),
            slave.state().name().to_owned(),
            inverter.state().name().to_owned(),
            format!("{:04X}", words.stw),
            format!("{whole}.{tenths} Hz"),
        ]
    }
}

/// The master that gives a token to itself: the only one on its line.
fn own_token(run: &TelegramRun) -> Option<u8> {
    match run.said()?.telegram()? {
        Telegram::Token { da, sa } if da == sa => Some(sa),
        _ => None,
    }
}

/// The rows of telegrams, with a row after them that counts the tokens which a master gave to itself.
pub(super) fn without_tokens<'r>(
    rows: impl Iterator<Item = (LiveRow, &'r TelegramRun)>,
) -> Vec<LiveRow> {
    let mut shown = Vec::new();
    let mut tokens = BTreeMap::<u8, LiveRow>::new();
    for (row, run) in rows {
        let Some(master) = own_token(run).filter(|_| !row.is_damaged()) else {
            shown.push(row);
            continue;
        };
        let fold = tokens.get(&master).map_or(0, |token| token.fold) + 1;
        let words = format!("token {master}\u{2192}{master}");
        tokens.insert(master, LiveRow { fold, words, ..row });
    }
    shown.extend(tokens.into_values());
    shown
}

impl LiveView for SegmentServer {
    fn scene(&self) -> LiveScene {
        let slaves = self.slaves();
        let masters = 2..=self.seats();
        let columns = std::iter::once("master 1".to_owned())
            .chain(slaves.iter().map(|slave| format!("slave {slave}")))
            .chain(masters.map(|master| format!("master {master}")));
        let place = |name: &str| FaultPlace {
            name: name.to_owned(),
            column: None,
        };
        let first = slaves.first().copied().unwrap_or_default();
        let script = |(words, _): &(&str, _)| format!("slave {first}: {words}");
        LiveScene {
            title: format!(
                "PROFIBUS DP, {}, {} kbit/s",
                counted(slaves.len() as u64, "slave"),
                self.rate().name()
            ),
            stations: vec![
                "slave",
                "supply",
                "DP",
                "inverter",
                "control word",
                "frequency",
            ],
            traffic: vec!["line", "telegrams", "octets"],
            picture: Some(picture(columns.collect())),
            places: PLACES.map(place).to_vec(),
            faults: FAULTS.map(|(_, words)| words).to_vec(),
            scripts: SCRIPTS.iter().map(script).collect(),
            read_only: None,
        }
    }

    fn watch(&mut self, on: bool) {
        let telegrams = self.bench.line().telegrams();
        self.recorder = on.then(|| Recorder {
            counted: (telegrams, 0),
            ..Recorder::default()
        });
        match on {
            true => self.bench.line().record_anew(),
            false => self.bench.line().keep_no_record(),
        }
    }

    fn news(&mut self) -> LiveNews {
        let mut news = LiveNews {
            at: self.bench.time().to_string(),
            master: self.has_master(),
            stations: self
                .slaves()
                .into_iter()
                .map(|address| self.station(address))
                .collect(),
            ..LiveNews::default()
        };
        let line = self.bench.line();
        let counts = [line.telegrams(), line.octets()].map(|count| count.to_string());
        news.traffic = vec![
            std::iter::once("PROFIBUS".to_owned())
                .chain(counts)
                .collect(),
        ];
        if let Some(mut recorder) = self.recorder.take() {
            let runs = self.runs(&mut recorder);
            // The meaning of a telegram depends on those before it, also on those that are not shown.
            let rows = runs.iter().map(|run| (self.row(&mut recorder, run), run));
            news.rows = without_tokens(rows);
            let hidden = news.rows.len().saturating_sub(MAX_ROWS);
            news.rows.drain(..hidden);
            news.left_out = hidden as u64;
            let lost = self.lost(&mut recorder);
            let note = |lost| {
                let lost = counted(lost, "telegram");
                format!("{lost} lost: no octet was on the line.")
            };
            news.notes.extend(lost.map(note));
            self.recorder = Some(recorder);
        }
        news
    }

    fn order(&mut self, order: LiveOrder) -> Result<String, String> {
        match order {
            LiveOrder::Fault { place, fault } => {
                PLACES.get(place).ok_or("there is no such telegram")?;
                let (fault, _) = FAULTS.get(fault).ok_or("there is no such fault")?;
                let so_far = self.bench.line().telegrams();
                let line = format!("! telegram {}: {fault}", so_far + 1 + place as u64);
                match ServedBus::control(self, &line) {
                    Some(ControlAnswer::Ok) => Ok(format!(
                        "{line}. {} so far on the line.",
                        counted(so_far, "telegram")
                    )),
                    answer => {
                        let said = answer.map(|answer| answer.to_string());
                        Err(format!("{line}: {}", said.unwrap_or_default()))
                    }
                }
            }
            LiveOrder::Play { script } => {
                let (words, telegrams) = SCRIPTS.get(script).ok_or("there is no such telegram")?;
                let slave = self.slaves().first().copied().ok_or("there is no slave")?;
                if self.has_master() {
                    return Err(
                        "a master is connected, and its traffic is shown; disconnect it to let the page send".to_owned(),
                    );
                }
                if self.room(0) < ROOM {
                    return Err(
                        "telegrams of the page still wait for the line; try again in a moment"
                            .to_owned(),
                    );
                }
                for octets in *telegrams {
                    // Telegrams of the page have no marks.
                    let _none = self.receive(0, &telegram(slave, octets));
                }
                Ok(format!(
                    "slave {slave}: {words}: {} sent.",
                    counted(telegrams.len() as u64, "telegram")
                ))
            }
        }
    }
}
