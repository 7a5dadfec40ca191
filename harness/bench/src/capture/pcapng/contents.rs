//! What packets hold: octets, telegrams and frames.

use super::interfaces::{Carries, Interface, Packets};
use super::parts::Part;
use super::values::sent;
use super::{Byte, CaptureError, OCTET, Reader};
use crate::capture::frames::{FrameRead, Sender, packet};
use crate::capture::order::Place;
use crate::report::pcapng::{COMMENT, ERRORS, HEADER, LOST, RECEIVED};
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

/// A frame behind a header of Linux: the length of the header, the number of the part, and the identifier as it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cooked {
    packet: Packet,
    header: usize,
    part: usize,
    id: [u8; 4],
    place: Place,
}

impl Reader<'_> {
    /// A packet that holds nothing that is read.
    pub(super) fn pass_over(&mut self, why: &'static str) {
        *self.passed.entry(why).or_default() += 1;
    }

    /// What a packet holds.
    pub(in crate::capture) fn content(&mut self, own: &Packet) -> Result<(), CaptureError> {
        self.packets += 1;
        let Some(known) = self.interfaces.get_mut(own.interface) else {
            return Ok(());
        };
        let Some(known) = known else {
            self.pass_over("their interface carries no link that is read");
            return Ok(());
        };
        if own.captured > own.end - own.data.min(own.end) {
            let what = format!(
                "a packet of {} bytes does not fit into its block",
                own.captured
            );
            return self.wrong(own.data, what);
        }
        let (first, last) = known.heard.unwrap_or((own.nanos, own.nanos));
        known.heard = Some((first.min(own.nanos), last.max(own.nanos)));
        let &mut Interface {
            carries,
            packets,
            part,
            octet,
            ..
        } = known;
        let octet = octet.unwrap_or(OCTET);
        let payload = own.data..own.data + own.captured;
        if own.captured < own.original && !matches!(carries, Carries::Frames(_)) {
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
        .filter(|_| own.captured >= header) else {
            return self.wrong(
                own.data,
                format!(
                    "a packet of {} bytes: at least the {HEADER} of its header are expected",
                    own.captured
                ),
            );
        };
        let arrived = payload.start + header..payload.end;
        match carries {
            Carries::Frames(sender) => self.frame(own, (packets, part), sender),
            Carries::Station(from) => self.telegram(own, (part, from), (event, arrived), octet),
            Carries::Line => self.telegram(own, (part, None), (event, arrived), octet),
            Carries::Link(..) => self.bytes_of(own, event, arrived),
        }
    }

    /// The comments of a packet.
    fn comments(&self, own: &Packet) -> Result<Vec<Cow<'_, [u8]>>, CaptureError> {
        let mut all = Vec::new();
        let options = own.data + own.captured.next_multiple_of(4);
        self.options((options, own.end), |code, from, to| {
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
        match words.filter(|own| !own.is_empty()) {
            Some(words) => self.events.push(words),
            None => self.pass_over("they hold no octet"),
        }
    }

    /// The octets of a packet that holds a telegram.
    fn telegram(
        &mut self,
        own: &Packet,
        (part, from): (usize, Option<u8>),
        (event, arrived): (u8, Range<usize>),
        octet: Span,
    ) -> Result<(), CaptureError> {
        let comments = self.comments(own)?;
        let comments = comments.iter().map(|own| String::from_utf8_lossy(own));
        let comment = comments.collect::<Vec<_>>().join(", ");
        let arrived = &self.bytes[arrived];
        if arrived.is_empty() && event != LOST {
            self.remark(Some(comment));
            return Ok(());
        }
        let timed = time_of(event);
        let begins = timed.unwrap_or(self.begun);
        let found = octets((event, own.nanos), begins, arrived, &comment, octet);
        self.begun = begins;
        let found = found
            .into_iter()
            .map(|octet| (part, from, own.nanos, octet));
        self.octets.extend(found);
        Ok(())
    }

    /// The frame of a packet.
    fn frame(
        &mut self,
        own: &Packet,
        (packets, mut part): (Packets, usize),
        sender: Sender,
    ) -> Result<(), CaptureError> {
        let end = own.data + own.captured;
        let (protocol, header) = match packets {
            Packets::Cooked => (own.data + 14, 16),
            Packets::Cooked2 => (own.data, 20),
            _ => {
                let place = self.place();
                return self.frame_of((own, place), part, sender, &self.bytes[own.data..end]);
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
            let number = self.take(own.data + 4, end).map(u32::from_be_bytes)?;
            part = self.part(Part::Frames(format!("interface {number}")));
        }
        let id = self.take(own.data + header, end)?;
        self.cooked.push(Cooked {
            packet: *own,
            header,
            part,
            id,
            place: self.place(),
        });
        Ok(())
    }

    /// The frames behind headers of Linux. Their identifiers have the order of bytes of the computer that captured them, or that of networks:
    /// the one in which more of them are identifiers of frames with 11 bits, or of frames at all, and else the first.
    pub(super) fn cooked_frames(&mut self) -> Result<(), CaptureError> {
        let cooked = std::mem::take(&mut self.cooked);
        let fitting = |read: fn([u8; 4]) -> u32| {
            let ids = cooked.iter().map(|own| read(own.id));
            let count = |fits: fn(u32) -> bool| ids.clone().filter(|own| fits(*own)).count();
            (count(|own| own <= 0x7FF), count(|own| own >> 29 != 0))
        };
        let (network, other) = (fitting(u32::from_be_bytes), fitting(u32::from_le_bytes));
        let swapped = other > network || other == network && !self.big;
        for own in cooked {
            let packet = &own.packet;
            let data = packet.data + own.header..packet.data + packet.captured;
            let mut data = self.bytes[data].to_vec();
            if swapped && let Some(id) = data.first_chunk_mut::<4>() {
                id.reverse();
            }
            self.frame_of((packet, own.place), own.part, Sender::ByIdentifier, &data)?;
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
        (own, place): (&Packet, Place),
        part: usize,
        sender: Sender,
        data: &[u8],
    ) -> Result<(), CaptureError> {
        let comments = self.comments(own)?;
        let comment = comments.last();
        let comment = comment.map(|own| String::from_utf8_lossy(own).into_owned());
        let read = match packet(data, comment.as_deref()) {
            Ok(found) => found,
            Err(what) => return self.wrong(own.data, what),
        };
        if read.is_none() {
            self.events.extend(comment);
        }
        self.frames.extend(read.map(|(frame, ended)| {
            let nanos = own.nanos;
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
        own: &Packet,
        event: u8,
        arrived: Range<usize>,
    ) -> Result<(), CaptureError> {
        let comments = self.comments(own)?;
        let stated = comments.iter().rev().find_map(|own| sent(own));
        let words = comments
            .last()
            .map(|own| String::from_utf8_lossy(own).into_owned());
        let error = ERRORS
            .iter()
            .find(|(_, own)| *own == event)
            .map(|own| own.0);
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
                interface: own.interface,
                nanos: own.nanos.saturating_add(behind.as_nanos()),
                sent: alone.unwrap_or(*received),
                received: *received,
                error: error.filter(|_| place == 0 && received.is_some()),
            });
            behind = behind + byte_time;
        }
        Ok(())
    }
}
