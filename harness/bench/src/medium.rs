//! What the ports of a bus carry: octets with a line status, or frames.
//!
//! A port has one medium for life. What is sent goes out as a slice, so that a bus of octets has no enum a byte; what is heard is
//! told apart piece by piece.

use harness_proto::can::{self, BitRate, Frame};
use harness_proto::line::{Format, Rate, Received};
use harness_proto::time::Span;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a port carries, and how fast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Medium {
    /// Octets of an asynchronous line.
    Octets(Format),
    /// Frames of a CAN bus.
    Frames(BitRate),
}

impl Medium {
    #[must_use]
    pub const fn bits_per_second(self) -> u32 {
        match self {
            Self::Octets(format) => format.bits_per_second,
            Self::Frames(rate) => rate.bits_per_second(),
        }
    }

    /// How long an octet takes on the line; zero on a medium of frames.
    #[must_use]
    pub fn octet_time(self) -> Span {
        match self {
            Self::Octets(format) => format.octet_time(),
            Self::Frames(_) => Span::ZERO,
        }
    }

    /// How long this takes on the line, one piece after the other; exact. Zero for pieces of another medium, which it does not carry.
    #[must_use]
    pub fn time_of(self, what: Out<'_>) -> Span {
        match (self, what) {
            (Self::Octets(format), Out::Octets(octets)) => {
                format.octet_time() * octets.len() as u64
            }
            (Self::Frames(rate), Out::Frames(frames)) => {
                rate.time_of(frames.iter().map(Frame::wire_bits).sum())
            }
            _ => Span::ZERO,
        }
    }
}

impl From<Rate> for Medium {
    fn from(rate: Rate) -> Self {
        Self::Octets(rate.into())
    }
}

/// What is sent through a port, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Out<'a> {
    Octets(&'a [u8]),
    Frames(&'a [Frame]),
}

impl<'a> Out<'a> {
    #[must_use]
    pub const fn len(self) -> usize {
        match self {
            Self::Octets(octets) => octets.len(),
            Self::Frames(frames) => frames.len(),
        }
    }

    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The first `count` pieces; all of them where there are fewer.
    #[must_use]
    pub fn first(self, count: usize) -> Self {
        let count = count.min(self.len());
        match self {
            Self::Octets(octets) => Self::Octets(&octets[..count]),
            Self::Frames(frames) => Self::Frames(&frames[..count]),
        }
    }

    /// The octets; none where frames are sent.
    #[must_use]
    pub const fn octets(self) -> &'a [u8] {
        match self {
            Self::Octets(octets) => octets,
            Self::Frames(_) => &[],
        }
    }

    /// The frames; none where octets are sent.
    #[must_use]
    pub const fn frames(self) -> &'a [Frame] {
        match self {
            Self::Octets(_) => &[],
            Self::Frames(frames) => frames,
        }
    }

    #[must_use]
    pub(crate) fn to_pieces(self) -> Pieces {
        match self {
            Self::Octets(octets) => Pieces::Octets(octets.to_vec()),
            Self::Frames(frames) => Pieces::Frames(frames.to_vec()),
        }
    }
}

/// What was sent through a port, kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pieces {
    Octets(Vec<u8>),
    Frames(Vec<Frame>),
}

impl Pieces {
    /// The same to be sent again.
    #[must_use]
    pub fn as_out(&self) -> Out<'_> {
        match self {
            Self::Octets(octets) => Out::Octets(octets),
            Self::Frames(frames) => Out::Frames(frames),
        }
    }
}

/// How a stream tells of line errors.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema, clap::ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
#[schemars(rename = "Marks")]
pub enum ErrorMarks {
    /// Not at all, or by the serial driver.
    #[default]
    #[value(help = "Line errors are not carried")]
    None,
    /// In PARMRK's own coding: FF FF is a good FF, FF 00 x an x with bad parity.
    #[value(help = "As PARMRK does: FF 00 x is the byte x with an error, FF FF is a good FF")]
    InBand,
}

/// What was received at a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeardPiece {
    /// An octet with its line status.
    Octet(Received),
    /// A frame, or what went wrong with one.
    Frame(can::CanEvent),
}

impl HeardPiece {
    /// The octet, if it is one.
    #[must_use]
    pub const fn octet(self) -> Option<Received> {
        match self {
            Self::Octet(octet) => Some(octet),
            Self::Frame(_) => None,
        }
    }

    /// What was heard of frames, if it is that.
    #[must_use]
    pub const fn frame(self) -> Option<can::CanEvent> {
        match self {
            Self::Octet(_) => None,
            Self::Frame(frame) => Some(frame),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 11 bits an octet on the line of the ND21 (ND21 8.3); 77 bits for a frame with three bytes of these values.
    #[test]
    fn times_on_the_line() {
        let octets = Out::Octets(&[0x80; 3]);
        let frame: Frame = "201#3D4000".parse().expect("a frame");
        let frames = [frame; 2];
        let frames = Out::Frames(&frames);
        let line = Medium::from(Rate::Baud38400);
        let can = Medium::Frames(BitRate::K500);
        assert_eq!(line.time_of(octets), Rate::Baud38400.byte_time() * 3);
        assert_eq!(can.time_of(frames), BitRate::K500.bit_time() * 154);
        assert_eq!(
            (line.time_of(frames), can.time_of(octets)),
            (Span::ZERO, Span::ZERO)
        );
    }

    #[test]
    fn the_first_pieces() {
        let bytes = [1, 2, 3];
        assert_eq!(Out::Octets(&bytes).first(2).octets(), [1, 2]);
        assert_eq!(Out::Octets(&bytes).first(9).octets(), bytes);
        assert!(Out::Frames(&[]).first(1).is_empty());
    }
}
