//! Recordings of values, read back: the csv of `watch` and of `scope`, and the records in the JSON of `trace`.

use crate::command::drawing::SCOPE_HEADING;
use crate::regular;
use crate::report::chart::{Curve, HEX, number_of};
use csv::{ByteRecord, Reader, ReaderBuilder};
use serde::Deserialize;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Bytes of a file at most.
const MOST_BYTES: u64 = 64 << 20;
/// Bytes of a name or a unit at most.
const LONGEST_NAME: usize = 100;
/// Values of a file at most.
const MOST_VALUES: usize = 2_000_000;

/// What was recorded.
#[derive(Debug, Default)]
pub(super) struct Recording {
    /// Its values; times in milliseconds.
    pub(super) curves: Vec<Curve>,
    /// Its time 0 is known to be a trigger.
    pub(super) triggered: bool,
}

/// Why a file is no recording, and where.
#[derive(Debug, thiserror::Error)]
pub(super) enum RecordingError {
    #[error("failed to read {}: {error}", path.display())]
    Unreadable {
        path: PathBuf,
        error: std::io::Error,
    },
    #[error("{}: {what}", path.display())]
    NoRecording { path: PathBuf, what: String },
    #[error("{}: {place}: {what}", path.display())]
    Wrong {
        path: PathBuf,
        place: String,
        what: String,
    },
}

/// What is wrong, and at which place of the file; none: the whole file.
#[derive(Debug)]
struct Fault {
    place: Option<String>,
    what: String,
}

impl Fault {
    fn whole(what: impl Into<String>) -> Self {
        Self {
            place: None,
            what: what.into(),
        }
    }
}

/// Reads a recording.
///
/// # Errors
/// [`RecordingError`]: the file cannot be read, is too large, is another one than drivebench writes, or has a line that it would not write.
pub(super) fn read(path: &Path) -> Result<Recording, RecordingError> {
    let unreadable = |error| RecordingError::Unreadable {
        path: path.to_owned(),
        error,
    };
    let file = regular::open_input(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    let read = file.take(MOST_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(unreadable)?;
    if bytes.len() as u64 > MOST_BYTES {
        let what = format!("it has more than {} MiB", MOST_BYTES >> 20);
        return Err(unreadable(std::io::Error::other(what)));
    }
    recording(&bytes).map_err(|fault| match fault.place {
        None => RecordingError::NoRecording {
            path: path.to_owned(),
            what: fault.what,
        },
        Some(place) => RecordingError::Wrong {
            path: path.to_owned(),
            place,
            what: fault.what,
        },
    })
}

fn recording(bytes: &[u8]) -> Result<Recording, Fault> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    if bytes.starts_with(b"{") {
        return records(bytes);
    }
    let mut lines = bytes.split(|byte| *byte == b'\n');
    let line = lines.next().unwrap_or_default();
    let line = String::from_utf8_lossy(line);
    let line = line.trim_end_matches('\r');
    let found = match line.split_once(',') {
        _ if line == SCOPE_HEADING => scope(bytes)?,
        Some(("time_ms", _)) => watch(bytes)?,
        _ => return Err(Fault::whole(other(line))),
    };
    let mut points = found.curves.iter().flat_map(|curve| &curve.points);
    match points.any(|point| point.1.is_some()) {
        true => Ok(found),
        false => Err(Fault::whole("it has no value that an axis can show")),
    }
}

/// What a file is that has no values of ours.
fn other(line: &str) -> String {
    let names: Vec<_> = line.split(',').collect();
    if names.contains(&"t_ns") {
        return "it lists what a line carried, as `trace --format csv` does, and has no values; \
                `trace --format json` has those of `record`, `watch --csv` and `scope --csv` read values from drives"
            .to_owned();
    }
    if line.starts_with("time_") && line.contains([';', '\t']) {
        return "its columns are not separated by commas: a spreadsheet has changed it; use the file as drivebench wrote it"
            .to_owned();
    }
    let shown: String = line.chars().take(40).collect();
    format!(
        "its first line is {shown:?}; expected is the csv of `watch` (time_ms, then the cells), the csv of `scope` ({SCOPE_HEADING}), or the JSON of `trace`"
    )
}

/// The rows of a csv that are read one after another.
struct CsvRows<'b> {
    reader: Reader<&'b [u8]>,
    names: Vec<String>,
    row: ByteRecord,
    values: usize,
}

impl<'b> CsvRows<'b> {
    fn new(bytes: &'b [u8]) -> Result<Self, Fault> {
        let mut reader = ReaderBuilder::new().from_reader(bytes);
        let heads = reader.headers().map_err(|error| fault(&error))?;
        let names: Vec<_> = heads.iter().map(str::to_owned).collect();
        names.iter().try_for_each(|name| named(name))?;
        Ok(Self {
            reader,
            names,
            row: ByteRecord::new(),
            values: 0,
        })
    }

    fn next(&mut self) -> Result<bool, Fault> {
        let read = self.reader.read_byte_record(&mut self.row);
        read.map_err(|error| fault(&error))
    }

    /// Counts a value.
    fn count(&mut self) -> Result<(), Fault> {
        self.values += 1;
        match self.values > MOST_VALUES {
            true => Err(Fault {
                place: Some(format!("line {}", self.line())),
                what: format!("more than {MOST_VALUES} values"),
            }),
            false => Ok(()),
        }
    }

    fn line(&self) -> u64 {
        self.row.position().map_or(1, csv::Position::line)
    }

    fn text(&self, column: usize) -> &str {
        let field = self.row.get(column).unwrap_or_default();
        // What is no text is refused by what reads the field.
        std::str::from_utf8(field).unwrap_or("\u{FFFD}")
    }

    fn wrong(&self, column: usize, expected: &str) -> Fault {
        let shown: String = self.text(column).chars().take(40).collect();
        let name = self.names.get(column).map_or("", String::as_str);
        Fault {
            place: Some(format!(
                "line {}, column {} (`{name}`)",
                self.line(),
                column + 1
            )),
            what: format!("{shown:?} is {expected}"),
        }
    }

    /// A time that is not before the one in front of it.
    fn time(&self, column: usize, last: Option<f64>) -> Result<f64, Fault> {
        let at = number_of(self.text(column), "");
        let at = at.ok_or_else(|| self.wrong(column, "no time"))?;
        match last.is_some_and(|last| at < last) {
            true => Err(self.wrong(column, "before the time of the line in front of it")),
            false => Ok(at),
        }
    }

    /// A value; `None` where there is none, or a word such as `off` that the program writes in place of a number.
    fn value(&self, column: usize, unit: &str) -> Result<Option<f64>, Fault> {
        let text = self.text(column);
        match number_of(text, unit) {
            None if !text.is_empty() && !is_word(text, unit) => Err(self.wrong(column, "no value")),
            value => Ok(value),
        }
    }
}

/// Whether a text stands for a value that no axis can have: a word, or more bytes than a number.
fn is_word(text: &str, unit: &str) -> bool {
    if unit == HEX {
        return text.bytes().all(|byte| byte.is_ascii_hexdigit());
    }
    let not = ["nan", "inf", "infinity"];
    text.starts_with(|letter: char| letter.is_ascii_alphabetic())
        && !not.contains(&text.to_ascii_lowercase().as_str())
}

fn fault(error: &csv::Error) -> Fault {
    let what = match error.kind() {
        csv::ErrorKind::UnequalLengths {
            expected_len, len, ..
        } => format!("{len} columns, where the first line has {expected_len}"),
        csv::ErrorKind::Utf8 { .. } => "it is no text in UTF-8".to_owned(),
        _ => error.to_string(),
    };
    let line = error.position().map_or(1, csv::Position::line);
    Fault {
        place: Some(format!("line {line}")),
        what,
    }
}

/// Refuses names that the program does not write, and that a terminal would obey.
fn named(name: &str) -> Result<(), Fault> {
    match name.len() > LONGEST_NAME || name.chars().any(char::is_control) {
        false => Ok(()),
        true => {
            let shown: String = name.chars().take(40).collect();
            Err(Fault::whole(format!(
                "{shown:?} is no name: it is longer than {LONGEST_NAME} bytes, or has control characters"
            )))
        }
    }
}

/// The csv of `watch`: a time in milliseconds, then a column for each cell, its unit in brackets.
fn watch(bytes: &[u8]) -> Result<Recording, Fault> {
    let mut rows = CsvRows::new(bytes)?;
    let heads = rows.names.iter().skip(1);
    let mut curves: Vec<_> = heads
        .map(|head| {
            let unit = head.strip_suffix(']');
            let unit = unit.and_then(|words| words.rsplit_once(" ["));
            let (name, unit) = unit.unwrap_or((head, ""));
            Curve {
                name: name.to_owned(),
                unit: unit.to_owned(),
                ..Curve::default()
            }
        })
        .collect();
    let mut last = None;
    while rows.next()? {
        let at = rows.time(0, last)?;
        last = Some(at);
        for (place, curve) in curves.iter_mut().enumerate() {
            rows.count()?;
            let value = rows.value(place + 1, &curve.unit)?;
            curve.points.push((at, value));
        }
    }
    Ok(Recording {
        curves,
        triggered: false,
    })
}

/// The csv of `scope`: a line for each measurement.
fn scope(bytes: &[u8]) -> Result<Recording, Fault> {
    let mut rows = CsvRows::new(bytes)?;
    let mut curves: Vec<(String, Curve)> = Vec::new();
    while rows.next()? {
        rows.count()?;
        let (signal, name, unit) = (rows.text(1), rows.text(2), rows.text(5));
        if !matches!(signal, "1" | "2") {
            return Err(rows.wrong(1, "no signal: 1 or 2 is expected"));
        }
        let place = match curves.iter().position(|known| known.0 == signal) {
            Some(place) => place,
            None => {
                named(name)?;
                named(unit)?;
                let curve = Curve {
                    name: name.to_owned(),
                    unit: unit.to_owned(),
                    ..Curve::default()
                };
                curves.push((signal.to_owned(), curve));
                curves.len() - 1
            }
        };
        let curve = &mut curves[place].1;
        if curve.name != name {
            return Err(rows.wrong(2, "another name than this signal has in front of it"));
        }
        if curve.unit != unit {
            return Err(rows.wrong(5, "another unit than this signal has in front of it"));
        }
        let last = curve.points.last().map(|point| point.0 * 1e3);
        // Rounding may have moved the last one.
        let at = rows.time(0, last.map(|last| last - 1e-3))?;
        let value = rows.value(4, unit)?;
        curve.points.push((at / 1e3, value));
    }
    curves.sort_by(|a, b| a.0.cmp(&b.0));
    let curves: Vec<_> = curves.into_iter().map(|curve| curve.1).collect();
    let first = curves.iter().filter_map(|curve| curve.points.first());
    Ok(Recording {
        // Without a trigger the first measurement is at 0.
        triggered: first.map(|point| point.0).min_by(f64::total_cmp) != Some(0.0),
        curves,
    })
}

/// The JSON of `trace`, of which only the records are read.
#[derive(Deserialize)]
struct TraceObject {
    schema: u32,
    #[serde(default)]
    records: Vec<RecordObject>,
    #[serde(default)]
    second: Option<Box<TraceObject>>,
}

#[derive(Deserialize)]
struct RecordObject {
    drive: u8,
    cell: String,
    unit: String,
    every_ns: Option<u64>,
    samples: Vec<SampleObject>,
}

#[derive(Deserialize)]
struct SampleObject {
    t_ns: u64,
    value: Option<f64>,
}

#[expect(clippy::cast_precision_loss, reason = "nanoseconds of a recording")]
fn records(bytes: &[u8]) -> Result<Recording, Fault> {
    let trace: TraceObject = serde_json::from_slice(bytes).map_err(|error| Fault {
        place: Some(format!("line {}, column {}", error.line(), error.column())),
        what: format!("it is not the JSON of `trace`: {error}"),
    })?;
    if trace.schema != 1 {
        return Err(Fault::whole(format!(
            "its schema is {}, and this program reads 1",
            trace.schema
        )));
    }
    let second = trace.second.map_or(Vec::new(), |second| second.records);
    let rings = [("", trace.records), ("2:", second)];
    let all = rings
        .into_iter()
        .flat_map(|(ring, records)| records.into_iter().map(move |record| (ring, record)));
    let mut curves = Vec::new();
    for (ring, record) in all {
        let samples = record.samples.into_iter();
        let points: Vec<_> = samples
            .map(|sample| (sample.t_ns as f64 / 1e6, sample.value))
            .collect();
        named(&record.cell)?;
        named(&record.unit)?;
        if points.windows(2).any(|two| two[1].0 < two[0].0) {
            let what = format!("the times of {} go back", record.cell);
            return Err(Fault::whole(what));
        }
        curves.push(Curve {
            name: format!("{ring}{} {}", record.drive, record.cell),
            unit: record.unit,
            held: record.every_ns.is_none(),
            points,
            ..Curve::default()
        });
    }
    match curves.is_empty() {
        true => Err(Fault::whole(
            "it has no record: a scenario with `record` has some",
        )),
        false => Ok(Recording {
            curves,
            triggered: false,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str) -> String {
        match recording(text.as_bytes()) {
            Ok(found) => format!("{} curves", found.curves.len()),
            Err(Fault { place, what }) => match place {
                Some(place) => format!("{place}: {what}"),
                None => what,
            },
        }
    }

    #[test]
    fn our_own_tables_are_read() {
        let text =
            "time_ms,0 nist [rpm],0 Status [hex],1 mode\r\n0.000,1.5,1F,off\r\n10.5,,20,3\r\n";
        let found = recording(text.as_bytes()).expect("a recording");
        assert!(!found.triggered);
        let [speed, status, mode] = &found.curves[..] else {
            panic!("{found:?}");
        };
        assert_eq!((&*speed.name, &*speed.unit), ("0 nist", "rpm"));
        assert_eq!(speed.points, [(0.0, Some(1.5)), (10.5, None)]);
        assert_eq!(status.points, [(0.0, Some(31.0)), (10.5, Some(32.0))]);
        assert_eq!(mode.points, [(0.0, None), (10.5, Some(3.0))]);
        let text = format!(
            "{SCOPE_HEADING}\n-3000,2,UZK,00,,V\n-2000,1,nist,05,10,rpm\n0,1,nist,06,12,rpm\n"
        );
        let found = recording(text.as_bytes()).expect("a recording");
        assert!(found.triggered);
        assert_eq!(
            found.curves[0].points,
            [(-2.0, Some(10.0)), (0.0, Some(12.0))]
        );
        assert_eq!(found.curves[1].points, [(-3.0, None)]);
        let text = r#"{"schema":1,"ring":3,"links":[],"records":[{"drive":1,"cell":"nist","unit":"rpm","every_ns":null,
            "samples":[{"t_ns":1000000,"raw":"00","value":3.5},{"t_ns":2000000,"raw":"00","value":null}]}]}"#;
        let found = recording(text.as_bytes()).expect("a recording");
        assert_eq!(found.curves[0].points, [(1.0, Some(3.5)), (2.0, None)]);
        assert!(found.curves[0].held);
    }

    #[test]
    fn other_files_are_refused_with_the_place() {
        let scope = |rows: &str| format!("{SCOPE_HEADING}\n{rows}\n");
        for (text, part) in [
            ("", "its first line is \"\""),
            ("\u{0}\u{1}", "its first line is"),
            ("time_ms,a\n", "it has no value that an axis can show"),
            (
                "time_ms,a\n0,abc\n",
                "it has no value that an axis can show",
            ),
            ("time_ms;a\n0;1\n", "not separated by commas"),
            ("ring,t_ns,link\n", "has no values"),
            (
                "time_ms,a [rpm]\n0,1\nx,2\n",
                "line 3, column 1 (`time_ms`): \"x\" is no time",
            ),
            (
                "time_ms,a [rpm]\n0,1\n1,2,3\n",
                "line 3: 3 columns, where the first line has 2",
            ),
            (
                "time_ms,a [rpm]\n5,1\n1,2\n",
                "line 3, column 1 (`time_ms`): \"1\" is before",
            ),
            (
                "time_ms,a [rpm]\n5,1x\n",
                "line 2, column 2 (`a [rpm]`): \"1x\" is no value",
            ),
            (
                "time_ms,a [rpm]\n5,NaN\n",
                "line 2, column 2 (`a [rpm]`): \"NaN\" is no value",
            ),
            ("time_ms,a [rpm]\n5,1e300\n", "\"1e300\" is no value"),
            ("time_ms,a [rpm]\ninf,1\n", "\"inf\" is no time"),
            ("time_ms,a [hex]\n5,-1\n", "\"-1\" is no value"),
            ("time_ms,a [hex]\n5,FG\n", "\"FG\" is no value"),
            ("time_ms,a\u{1b}[2J\n5,1\n", "is no name"),
            (
                &scope("0,3,nist,05,10,rpm"),
                "line 2, column 2 (`signal`): \"3\" is no signal",
            ),
            (
                &scope("0,1,a,05,10,rpm\n1,1,b,05,10,rpm"),
                "line 3, column 3 (`name`)",
            ),
            (
                &scope("0,1,a,05,10,rpm\n1,1,a,05,10,V"),
                "line 3, column 6 (`unit`)",
            ),
            (
                &scope("5,1,a,05,10,rpm\n1,1,a,05,10,rpm"),
                "line 3, column 1 (`time_us`)",
            ),
            ("{\"schema\":2}", "its schema is 2"),
            ("{\"schema\":1}", "it has no record"),
            (
                "{\"schema\":",
                "line 1, column 10: it is not the JSON of `trace`",
            ),
        ] {
            let said = said(text);
            assert!(said.contains(part), "{text:?}: {said}");
        }
        let mut bytes = b"time_ms,a\n0,".to_vec();
        bytes.extend([0xFF, 0xFE, b'\n']);
        let Err(fault) = recording(&bytes) else {
            panic!("no text");
        };
        assert!(fault.what.contains("is no value"), "{fault:?}");
    }
}
