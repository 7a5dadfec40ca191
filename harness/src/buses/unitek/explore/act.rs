//! A conversation of frames as a value: what hosts send and what happens to the drives from outside, with the times between.

use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_sim::unitek::Inputs;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Maximum number of acts of a case.
pub(super) const MOST_ACTS: usize = 64;

/// The longest time behind an act, in microseconds.
pub(super) const LONGEST_WAIT: u64 = 2_000_000;

/// The longest case, in microseconds.
const LONGEST_CASE: u64 = 20_000_000;

/// A conversation with the drives of a segment, from their power-up on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameTalk {
    /// The acts, in order.
    pub acts: Vec<FrameAct>,
}

/// An act, and the time behind it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameAct {
    /// What.
    pub what: FrameActKind,
    /// Microseconds until the next act.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub wait_us: u64,
}

fn is_zero(wait: &u64) -> bool {
    *wait == 0
}

/// What can happen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FrameActKind {
    /// The host sends a frame, as candump writes it.
    #[serde(serialize_with = "write", deserialize_with = "read")]
    Send(Frame),
    /// An input is switched.
    Input {
        /// The drive.
        drive: u8,
        /// One of [`Inputs::SWITCHES`].
        name: String,
        /// Whether it is active.
        on: bool,
    },
    /// A value of plant or sensors is overruled, or no longer.
    Force {
        /// The drive.
        drive: u8,
        /// One of [`Inputs::FORCED`].
        name: String,
        /// The raw number.
        raw: Option<u32>,
    },
    /// A drive is switched off and on.
    Restart {
        /// The drive.
        drive: u8,
    },
}

fn write<S: Serializer>(frame: &Frame, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&frame.to_string())
}

fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Frame, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse()
        .map_err(|error| de::Error::custom(format!("`{text}` is no frame: {error}")))
}

impl FrameAct {
    /// An act with this time behind it.
    #[must_use]
    pub const fn new(what: FrameActKind, wait_us: u64) -> Self {
        Self { what, wait_us }
    }

    /// The time behind it.
    #[must_use]
    pub const fn wait(&self) -> Span {
        Span::from_micros(self.wait_us)
    }
}

impl FrameActKind {
    /// The name of an input or a value, as the simulation knows it.
    #[must_use]
    pub fn name(&self) -> Option<&'static str> {
        let all = Inputs::SWITCHES.iter().chain(&Inputs::FORCED);
        match self {
            Self::Input { name, .. } | Self::Force { name, .. } => {
                all.copied().find(|own| own == name)
            }
            Self::Send(_) | Self::Restart { .. } => None,
        }
    }
}

impl FrameTalk {
    /// How many frames are sent.
    #[must_use]
    pub fn frames(&self) -> usize {
        let sent = |act: &&FrameAct| matches!(act.what, FrameActKind::Send(_));
        self.acts.iter().filter(sent).count()
    }

    /// Whether it is within the bounds of a case.
    #[must_use]
    pub fn is_bounded(&self) -> bool {
        let total: u64 = self.acts.iter().map(|act| act.wait_us).sum();
        let named = |act: &FrameAct| match act.what {
            FrameActKind::Input { .. } | FrameActKind::Force { .. } => act.what.name().is_some(),
            FrameActKind::Send(_) | FrameActKind::Restart { .. } => true,
        };
        self.acts.len() <= MOST_ACTS
            && total <= LONGEST_CASE
            && self
                .acts
                .iter()
                .all(|act| act.wait_us <= LONGEST_WAIT && named(act))
    }

    /// What makes a case small: acts, then bytes, then time.
    #[must_use]
    pub fn measure(&self) -> (usize, u64, u64) {
        let bytes = |act: &FrameAct| match &act.what {
            FrameActKind::Send(frame) => {
                let data = frame.data().iter().map(|byte| u64::from(*byte));
                1_000 * frame.dlc() as u64 + data.sum::<u64>()
            }
            _ => 1,
        };
        let total = self.acts.iter().map(bytes).sum();
        let time = self.acts.iter().map(|act| act.wait_us).sum();
        (self.acts.len(), total, time)
    }
}
