//! Faults of octets and of telegrams.

use crate::fault::{Flips, LinkFault};
use harness_proto::line::{LineError, Received};
use harness_proto::time::Span;
use std::fmt;

/// What happens to a whole telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TelegramFault {
    /// It is not sent.
    Lost,
    /// It is sent twice.
    Doubled,
    /// It begins this much later.
    Late(Span),
    /// The station sends its former telegram in its place; nothing if there was none.
    Former,
}

impl fmt::Display for TelegramFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lost => f.write_str("lost"),
            Self::Doubled => f.write_str("doubled"),
            Self::Late(span) => write!(f, "delay {span}"),
            Self::Former => f.write_str("former"),
        }
    }
}

/// What happens to an octet or to a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineFault {
    /// To an octet. A delay is a gap: the octets behind it come later as well. From a cut on the station neither sends nor hears.
    Octet(LinkFault),
    /// To a telegram.
    Telegram(TelegramFault),
}

/// A fault and the octet or telegram that it happens to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineFaultAt {
    /// The sender whose octets or telegrams are counted; `None` where those of all stations are.
    pub station: Option<usize>,
    /// Which octet or telegram, counted from 1 in the order in which they begin.
    pub number: u64,
    /// The fault.
    pub fault: LineFault,
}

/// What a receiver notices of inverted bits. Without its start bit an octet is read with a framing error.
pub(super) fn noticed(flips: Flips) -> Option<LineError> {
    if flips.start {
        Some(LineError::Framing)
    } else {
        flips.noticed()
    }
}

/// An octet as it arrives with more bits inverted.
pub(super) fn flipped(octet: Received, flips: Flips) -> Received {
    let error = match (octet.error, noticed(flips)) {
        // Two odd numbers of flips are an even one.
        (Some(LineError::Parity), Some(LineError::Parity)) => None,
        (Some(error), None) => Some(error),
        (_, noticed) => noticed,
    };
    Received {
        byte: octet.byte ^ flips.data,
        error,
    }
}
