//! Captures in the JSON of `drivebench trace`; unknown keys are ignored.

use crate::capture::{Assembly, Capture, CaptureError, adjacent, end, line_byte};
use harness_proto::line::{LineError, Rate};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::mark::bits;
use harness_sim::record::LineByte;
use harness_sim::record::Remark;
use serde::Deserialize;

#[derive(Deserialize)]
struct Object {
    schema: u32,
    ring: u64,
    links: Vec<LinkObject>,
    #[serde(default)]
    marks: Vec<MarkObject>,
    #[serde(default)]
    second: Option<Box<Object>>,
}

#[derive(Deserialize)]
struct LinkObject {
    from: String,
    to: String,
    bytes: Vec<ByteObject>,
}

#[derive(Deserialize)]
struct ByteObject {
    t_ns: u64,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<Error>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Error {
    Parity,
    Framing,
    Break,
    Overrun,
    Dropped,
}

#[derive(Deserialize)]
struct MarkObject {
    drive: u8,
    byte: u64,
    t_ns: u64,
    kind: String,
    #[serde(default)]
    cause: Option<String>,
}

/// The version of the form.
pub const SCHEMA: u32 = 1;

/// The latest time, in nanoseconds, that a byte may have.
const LATEST: u64 = u64::MAX / 4;

pub fn read(bytes: &[u8], rate: Option<Rate>) -> Result<Capture, CaptureError> {
    let object: Object = serde_json::from_slice(bytes).map_err(|error| CaptureError::At {
        offset: offset(bytes, error.line(), error.column()),
        what: error.to_string(),
    })?;
    let mut assembly = Assembly::default();
    let mut sizes = [None, None];
    let mut marks = [Vec::new(), Vec::new()];
    let mut next = Some(&object);
    let mut ring = 0;
    while let Some(object) = next {
        if ring > 1 {
            return wrong("the third ring", "a bench has one ring or two");
        }
        sizes[ring] = Some(read_ring(object, ring, &mut assembly)?);
        marks[ring] = object.marks.iter().filter_map(mark).collect();
        next = object.second.as_deref();
        ring += 1;
    }
    assembly.finish(sizes, marks, rate)
}

fn wrong<T>(place: impl Into<String>, what: impl Into<String>) -> Result<T, CaptureError> {
    let (place, what) = (place.into(), what.into());
    Err(CaptureError::Link { place, what })
}

fn read_ring(object: &Object, ring: usize, assembly: &mut Assembly) -> Result<u8, CaptureError> {
    let place = format!("ring {}", ring + 1);
    if object.schema != SCHEMA {
        let schema = object.schema;
        return wrong(
            place,
            format!("schema {schema} is not known: 1 is expected"),
        );
    }
    let size = match RingSize::new(object.ring) {
        Ok(size) => size.drives(),
        Err(error) => return wrong(place, error.to_string()),
    };
    for link in &object.links {
        let name = format!("{}->{}", short(&link.from), short(&link.to));
        let (Some(from), Some(to)) = (end(&link.from), end(&link.to)) else {
            return wrong(
                name,
                "an end of a link is `master` or the number of a drive",
            );
        };
        if !adjacent(from, to) {
            return wrong(name, "no link of a ring has these ends (ND21 8.5)");
        }
        let read = assembly.link(ring, from, to);
        if !read.bytes.is_empty() {
            return wrong(name, "this link is given twice");
        }
        for (index, byte) in link.bytes.iter().enumerate() {
            read.bytes
                .push(read_byte(byte).map_err(|what| CaptureError::Link {
                    place: format!("link {name}, byte {}", index + 1),
                    what: what.to_owned(),
                })?);
        }
    }
    Ok(size)
}

fn read_byte(byte: &ByteObject) -> Result<LineByte, &'static str> {
    if byte.t_ns > LATEST {
        return Err("its time is too late for any clock");
    }
    let error = match byte.error {
        None => None,
        Some(Error::Parity) => Some(LineError::Parity),
        Some(Error::Framing) => Some(LineError::Framing),
        Some(Error::Break) => Some(LineError::Break),
        Some(Error::Overrun) => Some(LineError::Overrun),
        Some(Error::Dropped) if byte.received.is_none() => None,
        Some(Error::Dropped) => return Err("it was received, so it was not dropped"),
    };
    if byte.received.is_none() && error.is_some() {
        return Err("nothing was received, so nothing can be wrong with it");
    }
    Ok(line_byte(byte.t_ns, byte.sent, byte.received, error))
}

/// A mark; an unknown one is ignored.
fn mark(object: &MarkObject) -> Option<Remark> {
    const KINDS: [(&str, Marks); 5] = [
        ("detected", Marks::DETECTED),
        ("upstream", Marks::UPSTREAM),
        ("seventeenth", Marks::SEVENTEENTH),
        ("sequence", Marks::SEQUENCE),
        ("recovered", Marks::RECOVERED),
    ];
    let (_, marks) = *KINDS.iter().find(|(kind, _)| *kind == object.kind)?;
    let cause = object.cause.as_deref();
    let named = |error: &BusError| Some(error.name()) == cause;
    Some(Remark {
        station: object.drive,
        piece: object.byte,
        answered_as: None,
        at: Instant::START + Span::from_nanos(object.t_ns.min(LATEST)),
        bits: bits(marks, BusError::ALL.into_iter().find(named)),
    })
}

fn short(text: &str) -> String {
    text.chars().take(20).collect()
}

/// The byte of a text at a line and a column, both counted from 1.
fn offset(bytes: &[u8], line: usize, column: usize) -> usize {
    let before = bytes.split_inclusive(|byte| *byte == b'\n');
    let start: usize = before.take(line.saturating_sub(1)).map(<[u8]>::len).sum();
    (start + column.saturating_sub(1)).min(bytes.len())
}
