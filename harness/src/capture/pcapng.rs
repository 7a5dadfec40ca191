//! Captures in pcapng, link types 250 and 227: those of [`crate::report::pcapng`], [`crate::report::pcapng_telegrams`] and
//! [`crate::report::pcapng_frames`], and those of others with one interface a link or a station.
//!
//! Both orders of bytes, every resolution of time, several sections; blocks and options of other kinds are passed over. A
//! packet may hold several bytes: the time is that of the first, the others follow without a gap. Where the first
//! packet is later than a day, times count from a byte time before it.

use super::frames::{FrameRead, Sender, assemble, packet};
use super::telegrams::{self, DAY};
use super::{Assembly, Capture, CaptureError, ends, line_byte};
use crate::report::pcapng::{
    COMMENT, END, ERRORS, HEADER, IF_NAME, IF_SPEED, IF_TSRESOL, INTERFACE, LINK_TYPE, LOST, MAGIC,
    NANOSECONDS, PACKET, SECTION,
};
use crate::report::pcapng_frames;
use crate::report::pcapng_telegrams::{PacketOctet, octet_time, octets, station};
use harness_proto::can::BitRate;
use harness_proto::line::{BITS_PER_BYTE, LineError, Rate};
use harness_proto::time::Span;
use std::borrow::Cow;

/// Option of an interface: seconds to be added to its times.
const IF_TSOFFSET: u16 = 14;
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

/// Reads a file.
pub(crate) fn read(bytes: &[u8], rate: Option<Rate>) -> Result<Capture, CaptureError> {
    let mut reader = Reader::new(bytes);
    let mut offset = 0;
    while offset < bytes.len() {
        offset = reader.block(offset)?;
    }
    finish(reader, rate)
}

/// The capture of all packets.
pub(super) fn finish(reader: Reader<'_>, rate: Option<Rate>) -> Result<Capture, CaptureError> {
    let known = reader.interfaces;
    if !known.iter().any(Option::is_some) {
        return Err(CaptureError::Link {
            place: "the capture".to_owned(),
            what: "no interface is of link type 250 (RTAC serial) or 227 (CAN): captures of a ring have one of the former for each \
                   link, named as in `98->97`, captures of a line that all stations share one for each station, named `master` or `slave 8`"
                .to_owned(),
        });
    }
    let is_link = |own: &Interface| matches!(own.carries, Carries::Link(..));
    let is_station = |own: &Interface| matches!(own.carries, Carries::Station(_));
    let links = known.iter().flatten().any(is_link);
    let stations = known.iter().flatten().any(is_station);
    let kinds = [
        (links, "bytes of a ring"),
        (stations, "telegrams of a shared line"),
        (!reader.frames.is_empty(), "frames of CAN"),
    ];
    let mixed: Vec<_> = kinds.iter().filter(|own| own.0).map(|own| own.1).collect();
    if let [one, other, ..] = mixed.as_slice() {
        return Err(CaptureError::Link {
            place: "the capture".to_owned(),
            what: format!("it has {one} and {other}: write them into two files"),
        });
    }
    if stations {
        let own = known.iter().flatten();
        let senders = own.clone().filter_map(|own| match own.carries {
            Carries::Station(station) => Some(station),
            Carries::Link(..) | Carries::Frames(_) => None,
        });
        let octet = own.clone().find_map(|own| own.octet);
        return Ok(telegrams::assemble(
            senders,
            reader.octets,
            octet.unwrap_or(OCTET),
        ));
    }
    if !links {
        return Ok(assemble(reader.frames, reader.bit_rate));
    }
    let byte_time = rate.or(reader.speed).unwrap_or_default().byte_time();
    let first = reader.found.iter().map(|byte| byte.nanos).min();
    let base = first
        .filter(|first| *first > DAY)
        .map_or(0, |first| first - byte_time.as_nanos());
    let mut assembly = Assembly::default();
    let link = |interface: &Option<Interface>| match interface.as_ref()?.carries {
        Carries::Link(ring, from, to) => Some((ring, from, to)),
        Carries::Frames(_) | Carries::Station(_) => None,
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
    assembly.finish(
        [None, None],
        [Vec::new(), Vec::new()],
        rate.or(reader.speed),
    )
}

pub(super) struct Reader<'b> {
    pub(super) bytes: &'b [u8],
    /// The section's numbers have the high byte first.
    pub(super) big: bool,
    /// Of all sections, one behind the other; `None` for those of another link type.
    interfaces: Vec<Option<Interface>>,
    /// The first interface of the present section.
    section: usize,
    speed: Option<Rate>,
    bit_rate: Option<BitRate>,
    found: Vec<Byte>,
    octets: Vec<(Option<u8>, PacketOctet)>,
    frames: Vec<FrameRead>,
}

impl<'b> Reader<'b> {
    /// A reader that has read nothing yet.
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self {
            bytes,
            big: false,
            interfaces: Vec::new(),
            section: 0,
            speed: None,
            bit_rate: None,
            found: Vec::new(),
            octets: Vec::new(),
            frames: Vec::new(),
        }
    }

    pub(super) fn wrong<T>(
        &self,
        offset: usize,
        what: impl Into<String>,
    ) -> Result<T, CaptureError> {
        let what = what.into();
        Err(CaptureError::At { offset, what })
    }

    fn take<const N: usize>(&self, offset: usize, end: usize) -> Result<[u8; N], CaptureError> {
        let bytes = self.bytes.get(offset..offset.saturating_add(N));
        match bytes.and_then(|bytes| <[u8; N]>::try_from(bytes).ok()) {
            Some(bytes) if offset + N <= end => Ok(bytes),
            _ => self.wrong(
                offset,
                format!("{N} bytes are expected here; the file or the block ends before"),
            ),
        }
    }

    fn u16(&self, offset: usize, end: usize) -> Result<u16, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u16::from_be_bytes(bytes)
        } else {
            u16::from_le_bytes(bytes)
        })
    }

    pub(super) fn u32(&self, offset: usize, end: usize) -> Result<u32, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    fn u64(&self, offset: usize, end: usize) -> Result<u64, CaptureError> {
        let bytes = self.take(offset, end)?;
        Ok(if self.big {
            u64::from_be_bytes(bytes)
        } else {
            u64::from_le_bytes(bytes)
        })
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

    /// Calls `each` with every option from `start` on: its code, and where its value begins and ends.
    fn options(
        &self,
        (start, end): (usize, usize),
        mut each: impl FnMut(u16, usize, usize) -> Result<(), CaptureError>,
    ) -> Result<(), CaptureError> {
        let mut at = start;
        while at < end {
            let code = self.u16(at, end)?;
            let length = usize::from(self.u16(at + 2, end)?);
            if code == END {
                return Ok(());
            }
            let value = at + 4;
            if value + length > end {
                return self.wrong(
                    at,
                    format!("an option of {length} bytes does not fit into its block"),
                );
            }
            each(code, value, value + length)?;
            at = value + length.next_multiple_of(4);
        }
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
            let carries = Carries::Frames(Sender::named(name.trim_end_matches('\0')));
            let bits = speed.and_then(|speed| u32::try_from(speed).ok());
            self.bit_rate = self
                .bit_rate
                .or(bits.and_then(BitRate::from_bits_per_second));
            self.interfaces.push(Some(Interface {
                carries,
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
        let Some(carries) = link.or_else(alone) else {
            let text: String = text.chars().take(40).collect();
            return self.wrong(
                from,
                format!(
                    "{text:?} is neither a link of a ring nor a station: master->K, K->K-1, 0->master, master or slave N is expected"
                ),
            );
        };
        let known = speed.and_then(|speed| u32::try_from(speed).ok());
        self.speed = self.speed.or(known.and_then(Rate::from_bits_per_second));
        self.interfaces.push(Some(Interface {
            carries,
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
        let Some(Some(known)) = self.interfaces.get(interface) else {
            return Ok(());
        };
        if let Carries::Frames(sender) = known.carries {
            return self.frame((data, captured, end), nanos, sender);
        }
        if captured < HEADER || captured > end - data.min(end) {
            return self.wrong(data, format!("a packet of {captured} bytes: at least the {HEADER} of its header, and at most its block, are expected"));
        }
        let event = self.bytes[data + 8];
        let payload = data + HEADER..data + captured;
        if let Carries::Station(from) = known.carries {
            let octet = known.octet.unwrap_or(OCTET);
            return self.telegram((data, captured, end), (from, nanos), octet);
        }
        let mut comment = None;
        let options = data + captured.next_multiple_of(4);
        self.options((options, end), |code, from, to| {
            if code == COMMENT {
                comment = sent(&self.bytes[from..to]).or(comment);
            }
            Ok(())
        })?;
        self.bytes_of(data + 8, event, payload, (interface, nanos), comment)
    }

    /// The octets of a packet that holds a telegram.
    fn telegram(
        &mut self,
        (data, captured, end): (usize, usize, usize),
        (from, nanos): (Option<u8>, u64),
        octet: Span,
    ) -> Result<(), CaptureError> {
        let event = self.bytes[data + 8];
        if NO_BYTE.contains(&event) {
            return Ok(());
        }
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
        let arrived = &self.bytes[data + HEADER..data + captured];
        match octets((event, nanos), arrived, &comment, octet) {
            Ok(octets) => self
                .octets
                .extend(octets.into_iter().map(|own| (from, own))),
            Err(what) => return self.wrong(data + 8, what),
        }
        Ok(())
    }

    /// The frame of a packet.
    fn frame(
        &mut self,
        (data, captured, end): (usize, usize, usize),
        nanos: u64,
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
        self.frames.extend(found.map(|(frame, ended)| FrameRead {
            nanos,
            sender,
            frame,
            ended,
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

/// What the transmitter sent, where a comment says so: `sent 12`, `sent nothing`.
fn sent(comment: &[u8]) -> Option<Option<u8>> {
    match comment.strip_prefix(b"sent ")? {
        b"nothing" => Some(None),
        [high, low] => {
            let digit = |c: u8| {
                char::from(c)
                    .to_digit(16)
                    .and_then(|d| u8::try_from(d).ok())
            };
            Some(Some(digit(*high)? << 4 | digit(*low)?))
        }
        _ => None,
    }
}

/// A time in nanoseconds; `None` where it is out of all range. A resolution is a power of 10, or of 2 with its high bit set.
pub(super) fn nanoseconds(ticks: u64, resolution: u8, offset: i64) -> Option<u64> {
    const SECOND: u128 = 1_000_000_000;
    // The most nanoseconds that an `Instant` can hold.
    const MOST: u128 = u64::MAX as u128 / 4;
    let ticks = u128::from(ticks);
    let nanos = if resolution == NANOSECONDS {
        ticks
    } else if resolution & 0x80 == 0 {
        ticks.checked_mul(SECOND)? / 10_u128.checked_pow(u32::from(resolution))?
    } else {
        ticks
            .checked_mul(SECOND)?
            .checked_shr(u32::from(resolution & 0x7F))?
    };
    let offset = i128::from(offset) * 1_000_000_000;
    let nanos = i128::try_from(nanos).ok()?.checked_add(offset)?;
    let nanos = u128::try_from(nanos).ok()?;
    (nanos <= MOST).then(|| u64::try_from(nanos).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions() {
        assert_eq!(nanoseconds(1_500, 6, 0), Some(1_500_000));
        assert_eq!(nanoseconds(1_500, 9, 2), Some(2_000_001_500));
        assert_eq!(nanoseconds(1 << 20, 0x80 | 20, 0), Some(1_000_000_000));
        assert_eq!(nanoseconds(5, 9, -1), None);
        assert_eq!(nanoseconds(u64::MAX, 0, 0), None);
        assert_eq!(nanoseconds(1, 127, 0), None);
    }

    #[test]
    fn comments() {
        assert_eq!(sent(b"sent 1f"), Some(Some(0x1F)));
        assert_eq!(sent(b"sent nothing"), Some(None));
        assert_eq!(sent(b"sent 1"), None);
        assert_eq!(sent(b"look at this"), None);
    }
}
