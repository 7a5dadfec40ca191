//! The record of a simulated run: every byte on every link, and what the drives remarked.

use harness_proto::line::{LineError, Received};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::Instant;

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

/// Something that a drive remarked at a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Which drive.
    pub drive: u8,
    /// At which byte on its inbound link, counted from 1; at a time-out, the last one before it.
    pub byte: u64,
    /// Which byte on its outbound link was sent for it, counted from 1.
    pub answered_as: Option<u64>,
    /// When.
    pub at: Instant,
    /// What.
    pub marks: Marks,
    /// The error for which the drive is, or last was, in the error mode.
    pub cause: Option<BusError>,
}

/// One link's part of a trace.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkTrace {
    /// The drive that sends; `None` for the master.
    pub from: Option<u8>,
    /// The drive that receives; `None` for the master.
    pub to: Option<u8>,
    /// What it carried, in order.
    pub bytes: Vec<LineByte>,
}

/// Everything that happened in one ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// How many drives the ring has.
    pub drives: u8,
    /// The links in ring order, from the master's outgoing to its incoming one.
    pub links: Vec<LinkTrace>,
    /// The marks in order of time; at one instant, in ring order.
    pub marks: Vec<Mark>,
}
