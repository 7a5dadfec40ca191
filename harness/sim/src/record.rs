//! The record of a run: everything that the channels of a bus carried, and what its stations remarked.

use harness_proto::can::{CanError, Frame};
use harness_proto::line::{LineError, Received};
use harness_proto::time::{Instant, Span};

/// A byte on a wire, at both of its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineByte {
    /// When its stop bit has passed.
    pub at: Instant,
    /// What the transmitter put on the wire; `None` for a byte that was not sent.
    pub sent: Option<u8>,
    /// What arrived at the receiver; `None` where nothing did. A drive without power reads nothing, but
    /// the byte arrives.
    pub received: Option<u8>,
    /// What the receiver noticed.
    pub error: Option<LineError>,
    /// Whether the byte goes back to one that the master sent, rather than to a time-out.
    pub solicited: bool,
}

impl LineByte {
    /// Creates a byte from an outside observation, for traces of rings that are not simulated.
    #[must_use]
    pub fn seen(
        at: Instant,
        sent: Option<u8>,
        received: Option<u8>,
        error: Option<LineError>,
    ) -> Self {
        Self {
            at,
            sent,
            received,
            error,
            solicited: true,
        }
    }

    /// What arrives at the receiver, if anything does.
    #[must_use]
    pub fn arrival(&self) -> Option<Received> {
        let error = self.error;
        self.received.map(|byte| Received { byte, error })
    }
}

/// A frame on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineFrame {
    /// The station that sent it; `None` for the bench itself.
    pub from: Option<u8>,
    /// When its start bit began.
    pub start: Instant,
    /// When its last bit had passed, or that of the error frame that ended it.
    pub at: Instant,
    /// The frame.
    pub frame: Frame,
    /// How it ended.
    pub ended: FrameEnd,
}

/// How a frame on a bus ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEnd {
    /// The other stations have it.
    Good,
    /// No other station has it, although it was acknowledged.
    Lost,
    /// An error frame ended it.
    Error(CanError),
}

/// Something that a station remarked at a piece that it received.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Remark {
    /// Which station.
    pub station: u8,
    /// At which piece on its inbound channel, counted from 1; at a time-out, the last one before it.
    pub piece: u64,
    /// Which piece on its outbound channel was sent for it, counted from 1.
    pub answered_as: Option<u64>,
    /// When.
    pub at: Instant,
    /// What, in the bus's own bits.
    pub bits: u16,
}

/// What a channel carried, in order. A channel carries one kind for life.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Carried {
    /// Octets, between two stations.
    Octets(Vec<LineByte>),
    /// Frames, from any station to all others.
    Frames(Vec<LineFrame>),
}

/// One channel's part of a trace: a link between two stations, or a segment that all stations share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The station that sends; `None` for the master, and on a segment of frames, which say who sent them. A segment of octets has one
    /// channel for each station that sends.
    pub from: Option<u8>,
    /// The station that receives; `None` for the master, and on a shared segment. Readers of a segment of octets merge its channels by time.
    pub to: Option<u8>,
    /// What it carried.
    pub carried: Carried,
}

impl Channel {
    /// A link of octets between two stations; `None` is the master.
    #[must_use]
    pub const fn of_octets(from: Option<u8>, to: Option<u8>, octets: Vec<LineByte>) -> Self {
        Self {
            from,
            to,
            carried: Carried::Octets(octets),
        }
    }

    /// A segment of frames.
    #[must_use]
    pub const fn of_frames(frames: Vec<LineFrame>) -> Self {
        Self {
            from: None,
            to: None,
            carried: Carried::Frames(frames),
        }
    }

    /// The octets that it carried; none where it carries frames.
    #[must_use]
    pub fn octets(&self) -> &[LineByte] {
        match &self.carried {
            Carried::Octets(octets) => octets,
            Carried::Frames(_) => &[],
        }
    }

    /// The frames that it carried; none where it carries octets.
    #[must_use]
    pub fn frames(&self) -> &[LineFrame] {
        match &self.carried {
            Carried::Octets(_) => &[],
            Carried::Frames(frames) => frames,
        }
    }

    /// The octets that it carried, to be changed; `None` where it carries frames.
    pub const fn octets_mut(&mut self) -> Option<&mut Vec<LineByte>> {
        match &mut self.carried {
            Carried::Octets(octets) => Some(octets),
            Carried::Frames(_) => None,
        }
    }
}

/// Everything that happened at one port of a bus.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trace {
    /// How many stations there are beside the master.
    pub stations: u8,
    /// The channels; those of a ring in its order, from the master's outgoing to its incoming link.
    pub channels: Vec<Channel>,
    /// The remarks in order of time; at one instant, in order of the stations on the bus.
    pub remarks: Vec<Remark>,
    /// Where times do not go on, in order.
    pub seams: Vec<Seam>,
}

/// A place in a trace of frames where times do not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seam {
    /// The first frame behind it, counted from 0.
    pub piece: usize,
    /// What is there.
    pub kind: SeamKind,
}

/// Why times do not go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeamKind {
    /// The clock was set: no frame is missing.
    ClockSet,
    /// A new recording begins: what was on the bus before is not known.
    Recording,
}

impl Trace {
    /// A trace in which nothing happened.
    #[must_use]
    pub fn empty(stations: u8) -> Self {
        Self {
            stations,
            ..Self::default()
        }
    }

    /// Counts all times from `origin` on.
    pub fn count_from(&mut self, origin: Span) {
        if origin == Span::ZERO {
            return;
        }
        let earlier = |at: &mut Instant| *at = *at - origin;
        for channel in &mut self.channels {
            match &mut channel.carried {
                Carried::Octets(octets) => octets.iter_mut().for_each(|byte| earlier(&mut byte.at)),
                Carried::Frames(frames) => frames.iter_mut().for_each(|frame| {
                    earlier(&mut frame.start);
                    earlier(&mut frame.at);
                }),
            }
        }
        self.remarks
            .iter_mut()
            .for_each(|remark| earlier(&mut remark.at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_byte_has_16_bytes() {
        assert_eq!(size_of::<LineByte>(), 16);
    }

    #[test]
    fn a_channel_carries_one_kind() {
        let frames = Channel::of_frames(Vec::new());
        assert_eq!(
            (frames.octets().len(), frames.clone().octets_mut()),
            (0, None)
        );
        let octets = Channel::of_octets(None, Some(0), Vec::new());
        assert_eq!(octets.clone().octets_mut(), Some(&mut Vec::new()));
        assert!(octets.frames().is_empty());
    }

    #[test]
    fn times_are_counted_from_an_origin() {
        let at = |ms| Instant::START + Span::from_millis(ms);
        let frame = LineFrame {
            from: Some(1),
            start: at(4),
            at: at(5),
            frame: Frame::base(0x181, &[1]).expect("a frame"),
            ended: FrameEnd::Good,
        };
        let mut trace = Trace {
            stations: 2,
            channels: vec![
                Channel::of_octets(
                    None,
                    Some(0),
                    vec![LineByte::seen(at(3), Some(1), None, None)],
                ),
                Channel::of_frames(vec![frame]),
            ],
            remarks: vec![Remark {
                station: 1,
                piece: 1,
                answered_as: None,
                at: at(9),
                bits: 1,
            }],
            ..Trace::default()
        };
        trace.count_from(Span::from_millis(3));
        assert_eq!(trace.channels[0].octets()[0].at, at(0));
        let frame = trace.channels[1].frames()[0];
        assert_eq!((frame.start, frame.at), (at(1), at(2)));
        assert_eq!(trace.remarks[0].at, at(6));
    }
}
