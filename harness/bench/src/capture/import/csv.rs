//! The tables that `trace --format csv` writes. Columns that repeat others in words are ignored.

use super::super::frames::{FrameRead, Sender, assemble};
use super::super::order::{Counts, Place};
use super::super::telegrams::{self, LATEST};
use super::super::{Assembly, Capture, CaptureError, ends, line_byte};
use super::table::{Table, columns, first_line};
use super::{ImportedCapture, ReadSettings};
use crate::capture::line_formats;
use crate::report::pcapng::error_named;
use crate::report::pcapng_frames::{LOST, MASTER};
use crate::report::pcapng_telegrams::PacketOctet;
use crate::scenario::run::record::from_hex;
use harness_proto::can::{CanError, Frame};
use harness_proto::line::Rate;
use harness_sim::record::FrameEnd;

const BYTES: [&str; 6] = ["t_ns", "link", "n", "sent", "received", "status"];
const FRAMES: [&str; 7] = ["t_ns", "from", "id", "remote", "dlc", "data", "ended"];
const TELEGRAMS: [&str; 5] = ["t_ns", "from", "to", "bytes", "error"];

fn has(bytes: &[u8], names: &[&str]) -> bool {
    let columns = columns(first_line(bytes));
    let has = |name: &&str| columns.iter().any(|column| column == name);
    names.iter().all(has)
}

/// Whether a file is the table of the bytes of a ring.
pub(super) fn is_bytes(bytes: &[u8]) -> bool {
    has(bytes, &BYTES)
}

/// Whether a file is a table of frames.
pub(super) fn is_frames(bytes: &[u8]) -> bool {
    has(bytes, &FRAMES)
}

/// Whether a file is a table of telegrams.
pub(super) fn is_telegrams(bytes: &[u8]) -> bool {
    has(bytes, &TELEGRAMS)
}

/// The places of columns.
fn places<const N: usize>(table: &Table<'_>, names: [&str; N]) -> Result<[usize; N], CaptureError> {
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        *place = table.column(name)?;
    }
    Ok(places)
}

fn nanos(table: &Table<'_>, column: usize) -> Result<u64, CaptureError> {
    let time: Option<u64> = table.text(column).parse().ok();
    time.filter(|nanos| *nanos <= LATEST)
        .ok_or_else(|| table.wrong_field(column, "nanoseconds of at most a year are expected"))
}

/// Reads the table of the bytes of a ring.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn bytes(bytes: &[u8], rate: Option<Rate>) -> Result<Capture, CaptureError> {
    let mut table = Table::new(bytes);
    let [time, link, _, sent, received, status] = places(&table, BYTES)?;
    let mut assembly = Assembly::default();
    while table.next()? {
        let at = nanos(&table, time)?;
        let Some((ring, from, to)) = ends(&table.text(link)) else {
            return Err(table.wrong_field(link, "a link such as 98->97 is expected"));
        };
        let byte = |column: usize| match from_hex(&table.text(column)).as_deref() {
            Some([]) => Ok(None),
            Some([byte]) => Ok(Some(*byte)),
            _ => Err(table.wrong_field(column, "two hexadecimal digits or nothing are expected")),
        };
        let (sent, received) = (byte(sent)?, byte(received)?);
        let text = table.text(status);
        let error = match (received, text.as_ref()) {
            (None, "dropped") | (Some(_), "ok") => None,
            (Some(_), name) if error_named(name).is_some() => error_named(name),
            _ => return Err(table.wrong_field(status, "it does not fit what was received")),
        };
        let link = assembly.link(ring, from, to);
        link.bytes.push(line_byte(at, sent, received, error));
    }
    assembly.finish([None, None], [Vec::new(), Vec::new()], rate)
}

/// A station: `master` or a number.
fn station(table: &Table<'_>, column: usize) -> Result<Option<u8>, CaptureError> {
    match table.text(column).as_ref() {
        MASTER => Ok(None),
        address => address
            .parse()
            .map(Some)
            .map_err(|_| table.wrong_field(column, "`master` or a number is expected")),
    }
}

/// Reads a table of frames.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn frames(bytes: &[u8]) -> Result<ImportedCapture, CaptureError> {
    let mut table = Table::new(bytes);
    let [time, from, id, remote, dlc, data, ended] = places(&table, FRAMES)?;
    let mut frames = Vec::new();
    while table.next()? {
        let nanos = nanos(&table, time)?;
        let frame = match table.raw(remote) {
            b"1" => format!("{}#R{}", table.text(id), table.text(dlc)),
            _ => format!("{}#{}", table.text(id), table.text(data)),
        };
        let frame: Frame = frame
            .parse()
            .map_err(|bad| table.wrong(format!("`{frame}` is no frame: {bad}")))?;
        let ended = match table.text(ended).as_ref() {
            "" => FrameEnd::Good,
            LOST => FrameEnd::Lost,
            name => FrameEnd::Error(CanError::from_name(name).ok_or_else(|| {
                table.wrong_field(ended, "`lost` or the name of an error is expected")
            })?),
        };
        let sender = Sender::Known(station(&table, from)?);
        frames.push(FrameRead {
            nanos,
            sender,
            frame,
            ended,
            place: Place::of(table.line()),
        });
    }
    Ok(assemble(frames, Counts::Lines, None))
}

/// Reads a table of telegrams. Their octets follow each other without a gap, at the rate that is given or at the bus's usual one.
///
/// # Errors
/// The row and the field that cannot be.
pub(super) fn telegrams(
    bytes: &[u8],
    settings: &ReadSettings,
) -> Result<ImportedCapture, CaptureError> {
    let mut table = Table::new(bytes);
    let [time, from, _, data, error] = places(&table, TELEGRAMS)?;
    let given = settings.uart;
    let mut formats = given.map_or_else(|| line_formats(true), |uart| vec![uart.format]);
    formats.sort_by_key(|format| format.bits_per_second);
    let mut rows = Vec::new();
    while table.next()? {
        let (end, from) = (nanos(&table, time)?, station(&table, from)?);
        let Some(octets) = from_hex(&table.text(data)) else {
            return Err(table.wrong_field(data, "pairs of hexadecimal digits are expected"));
        };
        let text = table.text(error);
        let damaged = match text.split_once(' ') {
            None if text.is_empty() => None,
            Some((name, place)) => error_named(name).zip(place.parse::<usize>().ok()),
            None => None,
        };
        if damaged.is_none() && !text.is_empty() {
            return Err(table.wrong_field(
                error,
                "an error and the number of its octet, such as `parity 3`, are expected",
            ));
        }
        rows.push((end, from, octets, damaged));
    }
    // The slowest rate at which no telegram begins before the one in front of it has ended.
    let apart = |octet: u64| {
        let follows = |two: &[(u64, Option<u8>, Vec<u8>, Option<_>)]| {
            let length = (two[1].2.len() as u64).saturating_mul(octet);
            two[1].0.saturating_sub(two[0].0) + 1 >= length
        };
        rows.windows(2).all(follows)
    };
    let mut times = formats.iter().map(|format| format.octet_time());
    let fastest = times.clone().next_back();
    let fitting = times.find(|octet| apart(octet.as_nanos()));
    let octet = fitting.or(fastest).unwrap_or_default();
    let mut all = Vec::new();
    let stations: Vec<_> = rows.iter().map(|(_, from, ..)| *from).collect();
    for (end, from, octets, damaged) in rows {
        let count = octets.len() as u64;
        for (byte, place) in octets.into_iter().zip(1..) {
            let behind = octet * (count - place);
            let error = damaged.and_then(|(error, at)| (at as u64 == place).then_some(error));
            let octet = PacketOctet {
                nanos: end.saturating_sub(behind.as_nanos()),
                sent: Some(byte),
                received: Some(byte),
                error,
            };
            all.push((from, octet));
        }
    }
    Ok(telegrams::assemble(stations.into_iter(), all, octet).into())
}
