//! A trace for tools: `drivebench trace --format json` and `--format candump`.
//!
//! The form of the JSON object is fixed by `"schema": 2`: keys may be added, none is taken away or changed.
//!
//! | key | meaning |
//! |---|---|
//! | `bus` | `"unitek"` |
//! | `frames` | every frame on the segment, in order of time; a repetition stands by itself |
//! | `t_ns` | when the last bit of the frame, or of the error frame that ended it, had passed, in nanoseconds since the start |
//! | `id` | the identifier |
//! | `extended` | `true` where the identifier has 29 bits; left out for one of 11 bits |
//! | `remote` | the length that a remote frame asks for; left out for a data frame |
//! | `data` | the data bytes |
//! | `from` | `"master"` or the drive's number |
//! | `fault` | `null`, `"lost"`, or the error that ended the frame: `"error-frame"`, `"no-acknowledge"`, `"bus-off"` |

use harness_bench::bus_name::BusName;
use harness_sim::record::{FrameEnd, LineFrame, Trace};
use serde::{Serialize, Serializer};
use std::io::Write;

pub(crate) const SCHEMA: u32 = 2;

#[derive(Serialize)]
struct Object {
    schema: u32,
    bus: &'static str,
    frames: Vec<FrameObject>,
}

#[derive(Serialize)]
struct FrameObject {
    t_ns: u64,
    id: u32,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extended: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    remote: Option<usize>,
    data: Vec<u8>,
    #[serde(serialize_with = "sender")]
    from: Option<u8>,
    fault: Option<&'static str>,
}

fn sender<S: Serializer>(from: &Option<u8>, serializer: S) -> Result<S::Ok, S::Error> {
    match from {
        None => serializer.serialize_str("master"),
        Some(drive) => serializer.serialize_u8(*drive),
    }
}

fn frames(traces: &[Trace]) -> impl Iterator<Item = &LineFrame> {
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    channels.flat_map(|channel| channel.frames())
}

/// Writes the object.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn write(bus: BusName, traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    let frames = frames(traces).map(|frame| FrameObject {
        t_ns: frame.at.since_start().as_nanos(),
        id: frame.frame.id().number(),
        extended: frame.frame.id().is_extended(),
        remote: frame.frame.is_remote().then(|| frame.frame.dlc()),
        data: frame.frame.data().to_vec(),
        from: frame.from,
        fault: match frame.ended {
            FrameEnd::Good => None,
            FrameEnd::Lost => Some("lost"),
            FrameEnd::Error(error) => Some(error.name()),
        },
    });
    let object = Object {
        schema: SCHEMA,
        bus: bus.name(),
        frames: frames.collect(),
    };
    serde_json::to_writer(&mut out, &object)?;
    writeln!(out)?;
    out.flush()
}

/// Writes the log that candump writes with `-L`, and that canplayer reads: every frame that stations have received, with the time of its
/// last bit in seconds.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn candump(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    for frame in frames(traces).filter(|frame| frame.ended == FrameEnd::Good) {
        let micros = frame.at.since_start().as_nanos() / 1000;
        let (seconds, rest) = (micros / 1_000_000, micros % 1_000_000);
        writeln!(out, "({seconds}.{rest:06}) can0 {}", frame.frame)?;
    }
    out.flush()
}
