//! Captures in pcapng, link types 250 and 227: those of [`crate::report::pcapng`], [`crate::report::pcapng_telegrams`] and
//! [`crate::report::pcapng_frames`], and those of others with one interface a link or a station.
//!
//! Both orders of bytes, every resolution of time, several sections; blocks and options of other kinds are passed over. A
//! packet may hold several bytes: the time is that of the first, the others follow without a gap. Where the first
//! packet is later than a day, times count from a byte time before it.

mod blocks;
mod parts;
mod statistics;
mod values;

pub(super) use values::nanoseconds;

use super::frames::{FrameRead, Sender, assemble, packet};
use super::order::{Counts, Place};
use super::telegrams::{self, DAY};
use super::{Assembly, Capture, CaptureError, Imported, NamedLink, ends, line_byte};
use crate::buses;
use crate::report::pcapng::{
    COMMENT, END, ERRORS, HEADER, IF_NAME, IF_SPEED, IF_TSRESOL, INTERFACE, LINK_TYPE, LOST, MAGIC,
    PACKET, SECTION,
};
use crate::report::pcapng_frames;
use crate::report::pcapng_telegrams::{PacketOctet, octet_time, octets, station};
use harness_proto::can::BitRate;
use harness_proto::line::{BITS_PER_BYTE, LineError, Rate};
use harness_proto::time::Span;
use parts::{Part, chosen};
use statistics::{STATISTICS, listened_to};
use std::borrow::Cow;
use values::{means_loss, noted, sent};

/// Option of an interface: seconds to be added to its times.
const IF_TSOFFSET: u16 = 14;
/// What the name of a shared line begins with.
const LINE: &str = "bus";
/// Events of the link type that carry no byte of the line: a change of the control lines, the end of a capture.
const NO_BYTE: [u8; 2] = [0x00, 0x06];
/// Events of a good byte: sent or received, begun or ended.
const GOOD: std::ops::RangeInclusive<u8> = 0x01..=0x04;
/// The time of an octet on a line that all stations share, where no interface says its rate: that of 500 kbit/s.
const OCTET: Span = Span::from_nanos(2_000 * BITS_PER_BYTE);
/// The most interfaces: two rings of 250 drives, and as many for each of some sections.
const MAX_INTERFACES: usize = 65_536;

struct Interface {
    carries: Carries,
    /// The number of its part.
    part: usize,
    resolution: u8,
    offset: i64,
    /// The time of an octet at its rate.
    octet: Option<Span>,
}

/// What an interface stands for.
#[derive(Clone, Copy)]
enum Carries {
    /// A link of a ring: the ring, and the ends of the link.
    Link(usize, Option<u8>, Option<u8>),
    /// What a station sends on a line that all stations share; `None` is the master.
    Station(Option<u8>),
    /// What all stations send on a line that they share.
    Line,
    /// Frames of a bus.
    Frames(Sender),
}

/// What packets say.
struct Byte {
    interface: usize,
    nanos: u64,
    sent: Option<u8>,
    received: Option<u8>,
    error: Option<LineError>,
}

/// Reads a file; `links` chooses a part where it has several.
pub(crate) fn read(
    bytes: &[u8],
    rate: Option<Rate>,
    links: &[NamedLink],
) -> Result<Imported, CaptureError> {
    let mut reader = Reader::new(bytes);
    let mut offset = 0;
    while offset < bytes.len() {
        offset = reader.block(offset)?;
    }
    let events = std::mem::take(&mut reader.events);
    let imported = finish(reader, rate, links)?;
    let lost = events.iter().any(|own| means_loss(own));
    let mut notes = noted(events);
    notes.extend(imported.notes);
    Ok(Imported {
        lost,
        notes,
        ..imported
    })
}

/// The capture of all packets of one part.
pub(super) fn finish(
    reader: Reader<'_>,
    rate: Option<Rate>,
    links: &[NamedLink],
) -> Result<Imported, CaptureError> {
    if reader.parts.is_empty() {
        return Err(CaptureError::Link {
            place: "the capture".to_owned(),
            what: "no interface is of link type 250 (RTAC serial) or 227 (CAN): captures of a ring have one of the former for each \
                   link, named as in `98->97`, captures of a line that all stations share one for each station, named `master` or `slave 8`"
                .to_owned(),
        });
    }
    let carries = |part: usize| {
        let of = |own: &Byte| {
            let interface = reader.interfaces.get(own.interface);
            interface.is_some_and(|own| own.as_ref().is_some_and(|own| own.part == part))
        };
        reader.octets.iter().any(|own| own.0 == part)
            || reader.frames.iter().any(|own| own.0 == part)
            || reader.found.iter().any(of)
    };
    let wanted = chosen(&reader.parts, carries, links)?;
    let known = reader.interfaces;
    let of_part = || known.iter().flatten().filter(|own| own.part == wanted);
    let octet = of_part().find_map(|own| own.octet).unwrap_or(OCTET);
    let octets = reader.octets.into_iter().filter(|own| own.0 == wanted);
    match &reader.parts[wanted] {
        Part::Ring => {}
        Part::Stations => {
            let senders = of_part().filter_map(|own| match own.carries {
                Carries::Station(station) => Some(station),
                Carries::Link(..) | Carries::Frames(_) | Carries::Line => None,
            });
            let octets = octets.map(|(_, from, own)| (from, own)).collect();
            return Ok(telegrams::assemble(senders, octets, octet).into());
        }
        Part::Line(_) => {
            let mut octets: Vec<_> = octets.map(|(_, _, own)| own).collect();
            octets.sort_by_key(|own| own.nanos);
            let senders = buses::senders(&octets, octet);
            let sent = senders.into_iter().zip(octets).collect();
            return Ok(telegrams::assemble(std::iter::empty(), sent, octet).into());
        }
        Part::Senders | Part::Frames(_) => {
            let frames = reader.frames.into_iter().filter(|own| own.0 == wanted);
            let frames = frames.map(|(_, own)| own).collect();
            return Ok(assemble(frames, Counts::Packets, reader.bit_rate));
        }
    }
    let byte_time = rate.or(reader.speed).unwrap_or_default().byte_time();
    let first = reader.found.iter().map(|byte| byte.nanos).min();
    let base = first
        .filter(|first| *first > DAY)
        .map_or(0, |first| first - byte_time.as_nanos());
    let mut assembly = Assembly::default();
    let link = |interface: &Option<Interface>| match interface.as_ref()?.carries {
        Carries::Link(ring, from, to) => Some((ring, from, to)),
        Carries::Frames(_) | Carries::Station(_) | Carries::Line => None,
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
    let listened = listened.map(|(first, own)| listened_to(own, first, base));
    let rate = rate.or(reader.speed);
    let capture = assembly.finish([None, None], [Vec::new(), Vec::new()], rate)?;
    let capture = Capture {
        listened,
        ..capture
    };
    Ok(capture.into())
}

pub(super) struct Reader<'b> {
    pub(super) bytes: &'b [u8],
    /// The section's numbers have the high byte first.
    pub(super) big: bool,
    /// Of all sections, one behind the other; `None` for those of another link type.
    interfaces: Vec<Option<Interface>>,
    /// The first interface of the present section.
    section: usize,
    /// Packets so far.
    packets: usize,
    speed: Option<Rate>,
    bit_rate: Option<BitRate>,
    found: Vec<Byte>,
    /// Octets with the number of their part and their station.
    octets: Vec<(usize, Option<u8>, PacketOctet)>,
    /// Frames with the number of their part.
    frames: Vec<(usize, FrameRead)>,
    parts: Vec<Part>,
    /// What `capture` has noted beside bytes and frames.
    events: Vec<String>,
    /// When the capture began and ended, in nanoseconds.
    listened: Option<(u64, u64)>,
}

impl<'b> Reader<'b> {
    /// A reader that has read nothing yet.
    pub(super) fn new(bytes: &'b [u8]) -> Self {
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
            frames: Vec::new(),
            parts: Vec::new(),
            events: Vec::new(),
            listened: None,
        }
    }

    /// The number of a part.
    fn part(&mut self, part: Part) -> usize {
        let known = self.parts.iter().position(|own| *own == part);
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

    /// Reads the block at `offset`; says where the next one begins.
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
        let inner = (offset + 8, end - 4);
        match kind {
            SECTION => self.section(inner)?,
            INTERFACE => self.interface(inner)?,
            PACKET => self.packet(inner)?,
            STATISTICS => self.statistics(inner)?,
            _ => {}
        }
        Ok(end)
    }

    fn section(&mut self, (start, end): (usize, usize)) -> Result<(), CaptureError> {
        let major = self.u16(start + 4, end)?;
        if major != 1 {
            return self.wrong(
                start + 4,
                format!("version {major} of pcapng is not known: 1 is expected"),
            );
        }
        self.section = self.interfaces.len();
        Ok(())
    }

    fn interface(&mut self, (start, end): (usize, usize)) -> Result<(), CaptureError> {
        if self.interfaces.len() >= MAX_INTERFACES {
            return self.wrong(start, format!("more than {MAX_INTERFACES} interfaces"));
        }
        let link_type = self.u16(start, end)?;
        if ![LINK_TYPE, pcapng_frames::LINK_TYPE].contains(&link_type) {
            self.interfaces.push(None);
            return Ok(());
        }
        let mut name = None;
        let (mut resolution, mut offset, mut speed) = (6, 0, None);
        self.options((start + 8, end), |code, from, to| {
            match code {
                IF_NAME => name = Some((from, to)),
                IF_TSRESOL => [resolution] = self.take(from, to)?,
                IF_TSOFFSET => offset = self.u64(from, to)?.cast_signed(),
                IF_SPEED => speed = Some(self.u64(from, to)?),
                _ => {}
            }
            Ok(())
        })?;
        let own = |(from, to): (usize, usize)| String::from_utf8_lossy(&self.bytes[from..to]);
        let name = name.map(|place| (place.0, own(place)));
        self.describe((start, link_type), name, (resolution, offset, speed))
    }

    /// An interface of a link type that is read: its place in the file; its name with the place of that; its resolution, offset and speed.
    pub(super) fn describe(
        &mut self,
        (start, link_type): (usize, u16),
        name: Option<(usize, Cow<'_, str>)>,
        (resolution, offset, speed): (u8, i64, Option<u64>),
    ) -> Result<(), CaptureError> {
        if link_type == pcapng_frames::LINK_TYPE {
            let name = name.map_or("".into(), |own| own.1);
            let name = name.trim_end_matches('\0');
            let sender = Sender::named(name);
            let part = self.part(match sender {
                Sender::Known(_) => Part::Senders,
                Sender::ByIdentifier => Part::Frames(name.to_owned()),
            });
            let carries = Carries::Frames(sender);
            let bits = speed.and_then(|speed| u32::try_from(speed).ok());
            self.bit_rate = self
                .bit_rate
                .or(bits.and_then(BitRate::from_bits_per_second));
            self.interfaces.push(Some(Interface {
                carries,
                part,
                resolution,
                offset,
                octet: None,
            }));
            return Ok(());
        }
        let Some((from, text)) = name else {
            return self.wrong(
                start,
                "this interface has no name: a link is expected, such as 98->97",
            );
        };
        let text = text.trim_end_matches('\0');
        let link = ends(text).map(|(ring, from, to)| Carries::Link(ring, from, to));
        let alone = || station(text).map(Carries::Station);
        let line = || text.starts_with(LINE).then_some(Carries::Line);
        let Some(carries) = link.or_else(alone).or_else(line) else {
            let text: String = text.chars().take(40).collect();
            return self.wrong(
                from,
                format!(
                    "{text:?} is neither a link of a ring nor a station: master->K, K->K-1, 0->master, master, slave N or bus is expected"
                ),
            );
        };
        let known = speed.and_then(|speed| u32::try_from(speed).ok());
        self.speed = self.speed.or(known.and_then(Rate::from_bits_per_second));
        let part = match carries {
            Carries::Link(..) => Part::Ring,
            Carries::Station(_) | Carries::Frames(_) => Part::Stations,
            Carries::Line => Part::Line(text.to_owned()),
        };
        let part = self.part(part);
        self.interfaces.push(Some(Interface {
            carries,
            part,
            resolution,
            offset,
            octet: speed.and_then(octet_time),
        }));
        Ok(())
    }

    fn packet(&mut self, (start, end): (usize, usize)) -> Result<(), CaptureError> {
        let number = usize::try_from(self.u32(start, end)?).unwrap_or(usize::MAX);
        let interface = self.section.saturating_add(number);
        let Some(known) = self.interfaces.get(interface) else {
            return self.wrong(start, format!("interface {number} has not been described"));
        };
        let Some(known) = known else { return Ok(()) };
        let ticks =
            u64::from(self.u32(start + 4, end)?) << 32 | u64::from(self.u32(start + 8, end)?);
        let Some(nanos) = nanoseconds(ticks, known.resolution, known.offset) else {
            return self.wrong(
                start + 4,
                "this time is before 1970 or too late for any clock",
            );
        };
        let captured = usize::try_from(self.u32(start + 12, end)?).unwrap_or(usize::MAX);
        self.content((interface, nanos), (start + 20, captured, end))
    }

    /// What a packet holds: of this interface, at this time; where its data begins, how long it is, and where its options end.
    pub(super) fn content(
        &mut self,
        (interface, nanos): (usize, u64),
        (data, captured, end): (usize, usize, usize),
    ) -> Result<(), CaptureError> {
        self.packets += 1;
        let Some(Some(known)) = self.interfaces.get(interface) else {
            return Ok(());
        };
        if let Carries::Frames(sender) = known.carries {
            let part = known.part;
            return self.frame((data, captured, end), (part, nanos), sender);
        }
        if captured < HEADER || captured > end - data.min(end) {
            return self.wrong(data, format!("a packet of {captured} bytes: at least the {HEADER} of its header, and at most its block, are expected"));
        }
        let event = self.bytes[data + 8];
        let payload = data + HEADER..data + captured;
        let station = match known.carries {
            Carries::Station(from) => Some(from),
            Carries::Line => Some(None),
            Carries::Link(..) | Carries::Frames(_) => None,
        };
        if let Some(from) = station {
            let octet = known.octet.unwrap_or(OCTET);
            let from = (known.part, from);
            return self.telegram((data, captured, end), (from, nanos), octet);
        }
        let mut comment = None;
        let mut words = None;
        let options = data + captured.next_multiple_of(4);
        self.options((options, end), |code, from, to| {
            if code == COMMENT {
                comment = sent(&self.bytes[from..to]).or(comment);
                words = Some((from, to));
            }
            Ok(())
        })?;
        if let Some((from, to)) = words.filter(|_| NO_BYTE.contains(&event)) {
            let words = String::from_utf8_lossy(&self.bytes[from..to]);
            self.events.push(words.into_owned());
        }
        self.bytes_of(data + 8, event, payload, (interface, nanos), comment)
    }

    /// The octets of a packet that holds a telegram.
    fn telegram(
        &mut self,
        (data, captured, end): (usize, usize, usize),
        ((part, from), nanos): ((usize, Option<u8>), u64),
        octet: Span,
    ) -> Result<(), CaptureError> {
        let event = self.bytes[data + 8];
        let mut comment = String::new();
        let options = data + captured.next_multiple_of(4);
        self.options((options, end), |code, from, to| {
            if code == COMMENT {
                comment = format!(
                    "{comment}, {}",
                    String::from_utf8_lossy(&self.bytes[from..to])
                );
            }
            Ok(())
        })?;
        if NO_BYTE.contains(&event) {
            let words = comment.trim_start_matches(", ");
            self.events.push(words.to_owned());
            return Ok(());
        }
        let arrived = &self.bytes[data + HEADER..data + captured];
        match octets((event, nanos), arrived, &comment, octet) {
            Ok(octets) => self
                .octets
                .extend(octets.into_iter().map(|own| (part, from, own))),
            Err(what) => return self.wrong(data + 8, what),
        }
        Ok(())
    }

    /// The frame of a packet.
    fn frame(
        &mut self,
        (data, captured, end): (usize, usize, usize),
        (part, nanos): (usize, u64),
        sender: Sender,
    ) -> Result<(), CaptureError> {
        if captured > end - data.min(end) {
            return self.wrong(
                data,
                format!("a packet of {captured} bytes does not fit into its block"),
            );
        }
        let mut comment = None;
        let options = data + captured.next_multiple_of(4);
        self.options((options, end), |code, from, to| {
            if code == COMMENT {
                comment = Some(String::from_utf8_lossy(&self.bytes[from..to]));
            }
            Ok(())
        })?;
        let read = packet(&self.bytes[data..data + captured], comment.as_deref());
        let found = match read {
            Ok(found) => found,
            Err(what) => return self.wrong(data, what),
        };
        let place = Place {
            section: self.section,
            ..Place::of(self.packets)
        };
        if found.is_none() {
            self.events.extend(comment.map(Cow::into_owned));
        }
        self.frames.extend(found.map(|(frame, ended)| {
            let read = FrameRead {
                nanos,
                sender,
                frame,
                ended,
                place,
            };
            (part, read)
        }));
        Ok(())
    }

    /// The bytes that a packet speaks of.
    fn bytes_of(
        &mut self,
        at: usize,
        event: u8,
        payload: std::ops::Range<usize>,
        (interface, nanos): (usize, u64),
        comment: Option<Option<u8>>,
    ) -> Result<(), CaptureError> {
        let mut push = |nanos, received: Option<u8>, error| {
            let sent = comment.unwrap_or(received);
            self.found.push(Byte {
                interface,
                nanos,
                sent,
                received,
                error,
            });
        };
        let payload = &self.bytes[payload];
        let error = ERRORS.iter().find(|(_, own)| *own == event);
        match (event, payload) {
            (LOST, []) => push(nanos, None, None),
            (event, _) if NO_BYTE.contains(&event) => {}
            (event, []) if GOOD.contains(&event) => {}
            (event, [byte]) if GOOD.contains(&event) => push(nanos, Some(*byte), None),
            (event, bytes) if GOOD.contains(&event) && comment.is_none() => {
                let byte_time = self.speed.unwrap_or_default().byte_time();
                let mut behind = harness_proto::time::Span::ZERO;
                for byte in bytes {
                    let at = nanos.saturating_add(behind.as_nanos());
                    self.found.push(Byte {
                        interface,
                        nanos: at,
                        sent: Some(*byte),
                        received: Some(*byte),
                        error: None,
                    });
                    behind = behind + byte_time;
                }
            }
            (_, [byte]) if error.is_some() => push(nanos, Some(*byte), error.map(|(own, _)| *own)),
            // A break without its byte is read as 00 (PARMRK, and every UART).
            (_, []) if error.is_some_and(|(own, _)| *own == LineError::Break) => {
                push(nanos, Some(0), Some(LineError::Break));
            }
            _ => {
                let count = payload.len();
                return self.wrong(
                    at,
                    format!("event {event:02X} with {count} bytes is not one of the line"),
                );
            }
        }
        Ok(())
    }
}
