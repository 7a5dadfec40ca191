//! `drivebench watch`: values, again and again, of the drives of any bus.

use super::exit::Exit;
use super::failure::Failure;
use super::file;
use super::output::Output;
use crate::command::drive::{WatchArguments, WatchForm};
use crate::report::chart::{Chart, Curve, MAX_CURVES, number_of};
use crate::signals::interrupt_flag;
use crate::trouble::Trouble;
use harness_proto::time::{Instant, Span};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum number of lines of one command.
const MOST: u64 = 1_000_000;
/// Maximum number of readings that are drawn.
const MOST_DRAWN: u64 = 100_000;

pub use crate::report::chart::HEX;

/// What stood in a cell when it was read.
#[derive(Clone, Debug)]
pub struct WatchedCell {
    /// The drive's number.
    pub drive: String,
    /// The cell's name.
    pub name: String,
    /// As people read it: with its unit, or the names of its bits.
    pub words: String,
    /// As a program reads it: without its unit; empty if the manual gives it no meaning.
    pub digits: String,
    /// The unit of `digits`: [`HEX`], or empty for a plain number.
    pub unit: &'static str,
}

/// A number with at most six decimal places.
pub fn decimal(value: f64) -> String {
    // Adding 0 makes -0 positive.
    ((value * 1e6).round() / 1e6 + 0.0).to_string()
}

impl WatchedCell {
    fn is_of(&self, column: &Self) -> bool {
        (&self.drive, &self.name) == (&column.drive, &column.name)
    }

    /// Its curve, without samples.
    fn curve(&self) -> Curve {
        Curve {
            name: format!("{} {}", self.drive, self.name),
            unit: self.unit.to_owned(),
            ..Curve::default()
        }
    }
}

/// What is read again and again.
pub trait WatchBench {
    /// What its drives are called.
    const DRIVE: &'static str;

    /// The time of the bench.
    fn now(&mut self) -> Instant;

    /// Reads each cell of each drive once.
    ///
    /// # Errors
    /// [`Failure`]: a drive does not answer as it must, or the port is lost.
    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure>;

    /// Lets time pass.
    ///
    /// # Errors
    /// [`Failure`]: the port is lost.
    fn run(&mut self, time: Span) -> Result<(), Failure>;
}

/// Refuses times that no table and no picture can hold.
fn check_times(arguments: &WatchArguments) -> Result<(), Failure> {
    let every = arguments.every;
    let longer = |most| every == Span::ZERO || arguments.length.units() / every.units() > most;
    if longer(MOST) {
        return Err(Failure::refused(format!(
            "--every must be longer than nothing, and --for at most {MOST} times as long"
        )));
    }
    match arguments.drawing.wanted() && longer(MOST_DRAWN) {
        false => Ok(()),
        true => Err(Failure::refused(format!(
            "--html and --svg draw at most {MOST_DRAWN} readings: make --every longer or --for shorter, or use --csv"
        ))),
    }
}

/// Watches values on a bench that `on` opens and gives back. The files that are asked for are written behind that, also where the watching
/// was interrupted or has failed.
///
/// # Errors
/// [`Failure`] of the bench, of the output or of a file.
pub fn watch(
    arguments: &WatchArguments,
    output: &mut Output,
    on: impl FnOnce(&mut Readings<'_>, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    check_times(arguments)?;
    arguments.drawing.check()?;
    let ((ended, curves), written) = match &arguments.csv {
        None => (watched(arguments, None, output, on).0, Ok(())),
        Some(path) => {
            file::check(path)?;
            file::write_while(path, |csv| watched(arguments, Some(csv), output, on))?
        }
    };
    let drawn = match curves.is_empty() {
        true => Ok(()),
        false => arguments.drawing.write(&Chart {
            id: "watch",
            title: &format!("Values read every {}", arguments.every),
            note: "Times count from the first reading and tell when a reading began. Between two samples nothing is known.",
            curves: &curves,
            ..Chart::default()
        }),
    };
    let files = written.and(drawn);
    match (ended, files) {
        (Ok(exit), Err(failure)) => {
            let own = failure.tell(output);
            Ok(if exit == Exit::Passed { own } else { exit })
        }
        (Err(ended), Err(failure)) => {
            failure.tell(output);
            Err(ended)
        }
        (ended, Ok(())) => ended,
    }
}

/// Watches, and gives the curves that were read up to the end, and whether something was read.
fn watched<'a>(
    arguments: &'a WatchArguments,
    csv: Option<&'a mut dyn Write>,
    output: &mut Output,
    on: impl FnOnce(&mut Readings<'_>, &mut Output) -> Result<Exit, Failure>,
) -> ((Result<Exit, Failure>, Vec<Curve>), bool) {
    let mut readings = Readings {
        arguments,
        csv,
        columns: None,
        curves: Vec::new(),
        interrupt: interrupt_flag(),
    };
    let ended = on(&mut readings, output);
    ((ended, readings.curves), readings.columns.is_some())
}

/// What is read again and again, and what is kept of it.
pub struct Readings<'a> {
    arguments: &'a WatchArguments,
    /// The file of `--csv`.
    csv: Option<&'a mut dyn Write>,
    /// The cells of the first reading.
    columns: Option<Vec<WatchedCell>>,
    curves: Vec<Curve>,
    interrupt: Arc<AtomicBool>,
}

impl Readings<'_> {
    /// Shows values, a line each time, up to the end of `--for` or an interruption.
    ///
    /// # Errors
    /// [`Failure`] of the bench, of the output or of the file of `--csv`.
    pub fn show<W: WatchBench>(
        &mut self,
        watched: &mut W,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        let form = self.arguments.format;
        let again = form == WatchForm::Text && output.full_screen;
        let start = watched.now();
        let end = start + self.arguments.length;
        let mut next = start;
        loop {
            if self.interrupt.load(Ordering::Relaxed) {
                let why = Trouble::Interrupted.to_string();
                return Err(Failure::Bus(Exit::Interrupted, why));
            }
            let at = watched.now().since(start);
            let found = watched.look()?;
            let columns = self.keep(at, &found)?;
            match (form, again) {
                (WatchForm::Csv, _) => output.result(&columns)?,
                (_, true) => output.result(&format!("\r\x1b[K{}", text::<W>(at, &found)))?,
                (_, false) => output.result(&format!("{}\n", text::<W>(at, &found)))?,
            }
            let now = watched.now();
            // If reading takes longer than the given period, it is repeated as often as possible.
            next = (next + self.arguments.every).max(now);
            if next > end {
                break;
            }
            watched.run(next.since(now))?;
        }
        if again {
            output.result("\n")?;
        }
        Ok(Exit::Passed)
    }

    /// Keeps a reading for the files that are asked for, and gives its line of columns, in front of the first one the headings.
    fn keep(&mut self, at: Span, found: &[WatchedCell]) -> Result<String, Failure> {
        let mut line = String::new();
        let columns = self.columns.get_or_insert_with(|| {
            line = format!("{}\n", heading(found));
            found.to_vec()
        });
        line.push_str(&row(at, columns, found));
        line.push('\n');
        if let (Some(csv), Some(path)) = (&mut self.csv, &self.arguments.csv) {
            let written = csv.write_all(line.as_bytes());
            written.map_err(|error| file::failed(path, &error))?;
        }
        if self.arguments.drawing.wanted() {
            if self.curves.is_empty() {
                self.curves = columns.iter().map(WatchedCell::curve).collect();
            }
            let drawn = self.curves.iter_mut().zip(columns).take(MAX_CURVES);
            for (curve, column) in drawn {
                let cell = found.iter().find(|cell| cell.is_of(column));
                let value = cell.and_then(|cell| number_of(&cell.digits, cell.unit));
                curve.points.push((at.as_millis_f64(), value));
            }
        }
        Ok(line)
    }
}

/// Time, and of each drive the names and values.
fn text<W: WatchBench>(at: Span, found: &[WatchedCell]) -> String {
    let mut line = format!("{:>12}", at.to_string());
    let mut drive = None;
    for found in found {
        if drive != Some(&found.drive) {
            drive = Some(&found.drive);
            line.push_str(&format!("  {} {}", W::DRIVE, found.drive));
        }
        line.push_str(&format!("  {} {}", found.name, found.words));
    }
    line
}

fn heading(columns: &[WatchedCell]) -> String {
    let mut line = "time_ms".to_owned();
    for column in columns {
        line.push_str(&format!(",{} {}", column.drive, column.name));
        if !column.unit.is_empty() {
            line.push_str(&format!(" [{}]", column.unit));
        }
    }
    line
}

/// Time and digits, each below its heading: a cell that was not read this time is empty.
fn row(at: Span, columns: &[WatchedCell], found: &[WatchedCell]) -> String {
    let mut line = format!("{:.3}", at.as_millis_f64());
    for column in columns {
        let cell = found.iter().find(|cell| cell.is_of(column));
        line.push_str(&format!(",{}", cell.map_or("", |cell| &cell.digits)));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::{WatchedCell, heading, row};
    use harness_proto::time::Span;

    fn watched_cell(name: &str, digits: &str, unit: &'static str) -> WatchedCell {
        WatchedCell {
            drive: "8".to_owned(),
            name: name.to_owned(),
            words: String::new(),
            digits: digits.to_owned(),
            unit,
        }
    }

    /// A cell that a later reading lacks leaves its column empty; the others stay below their headings.
    #[test]
    fn no_value_moves_to_another_column() {
        let first = [
            watched_cell("a", "1.5", "rpm"),
            watched_cell("b", "00FF", "hex"),
            watched_cell("c", "3", ""),
        ];
        assert_eq!(heading(&first), "time_ms,8 a [rpm],8 b [hex],8 c");
        assert_eq!(row(Span::ZERO, &first, &first), "0.000,1.5,00FF,3");
        let later = [watched_cell("c", "4", ""), watched_cell("a", "2.5", "rpm")];
        assert_eq!(row(Span::from_millis(7), &first, &later), "7.000,2.5,,4");
    }
}
