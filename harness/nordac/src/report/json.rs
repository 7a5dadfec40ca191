//! A trace for tools: `drivebench trace --format json`.
//!
//! The form of the JSON object is fixed by `"schema": 2`: keys may be added, none is taken away or changed.
//!
//! | key | meaning |
//! |---|---|
//! | `bus` | `"nordac"` |
//! | `bytes` | every octet of every station, in order of time |
//! | `telegrams` | octets of one station without a pause between them, in order of time |
//! | `t_ns` | when the stop bit of the octet, or of the telegram's last octet, had passed, in nanoseconds since the start |
//! | `from` | `"master"` or the slave's address |
//! | `sent` | what the station sent; `null` for an octet that a fault put on the line |
//! | `received` | what the other stations read; `null` for an octet that did not arrive |
//! | `error` | `null`, `"parity"`, `"framing"`, `"break"`, `"overrun"` or `"dropped"` |
//! | `bytes` of a telegram | its octets as they arrived |

use harness_bench::bus_name::BusName;
use harness_bench::capture::runs::{octets, said};
use harness_sim::record::Trace;
use serde::{Serialize, Serializer};
use std::io::Write;

pub(crate) const SCHEMA: u32 = 2;

#[derive(Serialize)]
struct Object {
    schema: u32,
    bus: &'static str,
    bytes: Vec<OctetObject>,
    telegrams: Vec<TelegramObject>,
}

#[derive(Serialize)]
struct OctetObject {
    t_ns: u64,
    #[serde(serialize_with = "sender")]
    from: Option<u8>,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<&'static str>,
}

#[derive(Serialize)]
struct TelegramObject {
    t_ns: u64,
    #[serde(serialize_with = "sender")]
    from: Option<u8>,
    bytes: Vec<u8>,
}

fn sender<S: Serializer>(from: &Option<u8>, serializer: S) -> Result<S::Ok, S::Error> {
    match from {
        None => serializer.serialize_str("master"),
        Some(slave) => serializer.serialize_u8(*slave),
    }
}

/// Writes the object.
///
/// # Errors
/// Errors of `out`.
pub(crate) fn write(bus: BusName, traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    let bytes = traces
        .iter()
        .flat_map(octets)
        .map(|(from, octet)| OctetObject {
            t_ns: octet.at.since_start().as_nanos(),
            from,
            sent: octet.sent,
            received: octet.received,
            error: match (octet.received, octet.error) {
                (None, _) => Some("dropped"),
                (Some(_), error) => error.map(|error| error.name()),
            },
        });
    let telegrams = traces.iter().flat_map(said).map(|telegram| TelegramObject {
        t_ns: telegram.at.since_start().as_nanos(),
        from: telegram.from,
        bytes: telegram.octets,
    });
    let object = Object {
        schema: SCHEMA,
        bus: bus.name(),
        bytes: bytes.collect(),
        telegrams: telegrams.collect(),
    };
    serde_json::to_writer(&mut out, &object)?;
    writeln!(out)?;
    out.flush()
}
