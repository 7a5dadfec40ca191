//! What packets hold: octets, telegrams and frames.

use super::interfaces::{Interface, Packets, Role};
use super::parts::InterfaceGroup;
use super::values::sent;
use super::{Byte, CaptureError, OCTET, PcapngReader, StationOctet};
use crate::capture::frames::{self, FrameRead, Sender};
use crate::capture::order::Place;
use crate::report::pcapng::{COMMENT, HEADER, LOST, RECEIVED, error_of};
use crate::report::pcapng_telegrams::{octets, time_of};
use harness_proto::line::LineError;
use harness_proto::time::Span;
use std::borrow::Cow;
use std::ops::Range;

/// The protocol of a frame in a cooked capture, and that of a frame of CAN FD.
const CAN: u16 = 0x000C;
const CAN_FD: u16 = 0x000D;

/// A packet: its interface and its time; where its data begins, how many bytes were captured, how many there were, and where its options end.
#[derive(Clone, Copy, Debug)]
pub(in crate::capture) struct Packet {
    pub(in crate::capture) interface: usize,
    pub(in crate::capture) nanos: u64,
    pub(in crate::capture) data: usize,
    pub(in crate::capture) captured: usize,
    pub(in crate::capture) original: usize,
    pub(in crate::capture) end: usize,
}

/// A frame after a header of Linux (SLL): the length of the header, the number of the part, and the identifier as written.
#[derive(Clone, Copy, Debug)]
pub(super) struct CookedFrame {
    packet: Packet,
    header: usize,
    part: usize,
    id: [u8; 4],
    place: Place,
}

impl PcapngReader<'_> {
    /// A packet that holds nothing that is read.
    pub(super) fn pass_over(&mut self, why: &'static str) {
        *self.passed.entry(why).or_default() += 1;
    }

    /// What a packet holds.
    pub(in crate::capture) fn content(&mut self, packet: &Packet) -> Result<(), CaptureError> {
        self.packets += 1;
        let Some(known) = self.interfaces.get_mut(packet.interface) else {
            return Ok(());
        };
        let Some(known) = known else {
            self.pass_over("their interface carries no link that is read");
            return Ok(());
        };
        if packet.captured > packet.end - packet.data.min(packet.end) {
            let what = format!(
                "a packet of {} bytes does not fit into its block",
                packet.captured
            );
            return self.wrong(packet.data, what);
        }
        let (first, last) = known.heard.unwrap_or((packet.nanos, packet.nanos));
        known.heard = Some((first.min(packet.nanos), last.max(packet.nanos)));
        let &mut Interface {
            carries,
            packets,
            part,
            octet,
            ..
        } = known;
        let octet = octet.unwrap_or(OCTET);
        let payload = packet.data..packet.data + packet.captured;
        if packet.captured < packet.original && !matches!(carries, Role::Frames(_)) {
            self.cut = true;
        }
        let header = match packets {
            Packets::Serial => HEADER,
            _ => 0,
        };
        let Some(event) = (match packets {
            Packets::Serial => self.bytes[payload.clone()].get(8).copied(),
            _ => Some(RECEIVED),
        })
        .filter(|_| packet.captured >= header) else {
            return self.wrong(
                packet.data,
                format!(
                    "a packet of {} bytes: at least the {HEADER} of its header are expected",
                    packet.captured
                ),
            );
        };
        let arrived = payload.start + header..payload.end;
        match carries {
            Role::Frames(sender) => self.frame(packet, packets, part, sender),
            Role::Station(from) => self.telegram(packet, part, from, event, arrived, octet),
            Role::Line => self.telegram(packet, part, None, event, arrived, octet),
            Role::Link(..) => self.bytes_of(packet, event, arrived),
        }
    }

    /// The comments of a packet.
    fn comments(&self, packet: &Packet) -> Result<Vec<Cow<'_, [u8]>>, CaptureError> {
        let mut all = Vec::new();
        let options = packet.data + packet.captured.next_multiple_of(4);
        self.options(options, packet.end, |code, from, to| {
            if code == COMMENT {
                all.push((from, to));
            }
            Ok(())
        })?;
        let all = all.into_iter();
        Ok(all
            .map(|(from, to)| Cow::Borrowed(&self.bytes[from..to]))
            .collect())
    }

    /// A packet without an octet: what its comment says, or a change of the control lines.
    fn remark(&mut self, words: Option<String>) {
        match words.filter(|words| !words.is_empty()) {
            Some(words) => self.events.push(words),
            None => self.pass_over("they hold no octet"),
        }
    }

    /// The octets of a packet that holds a telegram.
    fn telegram(
        &mut self,
        packet: &Packet,
        part: usize,
        from: Option<u8>,
        event: u8,
        arrived: Range<usize>,
        octet: Span,
    ) -> Result<(), CaptureError> {
        let comments = self.comments(packet)?;
        let comments = comments.iter().map(|text| String::from_utf8_lossy(text));
        let comment = comments.collect::<Vec<_>>().join(", ");
        let arrived = &self.bytes[arrived];
        if arrived.is_empty() && event != LOST {
            self.remark(Some(comment));
            return Ok(());
        }
        let timed = time_of(event);
        let begins = timed.unwrap_or(self.begun);
        let found = octets(event, packet.nanos, begins, arrived, &comment, octet);
        self.begun = begins;
        self.octets
            .extend(found.into_iter().map(|octet| StationOctet {
                part,
                from,
                nanos: packet.nanos,
                octet,
            }));
        Ok(())
    }

    /// The frame of a packet.
    fn frame(
        &mut self,
        packet: &Packet,
        packets: Packets,
        mut part: usize,
        sender: Sender,
    ) -> Result<(), CaptureError> {
        let end = packet.data + packet.captured;
        let (protocol, header) = match packets {
            Packets::Cooked => (packet.data + 14, 16),
            Packets::Cooked2 => (packet.data, 20),
            _ => {
                let place = self.place();
                return self.frame_of(packet, place, part, sender, &self.bytes[packet.data..end]);
            }
        };
        match self.take(protocol, end).map(u16::from_be_bytes)? {
            CAN => {}
            CAN_FD => {
                self.pass_over("they are frames of CAN FD");
                return Ok(());
            }
            _ => {
                self.pass_over("they are of other networks than CAN");
                return Ok(());
            }
        }
        if packets == Packets::Cooked2 {
            let number = self.take(packet.data + 4, end).map(u32::from_be_bytes)?;
            part = self.part(InterfaceGroup::Frames(format!("interface {number}")));
        }
        let id = self.take(packet.data + header, end)?;
        self.cooked.push(CookedFrame {
            packet: *packet,
            header,
            part,
            id,
            place: self.place(),
        });
        Ok(())
    }

    /// The frames after headers of Linux. Their identifiers have the order of bytes of the computer that captured them, or that of networks:
    /// the one in which more of them are identifiers of frames with 11 bits, or of frames at all, and else the first.
    pub(super) fn cooked_frames(&mut self) -> Result<(), CaptureError> {
        let cooked = std::mem::take(&mut self.cooked);
        let fitting = |read: fn([u8; 4]) -> u32| {
            let ids = cooked.iter().map(|frame| read(frame.id));
            let count = |fits: fn(u32) -> bool| ids.clone().filter(|id| fits(*id)).count();
            (count(|id| id <= 0x7FF), count(|id| id >> 29 != 0))
        };
        let (network, other) = (fitting(u32::from_be_bytes), fitting(u32::from_le_bytes));
        let swapped = other > network || other == network && !self.big;
        for frame in cooked {
            let packet = &frame.packet;
            let data = packet.data + frame.header..packet.data + packet.captured;
            let mut data = self.bytes[data].to_vec();
            if swapped && let Some(id) = data.first_chunk_mut::<4>() {
                id.reverse();
            }
            let sender = Sender::ByIdentifier;
            self.frame_of(packet, frame.place, frame.part, sender, &data)?;
        }
        Ok(())
    }

    /// The place of the present packet.
    fn place(&self) -> Place {
        Place {
            section: self.section,
            ..Place::of(self.packets)
        }
    }

    fn frame_of(
        &mut self,
        packet: &Packet,
        place: Place,
        part: usize,
        sender: Sender,
        data: &[u8],
    ) -> Result<(), CaptureError> {
        let comments = self.comments(packet)?;
        let comment = comments.last();
        let comment = comment.map(|comment| String::from_utf8_lossy(comment).into_owned());
        let read = match frames::packet(data, comment.as_deref()) {
            Ok(found) => found,
            Err(what) => return self.wrong(packet.data, what),
        };
        if read.is_none() {
            self.events.extend(comment);
        }
        self.frames.extend(read.map(|(frame, ended)| {
            let nanos = packet.nanos;
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

    /// The bytes of a link that a packet speaks of: the first has the time of the packet and its error, the others follow without a gap.
    fn bytes_of(
        &mut self,
        packet: &Packet,
        event: u8,
        arrived: Range<usize>,
    ) -> Result<(), CaptureError> {
        let comments = self.comments(packet)?;
        let stated = comments.iter().rev().find_map(|comment| sent(comment));
        let words = comments
            .last()
            .map(|comment| String::from_utf8_lossy(comment).into_owned());
        let error = error_of(event);
        let received: Vec<Option<u8>> = match &self.bytes[arrived] {
            [] if event == LOST => vec![None],
            // A break without its byte is read as 00 (PARMRK, and every UART).
            [] if error == Some(LineError::Break) => vec![Some(0)],
            bytes => bytes.iter().copied().map(Some).collect(),
        };
        if received.is_empty() {
            self.remark(words);
            return Ok(());
        }
        let byte_time = self.speed.unwrap_or_default().byte_time();
        let mut behind = Span::ZERO;
        for (place, received) in received.iter().enumerate() {
            let alone = stated.filter(|_| place == 0);
            self.found.push(Byte {
                interface: packet.interface,
                nanos: packet.nanos.saturating_add(behind.as_nanos()),
                sent: alone.unwrap_or(*received),
                received: *received,
                error: error.filter(|_| place == 0 && received.is_some()),
            });
            behind = behind + byte_time;
        }
        Ok(())
    }
}
