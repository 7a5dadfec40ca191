//! Files of Saleae's Logic: levels as text and as binary, and octets as its serial analyser exports them.

use super::super::CaptureError;
use super::Channels;
use super::levels::{Levels, LineLevel, sample_time};
use super::links::{ChannelRead, Signal};
use super::numbers::{SignedTime, byte, date, from_float, seconds};
use super::table::{Table, columns, first_line};
use super::uart::OctetRead;
use crate::counted::counted;
use harness_proto::line::LineError;

/// What to do about bytes in another radix.
const RADIX: &str = "a byte such as 0x1F is expected; export with radix Hex, since characters and decimal numbers lose bytes";

fn names(bytes: &[u8]) -> Vec<String> {
    let names = columns(first_line(bytes));
    names.into_iter().map(|name| name.to_lowercase()).collect()
}

fn is_time(name: &str) -> bool {
    name.starts_with("time") && name.trim_end_matches(' ').ends_with("[s]")
}

/// Whether a file is the text that a serial analyser exports: `Time [s],Value,Parity Error,Framing Error`.
pub(super) fn is_analyser(bytes: &[u8]) -> bool {
    let names = names(bytes);
    let has = |name: &str| names.iter().any(|column| column == name);
    names.first().is_some_and(|name| is_time(name))
        && (has("value") || has("data"))
        && (has("framing error") || has("parity error"))
}

/// Whether a file is a table of Logic 2: `name,type,start_time,duration,"data"`.
pub(super) fn is_data_table(bytes: &[u8]) -> bool {
    let names = names(bytes);
    let has = |name: &str| names.iter().any(|column| column == name);
    has("type") && (has("start_time") || has("start time")) && has("duration")
}

/// Whether a file has the levels of channels: `Time [s],Channel 0,...`.
pub(super) fn is_levels(bytes: &[u8]) -> bool {
    let names = names(bytes);
    names.len() > 1 && names.first().is_some_and(|name| is_time(name)) && !is_analyser(bytes)
}

/// The levels of channels: a row for each change of any of them.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn levels(bytes: &[u8]) -> Result<Channels, CaptureError> {
    levels_of(Table::new(bytes), None)
}

/// The levels of the columns of a table after the first one, which has the times; `sample` is the time between samples, where it is known.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn levels_of(
    mut table: Table<'_>,
    sample: Option<SignedTime>,
) -> Result<Channels, CaptureError> {
    let line = Levels {
        sample,
        ..Levels::default()
    };
    let mut lines = vec![(line, None); table.columns.len().saturating_sub(1)];
    // Rows of the same levels as the one before are written by other programs at times of their own.
    while table.next()? {
        if table.fields() != lines.len() + 1 {
            let expected = lines.len() + 1;
            return Err(table.wrong(format!("{expected} fields are expected in each row")));
        }
        let time = time(&table, 0)?;
        for (place, (line, other)) in lines.iter_mut().enumerate() {
            let level = match table.raw(place + 1).trim_ascii() {
                [level] => LineLevel::of(*level),
                [] => Some(LineLevel::Unknown),
                _ => None,
            };
            // An analogue channel has voltages.
            let Some(level) = level else {
                let expected = "0, 1 or X is expected; choose a digital channel";
                other.get_or_insert_with(|| table.wrong_field(place + 1, expected));
                continue;
            };
            if !line.push(time, level) {
                return Err(table.wrong_field(0, "this time is before that of the row above"));
            }
        }
    }
    let names = table.columns.into_iter().skip(1);
    let channels = names.zip(lines).map(|(name, (levels, other))| ChannelRead {
        names: vec![name],
        signal: other.map_or(Signal::Levels(levels), Signal::Other),
    });
    Ok((channels.collect(), Vec::new()))
}

/// The time of a row: seconds, or a date.
fn time(table: &Table<'_>, column: usize) -> Result<SignedTime, CaptureError> {
    let text = table.text(column);
    let time = seconds(&text).or_else(|| date(&text));
    time.ok_or_else(|| table.wrong_field(column, "a time in seconds or a date is expected"))
}

/// What an analyser calls an error of the line.
fn error(text: &str) -> Result<Option<LineError>, String> {
    let text = text.trim().to_lowercase();
    match text.as_str() {
        "" | "false" => Ok(None),
        text if text.contains("parity") => Ok(Some(LineError::Parity)),
        text if text.contains("framing") => Ok(Some(LineError::Framing)),
        _ => Err("`parity` or `framing` is expected".to_owned()),
    }
}

/// The octets of the text of a serial analyser.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn analyser(bytes: &[u8]) -> Result<Channels, CaptureError> {
    let mut table = Table::new(bytes);
    let Ok(value) = table.column("value") else {
        return Err(table.wrong(
            "the analyser was in a multiprocessor mode, in which the parity bit counts as data; set its mode to Normal and the parity of \
             the line, and export again",
        ));
    };
    let errors = [
        ("parity error", LineError::Parity),
        ("framing error", LineError::Framing),
    ];
    let errors = errors.map(|(name, error)| (table.find(name), error));
    let mut octets: Vec<OctetRead> = Vec::new();
    while table.next()? {
        let start = time(&table, 0)?;
        let Some(byte) = byte(&table.text(value)) else {
            return Err(table.wrong_field(value, RADIX));
        };
        let mut error = None;
        for (column, kind) in errors {
            let Some(column) = column else { continue };
            match table.raw(column).trim_ascii() {
                b"" => {}
                text if text.eq_ignore_ascii_case(b"error") => error = error.or(Some(kind)),
                _ => return Err(table.wrong_field(column, "nothing or `Error` is expected")),
            }
        }
        in_order(&table, octets.last(), start)?;
        octets.push(OctetRead { start, byte, error });
    }
    let channel = ChannelRead {
        names: Vec::new(),
        signal: Signal::Octets(octets),
    };
    Ok((vec![channel], Vec::new()))
}

pub(super) fn in_order(
    table: &Table<'_>,
    last: Option<&OctetRead>,
    start: SignedTime,
) -> Result<(), CaptureError> {
    match last {
        Some(last) if start < last.start => {
            Err(table.wrong("this octet is before the one above it; sort the table by time"))
        }
        _ => Ok(()),
    }
}

/// The octets of a table of Logic 2: rows of the type `data`, the analyser's name as the channel.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn data_table(bytes: &[u8]) -> Result<Channels, CaptureError> {
    let mut table = Table::new(bytes);
    let kind = table.column("type")?;
    let start = table
        .find("start_time")
        .map_or_else(|| table.column("start time"), Ok)?;
    let (name, data) = (table.find("name"), table.column("data")?);
    let (errors, address) = (table.find("error"), table.find("address"));
    let mut channels: Vec<(String, Vec<OctetRead>)> = Vec::new();
    let mut others = 0_usize;
    while table.next()? {
        if table.raw(kind) != b"data" {
            others += 1;
            continue;
        }
        if address.is_some_and(|column| !table.raw(column).trim_ascii().is_empty()) {
            return Err(table.wrong("the analyser was in a multiprocessor mode; set its mode to Normal and export again"));
        }
        let start = time(&table, start)?;
        let Some(byte) = byte(&table.text(data)) else {
            return Err(table.wrong_field(data, RADIX));
        };
        let error = match errors {
            Some(column) => {
                error(&table.text(column)).map_err(|what| table.wrong_field(column, &what))?
            }
            None => None,
        };
        let analyser = name.map_or("".into(), |name| table.text(name));
        let place = channels.iter().position(|(name, _)| *name == analyser);
        let place = place.unwrap_or(channels.len());
        if place == channels.len() {
            if place == MOST {
                return Err(table.wrong(format!("more than {MOST} analysers")));
            }
            channels.push((analyser.into_owned(), Vec::new()));
        }
        let octets = &mut channels[place].1;
        in_order(&table, octets.last(), start)?;
        octets.push(OctetRead { start, byte, error });
    }
    let mut notes = Vec::new();
    if others > 0 {
        notes.push(format!(
            "{} not read, of another type than `data`",
            counted(others, "row")
        ));
    }
    let channels = channels.into_iter().map(|(name, octets)| ChannelRead {
        names: if name.is_empty() {
            Vec::new()
        } else {
            vec![name]
        },
        signal: Signal::Octets(octets),
    });
    Ok((channels.collect(), notes))
}

/// The most analysers of a table.
const MOST: usize = 1_000;

/// What a binary file begins with.
pub(super) const BINARY: &[u8] = b"<SALEAE>";

/// A binary file that is being read.
struct Binary<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl Binary<'_> {
    fn wrong<T>(&self, what: impl Into<String>) -> Result<T, CaptureError> {
        Err(CaptureError::At {
            offset: self.at,
            what: what.into(),
        })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CaptureError> {
        let bytes = self.bytes.get(self.at..self.at.saturating_add(N));
        match bytes.and_then(|bytes| <[u8; N]>::try_from(bytes).ok()) {
            Some(taken) => {
                self.at += N;
                Ok(taken)
            }
            None => self.wrong(format!("{N} bytes are expected here; the file ends before")),
        }
    }

    fn u32(&mut self) -> Result<u32, CaptureError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, CaptureError> {
        self.take().map(u64::from_le_bytes)
    }

    fn time(&mut self) -> Result<SignedTime, CaptureError> {
        let place = self.at;
        let seconds = f64::from_le_bytes(self.take()?);
        from_float(seconds).ok_or_else(|| CaptureError::At {
            offset: place,
            what: format!("{seconds} seconds are no time of a capture"),
        })
    }

    /// A part without gaps: the level at its beginning, and the times at which it changes.
    fn part(&mut self, levels: &mut Levels, with_rate: bool) -> Result<(), CaptureError> {
        let level = |state: u32| {
            if state & 1 == 1 {
                LineLevel::High
            } else {
                LineLevel::Low
            }
        };
        let state = self.u32()?;
        if state > 1 {
            self.at -= 4;
            return self.wrong(format!("{state} is no level: 0 or 1"));
        }
        if with_rate {
            let rate = f64::from_le_bytes(self.take()?);
            // A cast of a number in this range loses nothing that matters.
            let rate = (1.0..1e12).contains(&rate).then_some(rate as u64);
            levels.sample = rate.and_then(sample_time);
        }
        let (begin, end) = (self.time()?, self.time()?);
        let count = self.u64()?;
        let early = "this time is before the one in front of it";
        if !levels.push(begin, level(state)) {
            return self.wrong(early);
        }
        let mut state = state;
        for _ in 0..count {
            let at = self.time()?;
            state ^= 1;
            if !levels.push(at, level(state)) {
                return self.wrong(early);
            }
        }
        // Between two parts nothing was recorded.
        if !levels.push(end, LineLevel::Unknown) {
            return self.wrong("the part ends before its last change");
        }
        levels.end = Some(end);
        Ok(())
    }
}

/// The levels of one channel from a binary file, of version 0 or 1.
///
/// # Errors
/// What cannot be, and where.
pub(super) fn binary(bytes: &[u8]) -> Result<Channels, CaptureError> {
    let mut file = Binary {
        bytes,
        at: BINARY.len(),
    };
    let (version, kind) = (file.u32()?, file.u32()?);
    if version > 1 {
        return file.wrong(format!("version {version} is not known: 0 or 1"));
    }
    if kind != 0 {
        return file.wrong("this is an analogue channel; export the digital one");
    }
    let mut levels = Levels::default();
    if version == 0 {
        file.part(&mut levels, false)?;
    } else {
        for _ in 0..file.u64()? {
            file.part(&mut levels, true)?;
        }
    }
    let channel = ChannelRead {
        names: Vec::new(),
        signal: Signal::Levels(levels),
    };
    Ok((vec![channel], Vec::new()))
}
