//! A conversation of frames as a value: what hosts send and what happens to the drives from outside, with the times between.

use crate::language::Unitek;
use harness_bench::explore::line::{LineAct, LineTalk};
use harness_proto::can::Frame;
use harness_sim::unitek::Inputs;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// A conversation of frames.
pub(crate) type FrameTalk = LineTalk<Unitek>;

/// An act of a conversation.
pub(crate) type FrameAct = LineAct<FrameActKind>;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum FrameActKind {
    /// The host sends a frame, as candump writes it.
    #[serde(serialize_with = "write", deserialize_with = "read")]
    Send(Frame),
    /// An input is switched.
    Input {
        drive: u8,
        /// One of [`Inputs::SWITCHES`].
        name: String,
        /// Whether it is active.
        on: bool,
    },
    /// A value of plant or sensors is overruled, or no longer.
    Force {
        drive: u8,
        /// One of [`Inputs::FORCED`].
        name: String,
        raw: Option<u32>,
    },
    /// A drive is switched off and on.
    Restart { drive: u8 },
}

fn write<S: Serializer>(frame: &Frame, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&frame.to_string())
}

fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Frame, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse()
        .map_err(|error| de::Error::custom(format!("`{text}` is no frame: {error}")))
}

impl FrameActKind {
    /// The name of an input or a value, as the simulation knows it.
    #[must_use]
    pub(crate) fn name(&self) -> Option<&'static str> {
        let all = Inputs::SWITCHES.iter().chain(&Inputs::FORCED);
        match self {
            Self::Input { name, .. } | Self::Force { name, .. } => {
                all.copied().find(|known| known == name)
            }
            Self::Send(_) | Self::Restart { .. } => None,
        }
    }
}
