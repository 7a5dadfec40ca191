//! Captures of a line of octets that all stations share: who sent which octet.

use super::{Capture, CaptureError, line_byte};
use crate::report::pcapng::error_named;
use crate::report::pcapng_frames::MASTER;
use crate::report::pcapng_telegrams::PacketOctet;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::{Channel, LineByte, Trace};
use serde::Deserialize;
use std::collections::BTreeMap;

/// The longest time, in nanoseconds, that is one since the start, and not one since 1970: a day.
pub(super) const DAY: u64 = 86_400_000_000_000;

/// The capture: a channel for each station, that of the master first. Where the first octet is later than a day, times count from an octet
/// before it; `octet` is the time of one.
pub(super) fn assemble(
    stations: impl Iterator<Item = Option<u8>>,
    mut found: Vec<(Option<u8>, PacketOctet)>,
    octet: Span,
) -> Capture {
    found.sort_by_key(|(_, octet)| octet.nanos);
    let first = found.first().map_or(0, |(_, octet)| octet.nanos);
    let base = match first {
        DAY.. => first.saturating_sub(octet.as_nanos()),
        _ => 0,
    };
    let mut sent: BTreeMap<Option<u8>, Vec<LineByte>> = BTreeMap::from([(None, Vec::new())]);
    sent.extend(stations.map(|station| (station, Vec::new())));
    for (from, octet) in found {
        let byte = line_byte(octet.nanos - base, octet.sent, octet.received, octet.error);
        sent.entry(from).or_default().push(byte);
    }
    let slaves = u8::try_from(sent.len() - 1).unwrap_or(u8::MAX);
    let channels = sent.into_iter();
    let channels = channels.map(|(from, octets)| Channel::of_octets(from, None, octets));
    Capture {
        rate: Rate::default(),
        traces: vec![Trace {
            channels: channels.collect(),
            ..Trace::empty(slaves)
        }],
        listened: None,
        timed: true,
    }
}

/// The latest time, in nanoseconds, that an octet may have: a year.
pub(super) const LATEST: u64 = 365 * DAY;

#[derive(Deserialize)]
struct Object {
    bytes: Vec<OctetObject>,
}

#[derive(Deserialize)]
struct OctetObject {
    t_ns: u64,
    from: serde_json::Value,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<String>,
}

impl OctetObject {
    fn read(&self) -> Result<(Option<u8>, PacketOctet), String> {
        if self.t_ns > LATEST {
            return Err("its time is too late for any clock".to_owned());
        }
        let from = match &self.from {
            serde_json::Value::String(name) if name == MASTER => None,
            other => {
                let address = other.as_u64().and_then(|number| u8::try_from(number).ok());
                Some(address.ok_or_else(|| {
                    format!("`{other}` is no station: `{MASTER}` or an address expected")
                })?)
            }
        };
        let error = match (self.received, self.error.as_deref()) {
            (None, Some("dropped")) | (Some(_), None) => None,
            (Some(_), Some(name)) => {
                let error = error_named(name);
                Some(error.ok_or_else(|| format!("`{name}` is no error of a line"))?)
            }
            (None, _) => return Err("nothing was received, so it was dropped".to_owned()),
        };
        let octet = PacketOctet {
            nanos: self.t_ns,
            sent: self.sent,
            received: self.received,
            error,
        };
        Ok((from, octet))
    }
}

/// Whether a JSON text is a trace of a line that all stations share.
pub(super) fn is_json(bytes: &[u8]) -> bool {
    let start = bytes.get(..200).unwrap_or(bytes);
    let start: String = String::from_utf8_lossy(start).split_whitespace().collect();
    start.contains("\"schema\":2") && start.contains("\"bytes\"")
}

/// Reads the JSON of a trace of such a line, schema 2.
///
/// # Errors
/// What is wrong, and at which octet.
pub(super) fn json(bytes: &[u8]) -> Result<Capture, CaptureError> {
    let object: Object = serde_json::from_slice(bytes).map_err(|error| CaptureError::Link {
        place: format!("line {}, column {}", error.line(), error.column()),
        what: format!("{error}"),
    })?;
    let octets = object.bytes.iter().enumerate().map(|(number, byte)| {
        byte.read().map_err(|what| CaptureError::Link {
            place: format!("byte {}", number + 1),
            what,
        })
    });
    let octets = octets.collect::<Result<_, _>>()?;
    Ok(assemble(std::iter::empty(), octets, Span::ZERO))
}
