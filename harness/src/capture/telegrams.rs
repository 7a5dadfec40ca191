//! Captures of a line of octets that all stations share: who sent which octet.

use super::{Capture, line_byte};
use crate::report::pcapng_telegrams::PacketOctet;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::{Channel, LineByte, Trace};
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
    found.sort_by_key(|(_, own)| own.nanos);
    let first = found.first().map_or(0, |(_, own)| own.nanos);
    let base = match first {
        DAY.. => first.saturating_sub(octet.as_nanos()),
        _ => 0,
    };
    let mut sent: BTreeMap<Option<u8>, Vec<LineByte>> = BTreeMap::from([(None, Vec::new())]);
    sent.extend(stations.map(|own| (own, Vec::new())));
    for (from, own) in found {
        let octet = line_byte(own.nanos - base, own.sent, own.received, own.error);
        sent.entry(from).or_default().push(octet);
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
    }
}
