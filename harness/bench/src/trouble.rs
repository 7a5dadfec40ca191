//! Why a link or a port carries nothing more.

use std::fmt;

/// Why a link carries nothing more. This is permanent: what is sent from then on is dropped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The guard has denied a byte: what the bench does not allow never reaches a wire. The text names the command, the drive,
    /// and what would allow it.
    Denied(String),
    /// The port was lost, or the other end has closed the connection.
    Lost(String),
    /// The port's input is not a marked stream: the other end does not mark its bytes, or marks were cut.
    Garbled(String),
    /// An interlock of the rig's file does not hold.
    Interlock(String),
    /// The program has been interrupted.
    Interrupted,
}

impl Trouble {
    /// Whether nothing more is played on a rig after it.
    #[must_use]
    pub fn ends_a_run(&self) -> bool {
        !matches!(self, Self::Denied(_))
    }

    /// Whether the bench itself has failed or must not continue: neither a denial nor an interruption.
    #[must_use]
    pub fn is_of_the_bench(&self) -> bool {
        matches!(self, Self::Lost(_) | Self::Garbled(_) | Self::Interlock(_))
    }

    /// Whether nothing arrives any more. After a denial or a failed interlock, what was sent before still comes round.
    #[must_use]
    pub(crate) fn stops_the_line(&self) -> bool {
        matches!(self, Self::Lost(_) | Self::Garbled(_) | Self::Interrupted)
    }
}

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Denied(text) | Self::Lost(text) | Self::Garbled(text) | Self::Interlock(text) => {
                f.write_str(text)
            }
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}
