//! Captures in pcap, the format before pcapng: one interface without a name, times in microseconds or nanoseconds.

use super::pcapng::{LINK_TYPES, Packet, PcapngReader, finish, nanoseconds};
use super::{CaptureError, ImportedCapture, NamedLink};
use crate::report::pcapng::NANOSECONDS;
use harness_proto::line::Rate;

/// The first bytes with the low byte first, and the resolution of times as in pcapng; the other order of bytes is possible too.
const MAGIC: [(u32, u8); 2] = [(0xA1B2_C3D4, 6), (0xA1B2_3C4D, NANOSECONDS)];
/// The lengths of the header of a file and of a packet.
const FILE: usize = 24;
const PACKET: usize = 16;

/// Whether the high byte is first, and the resolution of times.
fn kind(bytes: &[u8]) -> Option<(bool, u8)> {
    let first: [u8; 4] = bytes.get(..4)?.try_into().ok()?;
    MAGIC.iter().find_map(|(magic, resolution)| match first {
        _ if first == magic.to_le_bytes() => Some((false, *resolution)),
        _ if first == magic.to_be_bytes() => Some((true, *resolution)),
        _ => None,
    })
}

/// Whether a file is a pcap.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    kind(bytes).is_some()
}

/// Reads a file. `links` say what the interface is, if it carries octets.
///
/// # Errors
/// What cannot be, and where.
pub(super) fn read(
    bytes: &[u8],
    rate: Option<Rate>,
    links: &[NamedLink],
) -> Result<ImportedCapture, CaptureError> {
    let mut reader = PcapngReader::new(bytes, links);
    let Some((big, resolution)) = kind(bytes) else {
        return reader.wrong(0, "no magic number of pcap is here");
    };
    reader.big = big;
    let all = bytes.len();
    // The upper bits say how long the check sequence of a network is.
    let link_type = reader.u32(20, all)? & 0xFFFF;
    let link_type = u16::try_from(link_type).unwrap_or(u16::MAX);
    reader.describe(20, link_type, None, resolution, 0, None)?;
    if !reader.reads_any() {
        let what = format!(
            "link type {link_type} is not read with these settings; {LINK_TYPES} are expected"
        );
        return reader.wrong(20, what);
    }
    let mut at = FILE;
    while at < all {
        let seconds = u64::from(reader.u32(at, all)?);
        let part = u64::from(reader.u32(at + 4, all)?);
        let second = 10_u64.pow(u32::from(resolution));
        let ticks = seconds * second + part;
        let Some(nanos) = nanoseconds(ticks, resolution, 0) else {
            return reader.wrong(at, "this time is too late for any clock");
        };
        let length = |at: usize| usize::try_from(reader.u32(at, all)?).map_or(Ok(usize::MAX), Ok);
        let (captured, original) = (length(at + 8)?, length(at + 12)?);
        let data = at + PACKET;
        let end = data.saturating_add(captured);
        if end > all {
            let there = all.saturating_sub(data);
            return reader.wrong(
                at,
                format!(
                    "the file ends in the middle of a packet: {there} of {captured} bytes are there"
                ),
            );
        }
        reader.content(&Packet {
            interface: 0,
            nanos,
            data,
            captured,
            original,
            end,
        })?;
        at = end;
    }
    finish(reader, rate)
}
