//! A trace as pcapng, for Wireshark and its kin: one interface a link, one packet a byte, link type 250
//! (`LINKTYPE_RTAC_SERIAL`).
//!
//! | block | content |
//! |---|---|
//! | section header | `shb_userappl` drivebench |
//! | interface | `if_name` the link (`98->97`, `2:0->master`), `if_speed` the rate, `if_tsresol` 9: nanoseconds |
//! | packet | the time when the byte's stop bit had passed, since the start, cut off below; 12 bytes of header, the byte |
//!
//! The header of the link type: seconds and microseconds of the same time, the event, the control lines (none), two
//! zeros; all with the high byte first. The events are `DATA_RX_START` for a good byte, `PARITY_ERROR`, `FRAMING_ERROR`,
//! `SERIAL_BREAK_EVENT`, `SERIAL_OVERFLOW_EVENT` for an overrun, and `CAPTURE_DATA_LOST`, without a byte, where nothing
//! arrived. Where the transmitter sent something else than arrived, the packet has a comment: `sent 12` or `sent
//! nothing`. So nothing of the bytes of a trace is lost, and [`crate::capture`] reads them back; what drives remarked is not
//! in it.

use crate::traffic::in_time;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::Instant;
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};
use std::io::Write;

pub const LINK_TYPE: u16 = 250;
/// The length of the header before a byte.
pub const HEADER: usize = 12;
/// The types of blocks.
pub(crate) const SECTION: u32 = 0x0A0D_0D0A;
pub const INTERFACE: u32 = 1;
pub(crate) const STATISTICS: u32 = 5;
pub(crate) const PACKET: u32 = 6;
/// The byte-order magic of a section.
pub(crate) const MAGIC: u32 = 0x1A2B_3C4D;
pub const END: u16 = 0;
pub(crate) const COMMENT: u16 = 1;
pub(crate) const IF_NAME: u16 = 2;
pub(crate) const IF_SPEED: u16 = 8;
pub(crate) const IF_TSRESOL: u16 = 9;
pub(crate) const ISB_STARTTIME: u16 = 2;
pub(crate) const ISB_ENDTIME: u16 = 3;
const USER_APPLICATION: u16 = 4;
/// Nanoseconds: 10 to the power of -9.
pub(crate) const NANOSECONDS: u8 = 9;

/// The event of a byte that arrived well.
pub const RECEIVED: u8 = 0x02;
/// The event of a byte that did not arrive.
pub(crate) const LOST: u8 = 0x05;
/// The events of bytes that arrived damaged.
pub const ERRORS: [(LineError, u8); 4] = [
    (LineError::Framing, 0x07),
    (LineError::Parity, 0x08),
    (LineError::Break, 0x09),
    (LineError::Overrun, 0x0A),
];

/// The event of bytes that arrived with this error.
pub(super) fn event_of(error: LineError) -> u8 {
    let row = ERRORS.iter().find(|(known, _)| *known == error);
    row.map_or(RECEIVED, |(_, event)| *event)
}

/// The error of an event.
pub(crate) fn error_of(event: u8) -> Option<LineError> {
    let row = ERRORS.iter().find(|(_, known)| *known == event);
    row.map(|(error, _)| *error)
}

/// The error with this [name](LineError::name).
pub(crate) fn error_named(name: &str) -> Option<LineError> {
    let mut errors = ERRORS.iter().map(|(error, _)| *error);
    errors.find(|error| error.name() == name)
}

/// Writes one or two rings of a run.
///
/// # Errors
/// Writing fails.
pub fn write(traces: &[Trace], rate: Rate, mut out: impl Write) -> std::io::Result<()> {
    let mut block = Block::default();
    block.section(&mut out)?;
    let mut links: Vec<Channel> = Vec::new();
    for (ring, trace) in traces.iter().enumerate() {
        for link in &trace.channels {
            let speed = u64::from(rate.bits_per_second());
            block.interface(LINK_TYPE, &name(ring, link), Some(speed));
            block.end(&mut out)?;
        }
        if traces.len() > 1 {
            links.extend(trace.channels.iter().cloned());
        }
    }
    let all = match traces {
        [one] => &one.channels,
        _ => &links,
    };
    for (place, index) in in_time(all) {
        packet(&mut block, place, &all[place].octets()[index]);
        block.end(&mut out)?;
    }
    out.flush()
}

/// The packet of a byte of the link with this number.
pub(crate) fn packet(block: &mut Block, link: usize, byte: &LineByte) {
    let event = match byte.received {
        None => LOST,
        Some(_) => byte.error.map_or(RECEIVED, event_of),
    };
    block.begin(PACKET);
    block.put(&u32::try_from(link).unwrap_or(u32::MAX).to_le_bytes());
    header(block, byte.at, event, usize::from(byte.received.is_some()));
    if let Some(byte) = byte.received {
        block.put(&[byte]);
        block.pad();
    }
    if byte.sent != byte.received {
        let comment = match byte.sent {
            Some(sent) => format!("sent {sent:02X}"),
            None => "sent nothing".to_owned(),
        };
        block.option(COMMENT, comment.as_bytes());
        block.option(END, &[]);
    }
}

/// The time and the lengths of a packet with this many bytes after its header, and the header of the link type.
pub fn header(block: &mut Block, at: Instant, event: u8, bytes: usize) {
    let nanos = at.since_start().as_nanos();
    let seconds = u32::try_from(nanos / 1_000_000_000).unwrap_or(u32::MAX);
    let micros = u32::try_from(nanos % 1_000_000_000 / 1_000).unwrap_or(0);
    let length = u32::try_from(HEADER + bytes).unwrap_or(0);
    let [h0, h1, h2, h3, l0, l1, l2, l3] = nanos.to_be_bytes();
    block.put(&[h3, h2, h1, h0, l3, l2, l1, l0]);
    block.put(&length.to_le_bytes());
    block.put(&length.to_le_bytes());
    block.put(&seconds.to_be_bytes());
    block.put(&micros.to_be_bytes());
    block.put(&[event, 0, 0, 0]);
}

/// A link's name, as a scenario writes it.
#[must_use]
pub fn name(ring: usize, link: &Channel) -> String {
    let end = |end: Option<u8>| end.map_or("master".to_owned(), |drive| drive.to_string());
    let prefix = if ring == 0 { "" } else { "2:" };
    format!("{prefix}{}->{}", end(link.from), end(link.to))
}

/// A block that is being written; its length is at both of its ends.
#[derive(Default)]
pub struct Block {
    bytes: Vec<u8>,
}

impl Block {
    /// Writes the header of a section.
    pub fn section(&mut self, out: &mut impl Write) -> std::io::Result<()> {
        self.begin(SECTION);
        self.put(&MAGIC.to_le_bytes());
        self.put(&[1, 0, 0, 0]);
        self.put(&u64::MAX.to_le_bytes());
        self.option(USER_APPLICATION, b"drivebench");
        self.option(END, &[]);
        self.end(out)
    }

    /// Begins the statistics of an interface: when the capture there began and ended, in nanoseconds.
    pub(crate) fn statistics(&mut self, interface: u32, began: u64, ended: u64) {
        let time = |nanos: u64| {
            let [high, low] = [nanos >> 32, nanos & 0xFFFF_FFFF];
            [high, low].map(|half| u32::try_from(half).unwrap_or(0).to_le_bytes())
        };
        self.begin(STATISTICS);
        self.put(&interface.to_le_bytes());
        self.put(time(ended).as_flattened());
        self.option(ISB_STARTTIME, time(began).as_flattened());
        self.option(ISB_ENDTIME, time(ended).as_flattened());
        self.option(END, &[]);
    }

    /// Begins an interface: its link type, its name and, where it is known, its bit rate. Its times are in nanoseconds.
    pub(crate) fn interface(&mut self, link_type: u16, name: &str, speed: Option<u64>) {
        self.begin(INTERFACE);
        self.put(&link_type.to_le_bytes());
        self.put(&[0; 6]);
        self.option(IF_NAME, name.as_bytes());
        if let Some(speed) = speed {
            self.option(IF_SPEED, &speed.to_le_bytes());
        }
        self.option(IF_TSRESOL, &[NANOSECONDS]);
        self.option(END, &[]);
    }

    pub fn begin(&mut self, kind: u32) {
        self.bytes.clear();
        self.put(&kind.to_le_bytes());
        self.put(&[0; 4]);
    }

    pub fn put(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    pub fn pad(&mut self) {
        let length = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(length, 0);
    }

    pub fn option(&mut self, code: u16, value: &[u8]) {
        self.put(&code.to_le_bytes());
        let length = u16::try_from(value.len()).unwrap_or(0);
        self.put(&length.to_le_bytes());
        self.put(value);
        self.pad();
    }

    pub fn end(&mut self, out: &mut impl Write) -> std::io::Result<()> {
        let length = u32::try_from(self.bytes.len() + 4).unwrap_or(u32::MAX);
        self.bytes[4..8].copy_from_slice(&length.to_le_bytes());
        self.put(&length.to_le_bytes());
        out.write_all(&self.bytes)
    }
}
