//! A trace as one JSON object for tools (`drivebench trace --format json`).
//!
//! The form is fixed by `"schema": 1`: keys may be added, none is taken away or changed.
//!
//! | key | meaning |
//! |---|---|
//! | `ring` | how many drives the ring has |
//! | `links` | the links in ring order, from the master's outgoing to its incoming one |
//! | `from`, `to` | the ends of a link: `"master"` or a drive's number |
//! | `bytes` | what the link carried, in order |
//! | `t_ns` | when the byte's stop bit had passed, in nanoseconds since the start, cut off below |
//! | `sent` | what the transmitter put on the wire; `null` for a byte that no transmitter sent |
//! | `received` | what the receiver read after any fault; `null` where nothing arrived |
//! | `error` | `null`, `"parity"`, `"framing"`, `"break"`, `"overrun"` or `"dropped"` |
//! | `marks` | what the drives remarked, in order of time |
//! | `byte` | at which byte of the drive's inbound link, counted from 1 (at a time-out, the last before it) |
//! | `kind` | `detected` (!), `upstream` (*), `seventeenth` (#), `sequence` (@) or `recovered` |
//! | `cause` | for `detected`: `parity`, `framing`, `overrun`, `sync`, `command`, `parameter`, `checksum` or `time-out`; else `null` |
//! | `records` | the cells that the scenario recorded, in order of their beginnings; left out where there are none |
//! | `cell`, `unit` | the cell as the scenario names it, and the unit of its values (empty for bytes without a scale) |
//! | `every_ns` | how often it was noted; `null` where its changes were |
//! | `samples` | what was found: `t_ns`, `raw` (the bytes in hexadecimal digits) and `value` (`null` where they have no meaning) |
//! | `second` | the same object for the second ring, where there is one |

use harness_bench::capture::json::SCHEMA;
use harness_bench::scenario::run::CellRecord;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::Span;
use harness_sim::novobus::mark::Mark as _;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Remark, Trace};
use serde::Serialize;
use std::io::Write;

#[derive(Serialize)]
struct Object<'a> {
    schema: u32,
    ring: u8,
    links: Vec<LinkObject<'a>>,
    marks: Vec<MarkObject>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    records: Vec<RecordObject<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    second: Option<Box<Object<'a>>>,
}

#[derive(Serialize)]
struct LinkObject<'a> {
    from: String,
    to: String,
    #[serde(serialize_with = "bytes")]
    bytes: &'a [LineByte],
}

#[derive(Serialize)]
struct ByteObject {
    t_ns: u64,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<&'static str>,
}

#[derive(Serialize)]
struct MarkObject {
    drive: u8,
    byte: u64,
    t_ns: u64,
    kind: &'static str,
    cause: Option<&'static str>,
}

#[derive(Serialize)]
struct RecordObject<'a> {
    drive: u8,
    cell: &'a str,
    unit: &'static str,
    every_ns: Option<u64>,
    samples: Vec<SampleObject>,
}

#[derive(Serialize)]
struct SampleObject {
    t_ns: u64,
    raw: String,
    value: Option<f64>,
}

/// Writes the traces of one or two rings, and what was recorded there, as a line of JSON.
///
/// # Errors
/// What the writer says.
pub(crate) fn write(
    traces: &[Trace],
    records: &[CellRecord],
    mut out: impl Write,
) -> std::io::Result<()> {
    let of = |ring| records.iter().filter(move |record| record.ring == ring);
    let second = traces
        .get(1)
        .map(|trace| Box::new(object(trace, of(1), None)));
    match traces.first() {
        Some(first) => serde_json::to_writer(&mut out, &object(first, of(0), second))?,
        None => out.write_all(b"null")?,
    }
    out.write_all(b"\n")?;
    out.flush()
}

fn object<'a>(
    trace: &'a Trace,
    records: impl Iterator<Item = &'a CellRecord>,
    second: Option<Box<Object<'a>>>,
) -> Object<'a> {
    Object {
        schema: SCHEMA,
        ring: trace.stations,
        links: trace.channels.iter().map(link).collect(),
        marks: trace.remarks.iter().flat_map(marks).collect(),
        records: records.map(record).collect(),
        second,
    }
}

fn record(record: &CellRecord) -> RecordObject<'_> {
    let samples = record.samples.iter().map(|sample| SampleObject {
        t_ns: sample.at.since_start().as_nanos(),
        raw: CellRecord::raw(sample),
        value: record.value(sample),
    });
    RecordObject {
        drive: record.drive,
        cell: &record.name,
        unit: record.unit(),
        every_ns: record.every.map(Span::as_nanos),
        samples: samples.collect(),
    }
}

fn link(link: &Channel) -> LinkObject<'_> {
    let end = |end: Option<u8>| end.map_or("master".to_owned(), |drive| drive.to_string());
    LinkObject {
        from: end(link.from),
        to: end(link.to),
        bytes: link.octets(),
    }
}

fn bytes<S: serde::Serializer>(bytes: &&[LineByte], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(bytes.iter().map(|byte| ByteObject {
        t_ns: byte.at.since_start().as_nanos(),
        sent: byte.sent,
        received: byte.received,
        error: match (byte.received, byte.error) {
            (None, _) => Some("dropped"),
            (_, error) => error.map(harness_proto::line::LineError::name),
        },
    }))
}

fn marks(mark: &Remark) -> Vec<MarkObject> {
    const KINDS: [(Marks, &str); 5] = [
        (Marks::DETECTED, "detected"),
        (Marks::UPSTREAM, "upstream"),
        (Marks::SEVENTEENTH, "seventeenth"),
        (Marks::SEQUENCE, "sequence"),
        (Marks::RECOVERED, "recovered"),
    ];
    KINDS
        .into_iter()
        .filter(|(kind, _)| mark.marks().contains(*kind))
        .map(|(kind, name)| MarkObject {
            drive: mark.station,
            byte: mark.piece,
            t_ns: mark.at.since_start().as_nanos(),
            kind: name,
            cause: mark
                .cause()
                .filter(|_| kind == Marks::DETECTED)
                .map(harness_proto::novobus::error::BusError::name),
        })
        .collect()
}
