//! `drivebench top` on rings.

use super::axes;
use super::rig::{self, OpenBench};
use super::top_page::HeardLinks;
use crate::driver::{Axis, Width};
use crate::top::{DriveReading, FORM, RingReading};
use harness_bench::command::drive::TopArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::Use;
use harness_bench::command::top::{RateWindow, TopReader, TopScene, check, live, once};
use harness_bench::counted::counted;
use harness_bench::rig::file::Ring;
use harness_bench::top::{HeadLine, Heading, Snapshot, Top, view};
use harness_bench::web::LiveNews;
use harness_proto::nd21::State;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange};
use harness_proto::novobus::master::{Counters, Event};
use harness_proto::time::{Instant, Span};

/// Drives that are asked side by side: what is shown comes piece by piece, and the end does not wait for a long ring.
const SIDE_BY_SIDE: usize = 8;
/// The page of `--once`, in characters.
const WIDTH: u16 = 120;

/// Heads of the table of traffic.
const TRAFFIC: [&str; 7] = [
    "ring",
    "bytes/s",
    "telegrams/s",
    "commands/s",
    "not SYNCO %",
    "bytes",
    "commands",
];

/// What is read of a drive, in the order of the words in [`reading`].
///
/// Whole turns stand on both sides of the angle: between two commands the counter may have gone on.
const CELLS: [(u16, Width); 9] = [
    (ram::STATUS, Width::Byte),
    (ram::FLAGS, Width::Word),
    (ram::ERRORCODE, Width::Word),
    (ram::NIST, Width::Word),
    (ram::UMDRIST, Width::Word),
    (ram::LAGEIST, Width::Word),
    (ram::UMDRIST, Width::Word),
    (ram::MSOLL, Width::Word),
    (ram::SW_VERSION2, Width::Byte),
];

/// Shows drives until a key ends it.
pub(crate) fn top(arguments: &TopArguments, output: &mut Output) -> Result<Exit, Failure> {
    check(arguments, output)?;
    rig::on(&arguments.rig, Use::look("top"), output, |bench, output| {
        let (heading, title) = heading(bench);
        let heard = HeardLinks::of(bench);
        let heard = heard.ok_or_else(|| Failure::refused("the rig has been given back"))?;
        let scene = TopScene {
            title,
            traffic: &TRAFFIC,
            picture: heard.picture(),
        };
        let mut reader = Reader::new(bench, heard);
        if arguments.once {
            let mut top = Top::new(heading);
            top.take(once(&mut reader)?);
            output.result(&view::page(&mut top, WIDTH))?;
            return Ok(Exit::Passed);
        }
        live(&mut reader, heading, scene, arguments, output)
    })
}

/// The heading of the page, and its title in a browser.
fn heading(bench: &OpenBench) -> (Heading, String) {
    let sizes = bench.sizes();
    let places = bench.with_rig(|session| {
        let rings = session.rig().rings();
        let place = |ring: &Ring| {
            let end = &ring.endpoint;
            let port = end.port.iter().map(|port| format!(" {port}"));
            let (port, baud) = (port.collect::<String>(), end.line.baud());
            format!("{}{port}, {baud} 8O1", end.transport.name())
        };
        (
            session.rig().id().to_owned(),
            rings.map(|(_, ring)| place(ring)).collect(),
        )
    });
    let (rig, places): (String, Vec<String>) = places.unwrap_or_else(|| {
        let names: Vec<_> = sizes.iter().map(u8::to_string).collect();
        let places = vec!["simulated".to_owned(); sizes.len()];
        (format!("sim:{}", names.join(",")), places)
    });
    let rings = sizes.iter().zip(places);
    let rings: Vec<_> = rings
        .map(|(size, place)| format!("{}, {place}", counted(*size, "drive")))
        .collect();
    let title = format!("{rig}: {}", rings.join("; "));
    let parts = (1..)
        .zip(rings)
        .map(|(number, what): (usize, _)| format!("ring {number}: {what}"));
    let heading = Heading {
        rig,
        form: &FORM,
        parts: parts.collect(),
    };
    (heading, title)
}

/// The rings of a bench.
struct Reader<'b> {
    bench: &'b OpenBench,
    axes: Vec<Axis>,
    heard: HeardLinks,
    /// What the rings have carried.
    rings: Vec<RingReading>,
    /// What the masters have done.
    counted: RateWindow<Vec<Counters>>,
    /// Line errors that the transport reported without their bytes.
    unplaced: u64,
}

impl<'b> Reader<'b> {
    fn new(bench: &'b OpenBench, heard: HeardLinks) -> Self {
        Self {
            bench,
            axes: bench.bus.axes(),
            heard,
            rings: Vec::new(),
            counted: RateWindow::new(bench.bus.now(), bench.bus.counters()),
            unplaced: 0,
        }
    }
}

impl TopReader for Reader<'_> {
    fn drives(&self) -> usize {
        self.axes.len()
    }

    fn is_simulated(&self) -> bool {
        let ports = self.bench.with_rig(|session| session.ports().is_some());
        ports != Some(true)
    }

    fn now(&self) -> Instant {
        self.bench.bus.now()
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        let bus = &self.bench.bus;
        bus.run(time);
        bus.halted().map_or(Ok(()), |halt| Err(halt.into()))
    }

    fn read(&mut self, first: usize, into: &mut Snapshot) -> Result<usize, Failure> {
        let some = self.axes.iter().skip(first).take(SIDE_BY_SIDE);
        let cells = some
            .clone()
            .flat_map(|axis| CELLS.map(|(address, width)| (*axis, address, width)));
        let words = self.bench.bus.read_many(cells)?;
        let read = some.zip(words.chunks_exact(CELLS.len()));
        let mut count = 0;
        for (place, (axis, words)) in (first..).zip(read) {
            if let Some(drive) = reading(self.bench, *axis, words) {
                into.drives.insert(place, drive.row());
            }
            count += 1;
        }
        Ok(count)
    }

    fn stop(&mut self, drive: usize) -> Result<String, Failure> {
        self.bench.bus.stop(self.axes[drive])?;
        Ok("software stop (ND21 12.6)".to_owned())
    }

    fn named(&self, drives: &[usize]) -> String {
        let drives: Vec<_> = drives.iter().map(|place| self.axes[*place]).collect();
        axes::named(&drives)
    }

    fn look(&mut self, into: &mut Snapshot) {
        let bus = &self.bench.bus;
        for (ring, event) in bus.take_events() {
            if let Event::Disturbed { fault, .. } = event {
                into.disturbed(match self.bench.sizes().len() {
                    1 => fault.to_string(),
                    _ => format!("ring {}: {fault}", ring + 1),
                });
            }
        }
        let counters = bus.counters();
        let (before, span) = self.counted.take(bus.now(), counters.clone());
        let rings = before.iter().zip(&counters);
        self.rings = rings
            .map(|(before, now)| RingReading::between(before, now, span))
            .collect();
        into.parts = self.rings.iter().map(RingReading::lines).collect();
        let unplaced = self.bench.with_rig(|session| {
            let ports = session.ports();
            ports.map_or(0, |ports| ports.take_unplaced())
        });
        self.unplaced += unplaced.unwrap_or(0);
        if self.unplaced > 0 {
            into.parts.push(vec![HeadLine {
                text: format!(
                    "  {} line errors told of without their bytes",
                    self.unplaced
                ),
                is_error: true,
            }]);
        }
    }

    fn record(&mut self, on: bool) {
        self.heard.record(self.bench, on);
    }

    fn heard(&mut self) -> LiveNews {
        let heard = self.heard.rows(self.bench);
        let row = |(ring, number): (&RingReading, usize)| {
            vec![
                format!("ring {number}"),
                ring.bytes.to_string(),
                ring.telegrams.to_string(),
                ring.jobs.to_string(),
                format!("{}.{}", ring.share / 10, ring.share % 10),
                ring.counters.sent.to_string(),
                ring.counters.done.to_string(),
            ]
        };
        LiveNews {
            traffic: self.rings.iter().zip(1..).map(row).collect(),
            rows: heard.rows,
            left_out: heard.left_out,
            notes: heard.notes,
            ..LiveNews::default()
        }
    }
}

fn reading(bench: &OpenBench, axis: Axis, words: &[u16]) -> Option<DriveReading> {
    let &[
        status,
        flags,
        error,
        speed,
        before,
        angle,
        behind,
        torque,
        range,
    ] = words
    else {
        return None;
    };
    let low = |word: u16| word.to_be_bytes()[1];
    let [flags, flags2] = flags.to_be_bytes();
    let units = bench.units_with(axis, SpeedRange::from_sw_version2(low(range)));
    let [before, behind] = [before, behind].map(u16::cast_signed);
    let upwards = behind.wrapping_sub(before) > 0;
    let turns = match upwards == (angle < 0x8000) {
        true => behind,
        false => before,
    };
    Some(DriveReading {
        axis,
        state: State {
            status: low(status),
            flags,
            flags2,
            error,
        },
        speed: value("nist", speed, units),
        position: Some(f64::from(turns) + f64::from(angle) / 65_536.0),
        torque: value("msoll", torque, units),
    })
}

/// The value of a word cell in the manual's unit (14.5).
fn value(cell: &str, word: u16, units: DriveUnits) -> Option<f64> {
    use harness_proto::nd21::units::Value;
    let cell = harness_proto::nd21::cells::cell(cell)?;
    match cell.value(&word.to_be_bytes(), units)?.ok()? {
        Value::Exact(number) => Some(number.to_f64()),
        Value::Approximate(number) => Some(number),
        Value::Off | Value::Date(_) => None,
    }
}
