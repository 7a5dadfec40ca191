//! How frames of a drive can differ.

use serde::{Deserialize, Serialize};

/// How drives differ from the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum FrameSymptom {
    Value,
    Length,
    /// A frame names another register, or has another identifier.
    Name,
    Missing,
    Unasked,
    Time,
}

impl FrameSymptom {
    #[must_use]
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Value => "other contents",
            Self::Length => "another length",
            Self::Name => "another register or identifier",
            Self::Missing => "no frame",
            Self::Unasked => "a frame that nothing asks for",
            Self::Time => "another time",
        }
    }
}
