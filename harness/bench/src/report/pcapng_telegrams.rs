//! Telegrams of a shared line of octets as pcapng, link type 250 (`LINKTYPE_RTAC_SERIAL`): one interface a station, one packet a telegram.
//!
//! | block | content |
//! |---|---|
//! | section header | `shb_userappl` drivebench |
//! | interface | `if_name` the station: `master`, `slave 8`; `if_speed` the bit rate, `if_tsresol` 9: nanoseconds |
//! | packet | the time when the last stop bit of the telegram had passed, since the start, cut off below; 12 bytes of header, the octets that arrived |
//!
//! The header is that of [`super::pcapng`]. The events are `DATA_TX_END` for a good telegram of the master, `DATA_RX_END` for one of a slave, and the
//! event of the first line error in a damaged one; `CAPTURE_DATA_LOST`, without octets, where nothing arrived. An octet lasts 11 bits, and there is no
//! gap between octets. What differs is in a comment, with the number of the octet counted from 1: `byte 3 parity`, `byte 3 sent 12`,
//! `byte 3 sent nothing`, `byte 3 lost` for an octet that did not arrive, and `byte 3 after 50000 ns` for the time from the end of the octet before it.
//! So nothing of the octets of a trace is lost, and [`crate::capture`] reads them back.

use super::pcapng::{
    Block, COMMENT, END, LINK_TYPE, LOST, PACKET, error_named, error_of, event_of, header,
};
use harness_proto::line::{BITS_PER_BYTE, LineError};
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write;

/// The events of the last octet of a telegram that the master sent, and that it received.
const SENT: u8 = 0x03;
pub const RECEIVED: u8 = 0x04;
/// The name of the interface of the master, and the prefix of a slave's address.
const MASTER: &str = "master";
const SLAVE: &str = "slave ";
/// The most octets of a packet: what a station sends without a pause is cut after them.
pub const MOST: usize = 255;
/// Times that are as near as this are the same: they are cut off to nanoseconds.
const NEAR: Span = Span::from_nanos(1);

/// Octets of one station, in order; the slave that sent them, or `None` for the master.
pub type SentOctets<'t> = (Option<u8>, &'t [LineByte]);

/// The time of an octet at a rate.
pub fn octet_time(bits_per_second: u64) -> Option<Span> {
    let bit = 3_000_000_000_u64.checked_div(bits_per_second)?;
    Some(Span::from_units(bit.saturating_mul(BITS_PER_BYTE)))
}

/// Writes what stations sent; `bits_per_second` is the rate, where it is known.
///
/// # Errors
/// Writing fails.
pub fn write(
    telegrams: &[SentOctets<'_>],
    bits_per_second: Option<u64>,
    mut out: impl Write,
) -> std::io::Result<()> {
    let mut block = Block::default();
    block.section(&mut out)?;
    let slaves: BTreeSet<u8> = telegrams.iter().filter_map(|(from, _)| *from).collect();
    let senders = std::iter::once(None).chain(slaves.into_iter().map(Some));
    let senders: Vec<Option<u8>> = senders.collect();
    for sender in &senders {
        let name = sender.map_or(MASTER.to_owned(), |slave| format!("{SLAVE}{slave}"));
        block.interface(LINK_TYPE, &name, bits_per_second);
        block.end(&mut out)?;
    }
    let octet = bits_per_second.and_then(octet_time);
    for (from, octets) in telegrams {
        let interface = senders.iter().position(|sender| sender == from);
        for part in octets.chunks(MOST) {
            let good = if from.is_none() { SENT } else { RECEIVED };
            let interface = interface.unwrap_or_default();
            packet(&mut block, interface, good, part, octet);
            block.end(&mut out)?;
        }
    }
    out.flush()
}

/// The packet of octets that followed each other at the interface with this number; the event is that of good octets.
pub(crate) fn packet(
    block: &mut Block,
    interface: usize,
    good: u8,
    octets: &[LineByte],
    octet: Option<Span>,
) {
    let arrived: Vec<u8> = octets.iter().filter_map(|byte| byte.received).collect();
    let damaged = octets.iter().find_map(|byte| byte.received.and(byte.error));
    let event = match damaged {
        _ if arrived.is_empty() => LOST,
        Some(error) => event_of(error),
        None => good,
    };
    let end = octets.last().map_or(Instant::START, |octet| octet.at);
    block.begin(PACKET);
    block.put(&u32::try_from(interface).unwrap_or(0).to_le_bytes());
    header(block, end, event, arrived.len());
    block.put(&arrived);
    block.pad();
    let comment = comment(octets, octet);
    if !comment.is_empty() {
        block.option(COMMENT, comment.as_bytes());
        block.option(END, &[]);
    }
}

/// What differs from octets that arrived as they were sent, one after the other.
fn comment(octets: &[LineByte], octet: Option<Span>) -> String {
    let mut text = String::new();
    let mut before: Option<Instant> = None;
    for (byte, place) in octets.iter().zip(1..) {
        let mut say = |what: &str| {
            let comma = if text.is_empty() { "" } else { ", " };
            // Writing to a String cannot fail.
            let _infallible = write!(text, "{comma}byte {place} {what}");
        };
        let gap = before.map(|before| byte.at.since(before));
        if let Some(gap) = gap.filter(|gap| octet.is_none_or(|octet| !near(*gap, octet))) {
            say(&format!("after {} ns", gap.as_nanos()));
        }
        match (byte.received, byte.error) {
            (None, _) => say("lost"),
            (Some(_), Some(error)) => say(error.name()),
            (Some(_), None) => {}
        }
        if byte.sent != byte.received {
            match byte.sent {
                Some(sent) => say(&format!("sent {sent:02X}")),
                None => say("sent nothing"),
            }
        }
        before = Some(byte.at);
    }
    text
}

fn near(one: Span, other: Span) -> bool {
    one.max(other).saturating_sub(one.min(other)) <= NEAR
}

/// The station with this name of an interface: `Some(None)` is the master. `None` for other names.
pub fn station(name: &str) -> Option<Option<u8>> {
    match name.strip_prefix(SLAVE) {
        Some(address) => address.parse().ok().map(Some),
        None => (name == MASTER).then_some(None),
    }
}

/// What a comment says of an octet.
#[derive(Clone, Copy, Debug, Default)]
struct Remarks {
    lost: bool,
    sent: Option<Option<u8>>,
    error: Option<LineError>,
    after: Option<Span>,
}

/// Reads a comment. Words that are not those of [`comment`] are ignored: people write comments too.
fn remarks(comment: &str) -> BTreeMap<usize, Remarks> {
    let mut all: BTreeMap<usize, Remarks> = BTreeMap::new();
    for item in comment.split(", ") {
        let words: Vec<_> = item.split_whitespace().collect();
        let ["byte", place, what @ ..] = words.as_slice() else {
            continue;
        };
        let place = place.parse().ok();
        let Some(place) = place.filter(|place| (1..=MOST).contains(place)) else {
            continue;
        };
        let remarks = all.entry(place).or_default();
        match what {
            ["lost"] => remarks.lost = true,
            ["sent", "nothing"] => remarks.sent = Some(None),
            ["sent", byte] => remarks.sent = u8::from_str_radix(byte, 16).ok().map(Some),
            ["after", nanos, "ns"] => remarks.after = nanos.parse().ok().map(Span::from_nanos),
            [error] => {
                remarks.error = error_named(error).or(remarks.error);
            }
            _ => {}
        }
    }
    all
}

/// An octet of a packet: its end in nanoseconds since the origin of the capture, and the rest as in [`LineByte`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketOctet {
    pub nanos: u64,
    pub sent: Option<u8>,
    pub received: Option<u8>,
    pub error: Option<LineError>,
}

/// Whether the time of a packet with this event is that of its first octet; `None` where the event says nothing of it. Programs of others
/// write any event with good octets.
pub fn time_of(event: u8) -> Option<bool> {
    (error_of(event).is_none() && event != LOST).then_some(![SENT, RECEIVED].contains(&event))
}

/// The octets of a packet: of its event, its time and whether that is the time of its first octet, the octets that arrived, and its comment.
/// `octet` is the time of one.
pub fn octets(
    event: u8,
    nanos: u64,
    begins: bool,
    arrived: &[u8],
    comment: &str,
    octet: Span,
) -> Vec<PacketOctet> {
    let of_event = error_of(event);
    let remarks = remarks(comment);
    let mut found = pieces(arrived, &remarks);
    // A capture of others names the error in its event alone.
    if let (Some(error), true) = (of_event, found.iter().all(|octet| octet.error.is_none()))
        && let Some(first) = found.iter_mut().find(|octet| octet.received.is_some())
    {
        first.error = Some(error);
    }
    let distance = |place: usize| {
        let after = remarks.get(&place).and_then(|remarks| remarks.after);
        after.unwrap_or(octet)
    };
    let mut end = Span::from_nanos(nanos);
    if begins {
        end = (2..=found.len()).fold(end, |end, place| end + distance(place));
    }
    // Backwards from the end, so that only the time of the packet is cut off.
    for (index, octet) in found.iter_mut().enumerate().rev() {
        octet.nanos = end.as_nanos();
        end = end.saturating_sub(distance(index + 1));
    }
    found
}

/// The octets of a packet without their times: those that arrived, and between them those that were lost.
fn pieces(arrived: &[u8], remarks: &BTreeMap<usize, Remarks>) -> Vec<PacketOctet> {
    let mut left = arrived.iter();
    let mut found = Vec::new();
    for place in 1.. {
        let remarks = remarks.get(&place).copied().unwrap_or_default();
        let received = match remarks.lost {
            true => None,
            false => left.next().copied(),
        };
        if !remarks.lost && received.is_none() {
            break;
        }
        found.push(PacketOctet {
            nanos: 0,
            sent: remarks.sent.unwrap_or(received),
            received,
            error: remarks.error.filter(|_| received.is_some()),
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const BYTE: Span = Span::from_micros(22);

    fn seen(us: u64, sent: Option<u8>, received: Option<u8>, error: Option<LineError>) -> LineByte {
        LineByte::seen(
            Instant::START + Span::from_micros(us),
            sent,
            received,
            error,
        )
    }

    #[test]
    fn what_a_packet_does_not_show_is_in_its_comment() {
        let line = [
            seen(22, Some(0x10), Some(0x10), None),
            seen(44, Some(0x08), Some(0x09), Some(LineError::Parity)),
            seen(66, Some(0x02), None, None),
            seen(100, None, Some(0x49), None),
            seen(122, Some(0x53), Some(0x53), Some(LineError::Framing)),
            seen(144, Some(0x16), Some(0x16), None),
        ];
        let text = comment(&line, Some(BYTE));
        assert_eq!(
            text,
            "byte 2 parity, byte 2 sent 08, byte 3 lost, byte 3 sent 02, byte 4 after 34000 ns, byte 4 sent nothing, byte 5 framing"
        );
        let arrived = [0x10, 0x09, 0x49, 0x53, 0x16];
        let read = octets(0x08, 144_000, false, &arrived, &text, BYTE);
        let expected: Vec<_> = line
            .iter()
            .map(|byte| PacketOctet {
                nanos: byte.at.since_start().as_nanos(),
                sent: byte.sent,
                received: byte.received,
                error: byte.error,
            })
            .collect();
        assert_eq!(read, expected);
        assert_eq!(comment(&line[5..], Some(BYTE)), "");
        // Without a rate every distance is stated.
        assert_eq!(
            comment(&line[4..], None),
            "byte 1 framing, byte 2 after 22000 ns"
        );
    }

    #[test]
    fn packets_of_others() {
        let first = octets(
            0x02,
            22_000,
            true,
            &[0x10, 0x16],
            "my favourite, byte",
            BYTE,
        );
        let nanos: Vec<_> = first.iter().map(|octet| octet.nanos).collect();
        assert_eq!(nanos, [22_000, 44_000]);
        let damaged = octets(0x08, 44_000, false, &[0x10, 0x16], "", BYTE);
        assert_eq!(damaged[0].error, Some(LineError::Parity));
        // Some programs write one event, and not one that says anything, in front of all octets.
        for event in [0x00, 0x06, 0x77] {
            assert_eq!(time_of(event), Some(true));
            assert_eq!(octets(event, 22_000, true, &[0x10, 0x16], "", BYTE), first);
        }
        // Numbers that no octet has.
        let odd = octets(
            0x04,
            10,
            false,
            &[0x10],
            "byte 0 lost, byte 9 lost, byte 999999 lost",
            BYTE,
        );
        assert_eq!(odd.len(), 1);
    }

    #[test]
    fn stations_by_name() {
        assert_eq!(station("master"), Some(None));
        assert_eq!(station("slave 8"), Some(Some(8)));
        assert_eq!(station("slave 999"), None);
        assert_eq!(station("98->97"), None);
    }
}
