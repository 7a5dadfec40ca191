//! Captures in pcapng, link types 250 and 227: those of [`crate::report::pcapng`], [`crate::report::pcapng_telegrams`] and
//! [`crate::report::pcapng_frames`], and those of others with one interface a link or a station.
//!
//! Both orders of bytes, every resolution of time, several sections; blocks and options of other kinds are ignored. A
//! packet may hold several bytes: the time is that of the first, the others follow without a gap. Where the first
//! packet is later than a day, times count from a byte time before it.

mod blocks;
mod contents;
mod interfaces;
mod parts;
mod statistics;
mod values;

use contents::CookedFrame;
pub(super) use contents::Packet;
pub(super) use interfaces::LINK_TYPES;
pub(super) use values::nanoseconds;

use super::frames::{FrameRead, assemble};
use super::import::unread_octets;
use super::order::Counts;
use super::senders::LineRead;
use super::telegrams::{self, DAY};
use super::{Assembly, Capture, CaptureError, ImportedCapture, NamedLink, line_byte};
use crate::counted::counted;
use crate::report::pcapng::{
    END, IF_NAME, IF_SPEED, IF_TSRESOL, INTERFACE, MAGIC, PACKET, SECTION,
};
use crate::report::pcapng_telegrams::PacketOctet;
use harness_proto::can::BitRate;
use harness_proto::line::{BITS_PER_BYTE, LineError, Rate};
use harness_proto::time::Span;
use interfaces::{Interface, Role};
use parts::{InterfaceGroup, chosen};
use statistics::{STATISTICS, listened_to};
use std::collections::BTreeMap;
use values::{means_loss, noted};

/// Option of an interface: seconds to be added to its times.
const IF_TSOFFSET: u16 = 14;
/// What the name of a shared line begins with.
const LINE: &str = "bus";
/// The time of an octet on a shared line whose rate no interface gives: that of 500 kbit/s.
const OCTET: Span = Span::from_nanos(2_000 * BITS_PER_BYTE);
/// Blocks of packets that no program writes any more where times matter.
const SIMPLE: u32 = 3;
const OBSOLETE: u32 = 2;
/// The most interfaces: two rings of 250 drives, and as many for each of some sections.
const MAX_INTERFACES: usize = 65_536;

/// What packets say.
struct Byte {
    interface: usize,
    nanos: u64,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<LineError>,
}

/// An octet of a shared line.
struct StationOctet {
    part: usize,
    from: Option<u8>,
    /// The time of its packet.
    nanos: u64,
    octet: PacketOctet,
}

/// Reads a file; `links` chooses a part where it has several.
pub fn read(
    bytes: &[u8],
    rate: Option<Rate>,
    links: &[NamedLink],
) -> Result<ImportedCapture, CaptureError> {
    let mut reader = PcapngReader::new(bytes, links);
    let mut offset = 0;
    while offset < bytes.len() {
        offset = reader.block(offset)?;
    }
    finish(reader, rate)
}

/// The capture of all packets of one part, and what was not read.
pub(super) fn finish(
    mut reader: PcapngReader<'_>,
    rate: Option<Rate>,
) -> Result<ImportedCapture, CaptureError> {
    reader.no_twins()?;
    reader.cooked_frames()?;
    let events = std::mem::take(&mut reader.events);
    let lost = events.iter().any(|event| means_loss(event));
    let mut notes = noted(events);
    let passed = std::mem::take(&mut reader.passed);
    for (why, count) in passed {
        notes.push(format!("{} not read: {why}", counted(count, "packet")));
    }
    let cut = reader.cut;
    if cut {
        notes.push(
            "packets were cut when they were captured (snaplen): octets are missing".to_owned(),
        );
    }
    let mut imported = part(reader, rate)?;
    imported.unread = imported
        .unread
        .or(cut.then(|| "packets were cut".to_owned()));
    imported.lost |= lost;
    notes.append(&mut imported.notes);
    Ok(ImportedCapture { notes, ..imported })
}

/// The capture of the part that is wanted.
fn part(reader: PcapngReader<'_>, rate: Option<Rate>) -> Result<ImportedCapture, CaptureError> {
    if reader.parts.is_empty() {
        return Err(CaptureError::Link {
            place: "the capture".to_owned(),
            what: format!(
                "no interface is of a link type that is read: {LINK_TYPES}. Captures of a ring have one of octets for each link, named as in \
                 `98->97`, captures of a line that all stations share one for each station, named `master` or `slave 8`, or one named `bus`"
            ),
        });
    }
    let carries = |part: usize| {
        let of = |byte: &Byte| {
            let known = reader.interfaces.get(byte.interface);
            matches!(known, Some(Some(known)) if known.part == part)
        };
        reader.octets.iter().any(|octet| octet.part == part)
            || reader.frames.iter().any(|(number, _)| *number == part)
            || reader.found.iter().any(of)
    };
    let wanted = chosen(&reader.parts, carries, reader.links)?;
    let known = reader.interfaces;
    let of_part = || known.iter().flatten().filter(|known| known.part == wanted);
    let octet = of_part().find_map(|known| known.octet).unwrap_or(OCTET);
    let octets = reader.octets.into_iter();
    let octets = octets.filter(|octet| octet.part == wanted);
    match &reader.parts[wanted] {
        InterfaceGroup::Ring => {}
        InterfaceGroup::Stations => {
            let senders = of_part().filter_map(|interface| match interface.carries {
                Role::Station(station) => Some(station),
                Role::Link(..) | Role::Frames(_) | Role::Line => None,
            });
            let octets = octets.map(|octet| (octet.from, octet.octet)).collect();
            return Ok(telegrams::assemble(senders, octets, octet).into());
        }
        InterfaceGroup::Line(_) => {
            let mut octets: Vec<_> = octets.collect();
            octets.sort_by_key(|octet| octet.nanos);
            let octets = in_order(octets.into_iter().map(|octet| octet.octet), octet);
            let read = LineRead::of(&octets, octet, true);
            let unread = unread_octets(&read);
            let capture = telegrams::assemble(std::iter::empty(), read.octets, octet);
            return Ok(ImportedCapture {
                notes: read.notes,
                unread,
                ..capture.into()
            });
        }
        InterfaceGroup::Senders | InterfaceGroup::Frames(_) => {
            let frames = reader.frames.into_iter();
            let frames = frames.filter_map(|(number, frame)| (number == wanted).then_some(frame));
            return Ok(assemble(frames.collect(), Counts::Packets, reader.bit_rate));
        }
    }
    let byte_time = rate.or(reader.speed).unwrap_or_default().byte_time();
    let first = reader.found.iter().map(|byte| byte.nanos).min();
    let base = first
        .filter(|first| *first > DAY)
        .map_or(0, |first| first - byte_time.as_nanos());
    let mut assembly = Assembly::default();
    let link = |interface: &Option<Interface>| match interface.as_ref()?.carries {
        Role::Link(ring, from, to) => Some((ring, from, to)),
        Role::Frames(_) | Role::Station(_) | Role::Line => None,
    };
    for (ring, from, to) in known.iter().filter_map(link) {
        assembly.link(ring, from, to);
    }
    // Bytes of one packet and of one link are in order already; other tools may write packets late.
    let mut found = reader.found;
    found.sort_by_key(|byte| byte.nanos);
    for byte in found {
        let Some((ring, from, to)) = known.get(byte.interface).and_then(link) else {
            continue;
        };
        let link = assembly.link(ring, from, to);
        let nanos = byte.nanos - base;
        link.bytes
            .push(line_byte(nanos, byte.sent, byte.received, byte.error));
    }
    let listened = first.zip(reader.listened);
    let listened = listened.map(|(first, heard)| listened_to(heard, first, base));
    let rate = rate.or(reader.speed);
    let capture = assembly.finish([None, None], [Vec::new(), Vec::new()], rate)?;
    let capture = Capture {
        listened,
        ..capture
    };
    Ok(capture.into())
}

/// Octets of packets one after the other: packets of an adapter may be nearer to each other than their octets take.
fn in_order(octets: impl Iterator<Item = PacketOctet>, octet: Span) -> Vec<PacketOctet> {
    let mut before: Option<u64> = None;
    let octets = octets.map(|packet| {
        let least = before.map_or(0, |before| before.saturating_add(octet.as_nanos()));
        // Times are cut off to nanoseconds.
        let overlaps = packet.nanos.saturating_add(1) < least;
        let nanos = if overlaps { least } else { packet.nanos };
        before = Some(nanos);
        PacketOctet { nanos, ..packet }
    });
    octets.collect()
}

pub(super) struct PcapngReader<'b> {
    pub(super) bytes: &'b [u8],
    /// The section's numbers have the high byte first.
    pub(super) big: bool,
    /// Of all sections, one after the other; `None` for those of another link type.
    interfaces: Vec<Option<Interface>>,
    /// The first interface of the present section.
    section: usize,
    packets: usize,
    speed: Option<Rate>,
    bit_rate: Option<BitRate>,
    found: Vec<Byte>,
    octets: Vec<StationOctet>,
    /// Whether the last good packet had the time of its first octet.
    begun: bool,
    /// Frames after headers of Linux.
    cooked: Vec<CookedFrame>,
    /// Frames with the number of their part.
    frames: Vec<(usize, FrameRead)>,
    parts: Vec<InterfaceGroup>,
    /// What `capture` has noted besides bytes and frames.
    events: Vec<String>,
    /// What the user says of interfaces.
    links: &'b [NamedLink],
    /// The interface of the present section for which a link without a channel was taken.
    taken: Option<usize>,
    /// Packets that were not read, by the reason.
    passed: BTreeMap<&'static str, usize>,
    /// Octets of packets were cut off.
    cut: bool,
    /// When the capture began and ended, in nanoseconds.
    listened: Option<(u64, u64)>,
}

impl<'b> PcapngReader<'b> {
    /// A reader that has read nothing yet.
    pub(super) fn new(bytes: &'b [u8], links: &'b [NamedLink]) -> Self {
        Self {
            bytes,
            big: false,
            interfaces: Vec::new(),
            section: 0,
            packets: 0,
            speed: None,
            bit_rate: None,
            found: Vec::new(),
            octets: Vec::new(),
            begun: false,
            cooked: Vec::new(),
            frames: Vec::new(),
            parts: Vec::new(),
            events: Vec::new(),
            links,
            taken: None,
            passed: BTreeMap::new(),
            cut: false,
            listened: None,
        }
    }

    /// The number of a part.
    fn part(&mut self, part: InterfaceGroup) -> usize {
        let known = self.parts.iter().position(|known| *known == part);
        known.unwrap_or_else(|| {
            self.parts.push(part);
            self.parts.len() - 1
        })
    }

    pub(super) fn wrong<T>(
        &self,
        offset: usize,
        what: impl Into<String>,
    ) -> Result<T, CaptureError> {
        let what = what.into();
        Err(CaptureError::At { offset, what })
    }

    /// Reads the block at `offset`. Returns where the next one begins.
    fn block(&mut self, offset: usize) -> Result<usize, CaptureError> {
        let all = self.bytes.len();
        // The type of a section header reads the same in both orders.
        let kind = self.u32(offset, all)?;
        if kind == SECTION {
            let magic: [u8; 4] = self.take(offset + 8, all)?;
            self.big = match magic {
                _ if magic == MAGIC.to_be_bytes() => true,
                _ if magic == MAGIC.to_le_bytes() => false,
                _ => {
                    return self.wrong(
                        offset + 8,
                        "the order of bytes of this section is none: 1A2B3C4D is expected",
                    );
                }
            };
        }
        let length = usize::try_from(self.u32(offset + 4, all)?).unwrap_or(usize::MAX);
        if length < 12 || length % 4 != 0 {
            return self.wrong(
                offset + 4,
                format!("a block of {length} bytes is not possible"),
            );
        }
        let end = offset.saturating_add(length);
        if end > all {
            let left = all - offset;
            return self.wrong(
                offset,
                format!(
                    "the file ends in the middle of a block: {left} of {length} bytes are there"
                ),
            );
        }
        let again = self.u32(end - 4, end)?;
        if usize::try_from(again).ok() != Some(length) {
            return self.wrong(
                end - 4,
                format!("a block of {length} bytes says {again} at its end"),
            );
        }
        let (from, to) = (offset + 8, end - 4);
        match kind {
            SECTION => self.section(from, to)?,
            INTERFACE => self.interface(from, to)?,
            PACKET => self.packet(from, to)?,
            STATISTICS => self.statistics(from, to)?,
            SIMPLE | OBSOLETE => {
                self.cut = true;
                self.pass_over("their blocks are of a kind without a time or interface; save the file anew in Wireshark");
            }
            _ => {}
        }
        Ok(end)
    }

    fn section(&mut self, start: usize, end: usize) -> Result<(), CaptureError> {
        let major = self.u16(start + 4, end)?;
        if major != 1 {
            return self.wrong(
                start + 4,
                format!("version {major} of pcapng is not known: 1 is expected"),
            );
        }
        self.section = self.interfaces.len();
        self.taken = None;
        Ok(())
    }

    fn interface(&mut self, start: usize, end: usize) -> Result<(), CaptureError> {
        if self.interfaces.len() >= MAX_INTERFACES {
            return self.wrong(start, format!("more than {MAX_INTERFACES} interfaces"));
        }
        let link_type = self.u16(start, end)?;
        let mut name = None;
        let (mut resolution, mut offset, mut speed) = (6, 0, None);
        self.options(start + 8, end, |code, from, to| {
            match code {
                IF_NAME => name = Some((from, to)),
                IF_TSRESOL => [resolution] = self.take(from, to)?,
                IF_TSOFFSET => offset = self.u64(from, to)?.cast_signed(),
                IF_SPEED => speed = Some(self.u64(from, to)?),
                _ => {}
            }
            Ok(())
        })?;
        let text = |(from, to): (usize, usize)| String::from_utf8_lossy(&self.bytes[from..to]);
        let name = name.map(|place| (place.0, text(place)));
        self.describe(start, link_type, name, resolution, offset, speed)
    }

    fn packet(&mut self, start: usize, end: usize) -> Result<(), CaptureError> {
        let number = usize::try_from(self.u32(start, end)?).unwrap_or(usize::MAX);
        let interface = self.section.saturating_add(number);
        let Some(known) = self.interfaces.get(interface) else {
            return self.wrong(start, format!("interface {number} has not been described"));
        };
        let (resolution, offset) = match known {
            Some(known) => (known.resolution, known.offset),
            None => (6, 0),
        };
        let ticks =
            u64::from(self.u32(start + 4, end)?) << 32 | u64::from(self.u32(start + 8, end)?);
        let nanos = nanoseconds(ticks, resolution, offset);
        let Some(nanos) = nanos.or(known.is_none().then_some(0)) else {
            return self.wrong(
                start + 4,
                "this time is before 1970 or too late for any clock",
            );
        };
        let length = |at: usize| usize::try_from(self.u32(at, end)?).map_or(Ok(usize::MAX), Ok);
        self.content(&Packet {
            interface,
            nanos,
            data: start + 20,
            captured: length(start + 12)?,
            original: length(start + 16)?,
            end,
        })
    }
}
