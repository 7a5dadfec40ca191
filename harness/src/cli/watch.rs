//! `drivebench watch`: values, again and again, of the drives of any bus.

use super::exit::Exit;
use super::failure::Failure;
use super::output::Output;
use crate::buses::commands::{WatchArguments, WatchForm};
use harness_proto::time::{Instant, Span};

/// Maximum number of lines of one command.
const MOST: u64 = 1_000_000;

/// The unit of a column whose values are hexadecimal digits.
pub(crate) const HEX: &str = "hex";

/// What stood in a cell when it was read.
pub(crate) struct WatchedCell {
    /// The drive's number.
    pub(crate) drive: String,
    /// The cell's name.
    pub(crate) name: String,
    /// As people read it: with its unit, or the names of its bits.
    pub(crate) words: String,
    /// As a program reads it: without its unit; empty if the manual gives it no meaning.
    pub(crate) digits: String,
    /// The unit of `digits`: [`HEX`], or empty for a plain number.
    pub(crate) unit: &'static str,
}

/// A number with at most six decimal places.
pub(crate) fn decimal(value: f64) -> String {
    // Adding 0 makes -0 positive.
    ((value * 1e6).round() / 1e6 + 0.0).to_string()
}

impl WatchedCell {
    fn is_of(&self, column: &Self) -> bool {
        (&self.drive, &self.name) == (&column.drive, &column.name)
    }
}

/// What is read again and again.
pub(crate) trait WatchBench {
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

/// Refuses times that no table can hold.
///
/// # Errors
/// [`Failure`] names the option.
pub(crate) fn check_times(arguments: &WatchArguments) -> Result<(), Failure> {
    let every = arguments.every;
    match every == Span::ZERO || arguments.length.units() / every.units() > MOST {
        false => Ok(()),
        true => Err(Failure::refused(format!(
            "--every must be longer than nothing, and --for at most {MOST} times as long"
        ))),
    }
}

/// Shows values, a line each time.
///
/// # Errors
/// [`Failure`] of the bench or of the output.
pub(crate) fn watch<W: WatchBench>(
    arguments: &WatchArguments,
    watched: &mut W,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let again = arguments.format == WatchForm::Text && output.full_screen;
    let start = watched.now();
    let end = start + arguments.length;
    let mut next = start;
    let mut columns: Option<Vec<WatchedCell>> = None;
    loop {
        let at = watched.now().since(start);
        let found = watched.look()?;
        let line = match (arguments.format, &columns) {
            (WatchForm::Text, _) => text::<W>(at, &found),
            (WatchForm::Csv, Some(columns)) => row(at, columns, &found),
            (WatchForm::Csv, None) => {
                output.result(&format!("{}\n", heading(&found)))?;
                let line = row(at, &found, &found);
                columns = Some(found);
                line
            }
        };
        match again {
            true => output.result(&format!("\r\x1b[K{line}"))?,
            false => output.result(&format!("{line}\n"))?,
        }
        let now = watched.now();
        // If reading takes longer than the given period, it is repeated as often as possible.
        next = (next + arguments.every).max(now);
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
        let own = found.iter().find(|own| own.is_of(column));
        line.push_str(&format!(",{}", own.map_or("", |own| &own.digits)));
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
