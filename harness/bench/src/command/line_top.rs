//! `top` on drives that share a line: their table, and what each station sends.

use super::drives::CommandDrives;
use super::exit::Exit;
use super::failure::Failure;
use super::held::{HeldDrives, HeldRecord};
use super::output::Output;
use super::port_bench::{PortBench, on};
use super::rig_name::Use;
use super::top::{RateWindow, TopReader, TopScene, check, live, once};
use crate::capture::{Piece, Tape};
use crate::command::drive::TopArguments;
use crate::command::output::columns;
use crate::counted::counted;
use crate::link::{Line, Link};
use crate::rig::session::RigSession;
use crate::top::{HeadLine, Heading, Snapshot, TopForm, TopRow};
use crate::web::{LiveNews, LivePicture, LiveRow};
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};

/// What `top` shows of a bus, and how it reads it.
pub struct LineTop<D: HeldDrives> {
    /// What the bench has, for the title of a page: `drives on ...`.
    pub what: &'static str,
    /// The table. Its first state is that of a drive that does not answer.
    pub form: &'static TopForm,
    /// The heads of the table of traffic: the station, what is counted, its rate, and how much of it was damaged.
    pub traffic: &'static [&'static str; 4],
    /// The picture without a row; its columns are the stations.
    pub picture: LivePicture,
    /// Reads a drive.
    pub read: DriveReader<D>,
    /// Stops a drive without waiting until it stands; returns what was done.
    pub stop: DriveStopper<D>,
    /// The rows of the picture for what was heard.
    pub rows: Box<dyn FnMut(Vec<Piece>) -> Vec<LiveRow>>,
}

/// Reads the row of a drive.
type DriveReader<D> = fn(&mut RigSession<D>, <D as HeldDrives>::Drive) -> Result<TopRow, Failure>;

/// Stops a drive.
type DriveStopper<D> = fn(&mut RigSession<D>, <D as HeldDrives>::Drive) -> Result<String, Failure>;

/// Shows all drives, a row each.
///
/// # Errors
/// [`Failure`]: the drives do not answer, the program was interrupted, or there is no page.
pub(super) fn top<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &TopArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    check(arguments, output)?;
    let look = Use::look("top");
    on(bench, &arguments.rig, look, output, |session, output| {
        D::top(session).show(session, arguments, output)
    })
}

impl<D: HeldDrives> LineTop<D> {
    /// Shows drives: with `--once` one page, and without it live.
    fn show(
        self,
        session: &mut RigSession<D>,
        arguments: &TopArguments,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        let rig = session.rig().id().to_owned();
        let form = self.form;
        let drives = session.drives().listed();
        let scene = TopScene {
            title: format!("{rig}: {}", self.what),
            traffic: self.traffic,
            picture: self.picture.clone(),
        };
        let port = session.rig().port();
        let adapter = port.and_then(|port| Some((port.places().next()?, port.rate)));
        let place = adapter.map_or("simulated".to_owned(), |((adapter, place), rate)| {
            format!("{adapter} {place}, {rate} kbit/s")
        });
        let count = counted(drives.len(), form.drive);
        let heading = Heading {
            rig,
            form,
            parts: vec![format!("port: {count}, {place}")],
        };
        let mut reader = LineReader {
            traffic: LineTraffic::of(&self.picture.columns, session.guarded().now()),
            view: self,
            drives,
            session,
            arguments,
            heard: Vec::new(),
        };
        if arguments.once {
            let read = once(&mut reader)?;
            let rows: Vec<_> = read.drives.into_values().map(|row| row.cells).collect();
            output.result(&output.fitted(&columns(&form.heads(), &rows)))?;
            return Ok(Exit::Passed);
        }
        reader.record(true);
        live(&mut reader, heading, scene, arguments, output)
    }
}

/// The drives of a port.
struct LineReader<'v, D: HeldDrives> {
    view: LineTop<D>,
    session: &'v mut RigSession<D>,
    drives: Vec<D::Drive>,
    traffic: LineTraffic,
    arguments: &'v TopArguments,
    /// The rows of the picture that no page has shown yet.
    heard: Vec<LiveRow>,
}

impl<D: HeldDrives> TopReader for LineReader<'_, D> {
    fn drives(&self) -> usize {
        self.drives.len()
    }

    fn is_simulated(&self) -> bool {
        self.session.rig().is_simulated()
    }

    fn now(&self) -> Instant {
        self.session.guarded().now()
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        match D::pass(self.session, time) {
            // A drive has left the exchange: the next reading tells why.
            Err(Failure::Bus(Exit::Failed, _)) => Ok(()),
            other => other,
        }
    }

    fn read(&mut self, first: usize, into: &mut Snapshot) -> Result<usize, Failure> {
        let Some(drive) = self.drives.get(first) else {
            return Ok(0);
        };
        let row = match (self.view.read)(self.session, *drive) {
            // The others are still shown.
            Err(Failure::Bus(Exit::Failed, why)) if !self.arguments.once => {
                into.disturbed(why.clone());
                self.not_read(*drive, why)
            }
            other => other?,
        };
        into.drives.insert(first, row);
        Ok(1)
    }

    fn stop(&mut self, drive: usize) -> Result<String, Failure> {
        (self.view.stop)(self.session, self.drives[drive])
    }

    fn named(&self, drives: &[usize]) -> String {
        let drives: Vec<_> = drives.iter().map(|place| self.drives[*place]).collect();
        D::named(&drives)
    }

    fn look(&mut self, into: &mut Snapshot) {
        if self.arguments.once {
            return;
        }
        let mut rows = (self.view.rows)(heard(self.session));
        self.traffic.take(&rows, self.session.guarded().now());
        if self.arguments.web.is_some() {
            self.heard.append(&mut rows);
        }
        into.parts = vec![vec![self.traffic.line(self.view.traffic)]];
    }

    fn record(&mut self, on: bool) {
        self.session.link().record(on);
        if on {
            self.heard.clear();
            self.traffic =
                LineTraffic::of(&self.view.picture.columns, self.session.guarded().now());
        }
    }

    fn heard(&mut self) -> LiveNews {
        LiveNews {
            traffic: self.traffic.table(),
            rows: std::mem::take(&mut self.heard),
            ..LiveNews::default()
        }
    }
}

impl<D: HeldDrives> LineReader<'_, D> {
    /// The row of a drive that could not be read.
    fn not_read(&self, drive: D::Drive, why: String) -> TopRow {
        let mut cells = vec!["-".to_owned(); self.view.form.columns.len()];
        if let [first, .., last] = &mut cells[..] {
            *first = D::number(&drive).to_string();
            *last = why;
        }
        TopRow {
            state: 0,
            in_error: true,
            speed: None,
            error: None,
            cells,
        }
    }
}

/// What the line has carried since the last call.
fn heard<D: HeldDrives>(session: &mut RigSession<D>) -> Vec<Piece> {
    let record = HeldRecord::of(session.guarded(), 1);
    session.link().record(true);
    let tape = match session.rig().is_simulated() {
        true => Tape::of(&record.traces, Rate::default()),
        false => Tape::of_ports(&record.traces, record.medium, record.now),
    };
    tape.pieces.into_iter().map(|(.., piece)| piece).collect()
}

/// What each station has sent since it was first looked at.
struct LineTraffic {
    names: Vec<String>,
    /// Frames or telegrams.
    counts: Vec<u64>,
    /// How many of them no receiver has, or not as they were sent.
    damaged: Vec<u64>,
    rates: Vec<f64>,
    window: RateWindow<Vec<u64>>,
}

impl LineTraffic {
    fn of(stations: &[String], now: Instant) -> Self {
        let none = vec![0; stations.len()];
        Self {
            names: stations.to_vec(),
            counts: none.clone(),
            damaged: none.clone(),
            rates: vec![0.0; stations.len()],
            window: RateWindow::new(now, none),
        }
    }

    /// Counts rows of the picture.
    fn take(&mut self, rows: &[LiveRow], now: Instant) {
        for row in rows {
            let Some(station) = row.sender().filter(|station| *station < self.names.len()) else {
                continue;
            };
            let rows = row.fold.max(1);
            self.counts[station] += rows;
            self.damaged[station] += if row.is_damaged() { rows } else { 0 };
        }
        let (before, span) = self.window.take(now, self.counts.clone());
        let seconds = span.as_millis_f64() / 1_000.0;
        let counts = self.counts.iter().zip(before);
        let rate = |(count, before)| match seconds > 0.0 {
            true => (count - before) as f64 / seconds,
            false => 0.0,
        };
        self.rates = counts.map(rate).collect();
    }

    /// A row a station.
    fn table(&self) -> Vec<Vec<String>> {
        let stations = self.names.iter().enumerate();
        let row = |(station, name): (usize, &String)| {
            vec![
                name.clone(),
                self.counts[station].to_string(),
                format!("{:.1}", self.rates[station]),
                self.damaged[station].to_string(),
            ]
        };
        stations.map(row).collect()
    }

    /// All stations in a line, with the heads of the table.
    fn line(&self, [_, counted, rate, damaged]: &[&str; 4]) -> HeadLine {
        let [count, bad] = [&self.counts, &self.damaged].map(|counts| counts.iter().sum::<u64>());
        let sum: f64 = self.rates.iter().sum();
        HeadLine {
            text: format!("  {sum:.1} {rate}, {count} {counted}, {bad} {damaged}"),
            is_error: bad > 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traffic_is_counted_by_its_sender() {
        let arrow = |ends, arrived| LiveRow::arrow(3, ends, arrived, String::new(), String::new());
        let at = |seconds: u64| Instant::START + Span::from_millis(1_000 * seconds);
        let mut traffic = LineTraffic::of(&["bench", "1", "2"].map(str::to_owned), at(0));
        let rows = [
            arrow((0, Some(1)), true),
            arrow((1, Some(0)), true),
            arrow((0, None), true),
            arrow((0, Some(2)), false),
            LiveRow {
                fold: 6,
                ..arrow((2, Some(0)), true)
            },
        ];
        assert_eq!(traffic.table()[0], ["bench", "0", "0.0", "0"]);
        traffic.take(&rows, at(2));
        let expected = [
            ["bench", "3", "1.5", "1"],
            ["1", "1", "0.5", "0"],
            ["2", "6", "3.0", "0"],
        ];
        assert_eq!(traffic.table(), expected);
        let line = traffic.line(&["from", "frames", "frames/s", "damaged"]);
        let text = "  5.0 frames/s, 10 frames, 1 damaged".to_owned();
        let is_error = true;
        assert_eq!(line, HeadLine { text, is_error });
        // A rate is that of the last two seconds.
        traffic.take(&rows[..1], at(4));
        assert_eq!(traffic.table()[0], ["bench", "4", "0.5", "1"]);
        assert_eq!(traffic.table()[1], ["1", "1", "0.0", "0"]);
    }
}
