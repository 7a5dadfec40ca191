//! The live page of served rings: the space-time picture of ND21 9.7 as it grows.

use super::recorder::{links, picture};
use super::server::Server;
use crate::link::BesideTheBus;
use harness_bench::counted::counted;
use harness_bench::link::Line;
use harness_bench::serve::{ControlAnswer, ServedBus};
use harness_bench::web::{FaultPlace, LiveCell, LiveNews, LiveOrder, LiveScene, LiveView};
use harness_proto::nd21::cells::cell;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange, Value};
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::sync::SYNCO;
use harness_sim::nd21::Mode;

/// The faults: as the language of scenarios writes them, and in words.
const FAULTS: [(&str, &str); 6] = [
    ("flip 0", "flip bit 0 of the next byte"),
    ("flip p", "flip its parity bit"),
    ("flip s", "flip its stop bit"),
    ("drop", "lose it"),
    ("insert 00", "insert a 00 in front of it"),
    ("break 5ms", "hold the line at 0 for 5 ms"),
];

/// SYNCO bytes after a fault, where no master is connected: the ring spells the drive out within 25 zeros (ND21 9.7).
const BEHIND_A_FAULT: usize = 40;
/// How many bytes of the bench's own may wait for the line.
const ROOM: usize = 256;

/// A conversation that the page plays from the master's place of the first ring.
struct Script {
    name: String,
    octets: Vec<u8>,
}

/// The conversations for a ring of this size: short ones, whose bytes all stand in the manual.
fn scripts(drives: u8) -> Vec<Script> {
    let read_word = |drive: u8, address: u16| {
        let [high, low] = address.to_be_bytes();
        let mut command = vec![0xC1, low, high, 0x3F];
        command.push(Checksum::over(&command).plus());
        // A telegram of five net bytes with an address (9.2): the master sends the drive's number less that of all drives (9.3).
        [&[0x8A, drive.wrapping_sub(drives)][..], &command].concat()
    };
    let script = |name: String, octets: Vec<u8>| Script { name, octets };
    let last = drives.saturating_sub(1);
    vec![
        script(
            format!("send {BEHIND_A_FAULT} SYNCO bytes (9.2)"),
            vec![SYNCO; BEHIND_A_FAULT],
        ),
        script(
            "read nist of drive 0 (10.1)".to_owned(),
            read_word(0, ram::NIST),
        ),
        script(
            format!("read nist of drive {last} (10.1)"),
            read_word(last, ram::NIST),
        ),
        script(
            "send the check sequence (9.8)".to_owned(),
            CHECK_SEQUENCE.to_vec(),
        ),
    ]
}

impl Server {
    fn sizes(&self) -> Vec<u8> {
        (0..self.rings()).map(|ring| self.drives(ring)).collect()
    }

    /// The columns of links that are cut open.
    fn open_columns(&self) -> Vec<usize> {
        let sizes = self.sizes().into_iter().enumerate();
        let all = sizes
            .flat_map(|(ring, drives)| (0..=usize::from(drives)).map(move |link| (ring, link)));
        let open = all
            .enumerate()
            .filter(|(_, (ring, link))| self.is_open(*ring, *link));
        open.map(|(column, _)| column).collect()
    }

    /// A row of the table of drives.
    fn station(&self, ring: usize, drive: u8) -> Vec<String> {
        let prefix = if ring == 0 { "" } else { "2:" };
        let bus = match self.link.error_of(ring, drive).flatten() {
            Some(error) => format!("error {error}"),
            None => "normal".to_owned(),
        };
        let mut row = vec![format!("{prefix}{drive}"), bus];
        let shown = self.link.shown(ring, drive);
        row.extend(match shown {
            Some(shown) => {
                let mode = Mode::NAMES.iter().find(|(_, mode)| *mode == shown.mode);
                let digits = |digits: [u8; 3]| digits.iter().map(|d| format!("{d:X}")).collect();
                let display: String = shown.display.map_or("blank".to_owned(), digits);
                [mode.map_or("", |(name, _)| name).to_owned(), display]
            }
            None => ["-".to_owned(), "-".to_owned()],
        });
        let byte = |address| self.link.peek(ring, drive, address).unwrap_or(0);
        let word = |address| [byte(address), byte(address + 1)];
        let units = DriveUnits {
            range: SpeedRange::from_sw_version2(byte(ram::SW_VERSION2)),
            ..self.plan.units(ring, drive)
        };
        let speed = cell("nist").and_then(|cell| cell.value(&word(ram::NIST), units)?.ok());
        row.push(match speed {
            Some(Value::Exact(number)) => format!("{:.0}", number.to_f64()),
            Some(Value::Approximate(number)) => format!("{number:.0}"),
            _ => "-".to_owned(),
        });
        row.push(format!("{:02X}", byte(ram::BUS_ADDR)));
        row
    }

    /// Sends octets of the bench's own from the master's place of a ring.
    ///
    /// # Errors
    /// A client has this place, or the line has no room.
    fn play(&mut self, ring: usize, octets: &[u8]) -> Result<(), String> {
        if self.has_master(ring) {
            return Err(format!(
                "a master is connected to ring {}, and its traffic is shown; disconnect it to let the page send",
                ring + 1
            ));
        }
        if self.room(ring) < ROOM {
            return Err(
                "bytes of the page still wait for the line; try again in a moment".to_owned(),
            );
        }
        self.send_unattended(ring, octets);
        Ok(())
    }
}

impl LiveView for Server {
    fn scene(&self) -> LiveScene {
        let sizes = self.sizes();
        let drives = sizes.iter().map(|drives| counted(*drives, "drive"));
        let columns = links(&sizes);
        let mut shown = columns.clone();
        for column in self.open_columns() {
            shown[column].push_str(" (cut)");
        }
        let place = |(column, name): (usize, &String)| FaultPlace {
            name: name.clone(),
            column: Some(column),
        };
        LiveScene {
            title: format!(
                "NOVOBUS, {}, {} bit/s",
                drives.collect::<Vec<_>>().join(" and "),
                self.plan.rate.bits_per_second()
            ),
            stations: vec!["drive", "bus", "mode", "display", "speed rpm", "BusAddr"],
            traffic: vec!["link", "bytes", "not SYNCO", "damaged"],
            places: columns.iter().enumerate().map(place).collect(),
            picture: Some(picture(shown)),
            faults: FAULTS.map(|(_, words)| words).to_vec(),
            scripts: scripts(sizes.first().copied().unwrap_or(1))
                .into_iter()
                .map(|script| script.name)
                .collect(),
            read_only: None,
        }
    }

    fn watch(&mut self, on: bool) {
        self.record_all(on);
    }

    fn news(&mut self) -> LiveNews {
        let now = self.link.now();
        let sizes = self.sizes();
        let mut news = LiveNews {
            at: now.to_string(),
            master: (0..sizes.len()).any(|ring| self.has_master(ring)),
            ..LiveNews::default()
        };
        for (ring, drives) in sizes.iter().enumerate() {
            news.stations
                .extend((0..*drives).map(|drive| self.station(ring, drive)));
        }
        let open = self.open_columns();
        let Some(recorder) = &mut self.recorder else {
            return news;
        };
        let rows = recorder.rows(now);
        (news.rows, news.left_out, news.notes) = (rows.rows, rows.left_out, rows.notes);
        for row in news.rows.iter_mut().filter(|row| row.fold == 0) {
            let cut = |column: &usize| LiveCell(*column, "//".to_owned(), 'c');
            row.cells.extend(open.iter().map(cut));
        }
        let counts = recorder.counts().iter().zip(links(&sizes));
        news.traffic = counts
            .map(|(count, link)| {
                let numbers = [count.bytes, count.busy, count.damaged];
                let numbers = numbers.map(|number| number.to_string());
                std::iter::once(link).chain(numbers).collect()
            })
            .collect();
        news
    }

    fn order(&mut self, order: LiveOrder) -> Result<String, String> {
        let sizes = self.sizes();
        match order {
            LiveOrder::Fault { place, fault } => {
                let links = links(&sizes);
                let link = links.get(place).ok_or("there is no such link")?;
                let (fault, _) = FAULTS.get(fault).ok_or("there is no such fault")?;
                let line = format!("! {link}: {fault}");
                match self.control(&line) {
                    Some(ControlAnswer::Ok) => {}
                    answer => {
                        let said = answer.map(|answer| answer.to_string());
                        return Err(format!("{line}: {}", said.unwrap_or_default()));
                    }
                }
                let ring = usize::from(link.starts_with("2:"));
                if self.has_master(ring) {
                    return Ok(format!("{line}. It meets the next byte on this link."));
                }
                self.play(ring, &[SYNCO; BEHIND_A_FAULT])?;
                Ok(format!(
                    "{line}. No master is connected, so {BEHIND_A_FAULT} SYNCO bytes follow."
                ))
            }
            LiveOrder::Play { script } => {
                let drives = sizes.first().copied().unwrap_or(1);
                let scripts = scripts(drives);
                let script = scripts.get(script).ok_or("there is no such conversation")?;
                self.play(0, &script.octets)?;
                Ok(format!(
                    "{}: {} sent.",
                    script.name,
                    counted(script.octets.len() as u64, "byte")
                ))
            }
        }
    }
}
