//! Frames of CAN as pcapng, link type 227 (`LINKTYPE_CAN_SOCKETCAN`): one interface a sender, one packet a frame.
//!
//! | block | content |
//! |---|---|
//! | section header | `shb_userappl` drivebench |
//! | interface | `if_name` the sender: `master`, `drive 1`; `if_speed` the bit rate, `if_tsresol` 9: nanoseconds |
//! | packet | the time when the last bit of the frame had passed, since the start, cut off below; 8 bytes of header, the data |
//!
//! The header of the link type: the identifier with flags for 29 bits, remote and error frames, high byte first; the length; three zeros.
//! A remote frame has as many zeros after it as it asks for bytes, as a capture of Linux has. An error frame has its class as identifier,
//! and a comment that names the frame which it ended: `error-frame 201#3D4000`. A frame that no station has got has the comment `lost`.
//! So nothing of the frames of a trace is lost, and [`crate::capture`] reads them back.

use super::pcapng::{Block, COMMENT, END, PACKET};
use crate::frames::socketcand::class;
pub use crate::frames::socketcand::flag::{ERROR, EXTENDED, REMOTE};
use harness_proto::can::{BitRate, CanError, MAX_DATA};
use harness_sim::record::{FrameEnd, LineFrame, Trace};
use std::collections::BTreeSet;
use std::io::Write;

pub const LINK_TYPE: u16 = 227;
/// The length of the header before the data.
pub const HEADER: usize = 8;
/// The comment of a frame that no station has got.
pub(crate) const LOST: &str = "lost";
/// The name of the interface of the bench's own frames, and the prefix of a drive's number.
pub const MASTER: &str = "master";
pub const DRIVE: &str = "drive ";

/// The class of an error frame.
const fn class_of(error: CanError) -> u32 {
    match error {
        CanError::ErrorFrame => class::PROTOCOL | class::BUS_ERROR,
        CanError::NoAcknowledge => class::NO_ACKNOWLEDGE,
        CanError::BusOff => class::BUS_OFF,
    }
}

/// Writes the frames of a run.
///
/// # Errors
/// Writing fails.
pub fn write(traces: &[Trace], mut out: impl Write) -> std::io::Result<()> {
    let mut block = Block::default();
    block.section(&mut out)?;
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let mut frames: Vec<&LineFrame> = channels.flat_map(|channel| channel.frames()).collect();
    // Equal times stay in their order.
    frames.sort_by_key(|frame| frame.at);
    let senders: BTreeSet<Option<u8>> = frames.iter().map(|frame| frame.from).collect();
    let senders: Vec<Option<u8>> = std::iter::once(None)
        .chain(senders.into_iter().flatten().map(Some))
        .collect();
    let rate = frames.iter().find_map(|frame| rate_of(frame));
    let speed = rate.map(|rate| u64::from(rate.bits_per_second()));
    for sender in &senders {
        let name = sender.map_or(MASTER.to_owned(), |drive| format!("{DRIVE}{drive}"));
        block.interface(LINK_TYPE, &name, speed);
        block.end(&mut out)?;
    }
    for frame in frames {
        let interface = senders.iter().position(|sender| *sender == frame.from);
        packet(&mut block, interface.unwrap_or_default(), frame);
        block.end(&mut out)?;
    }
    out.flush()
}

/// The rate at which this frame has its duration.
pub fn rate_of(frame: &LineFrame) -> Option<BitRate> {
    let lasted = frame.at.since(frame.start).units();
    let bits = frame.frame.wire_bits();
    let fits = |rate: &BitRate| {
        let bit = rate.bit_time().units();
        // With or without the intermission.
        let bits = u64::from(bits);
        lasted <= bit * bits && lasted >= bit * (bits - 3)
    };
    let known = [1000, 800, 625, 500, 250, 125, 100, 50, 20, 10];
    let mut rates = known
        .into_iter()
        .filter_map(|kilobits| BitRate::from_bits_per_second(kilobits * 1000));
    rates.find(|rate| frame.ended == FrameEnd::Good && fits(rate))
}

/// The packet of a frame that the sender with this number sent.
pub(crate) fn packet(block: &mut Block, interface: usize, carried: &LineFrame) {
    let frame = &carried.frame;
    let mut data = [0; HEADER + MAX_DATA];
    let mut id = frame.id().number();
    let mut len = frame.dlc();
    let mut comment = None;
    if frame.id().is_extended() {
        id |= EXTENDED;
    }
    if frame.is_remote() {
        id |= REMOTE;
    }
    data[HEADER..HEADER + frame.data().len()].copy_from_slice(frame.data());
    match carried.ended {
        FrameEnd::Good => {}
        FrameEnd::Lost => comment = Some(LOST.to_owned()),
        FrameEnd::Error(error) => {
            id = ERROR | class_of(error);
            len = MAX_DATA;
            data = [0; HEADER + MAX_DATA];
            comment = Some(format!("{error} {frame}"));
        }
    }
    data[..4].copy_from_slice(&id.to_be_bytes());
    data[4] = len as u8;
    let nanos = carried.at.since_start().as_nanos();
    raw(block, interface, nanos, &data[..HEADER + len], comment);
}

/// The packet of an error frame of which is not known what it ended, or of something else that happened, in words.
pub fn event(block: &mut Block, interface: usize, nanos: u64, words: &str) {
    let mut data = [0; HEADER + MAX_DATA];
    data[..4].copy_from_slice(&(ERROR | class::BUS_ERROR).to_be_bytes());
    data[4] = MAX_DATA as u8;
    raw(block, interface, nanos, &data, Some(words.to_owned()));
}

fn raw(block: &mut Block, interface: usize, nanos: u64, data: &[u8], comment: Option<String>) {
    let length = u32::try_from(data.len()).unwrap_or(0);
    block.begin(PACKET);
    block.put(&u32::try_from(interface).unwrap_or(0).to_le_bytes());
    block.put(&((nanos >> 32) as u32).to_le_bytes());
    block.put(&(nanos as u32).to_le_bytes());
    block.put(&length.to_le_bytes());
    block.put(&length.to_le_bytes());
    block.put(data);
    block.pad();
    if let Some(comment) = comment {
        block.option(COMMENT, comment.as_bytes());
        block.option(END, &[]);
    }
}
