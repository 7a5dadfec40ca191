//! The bench that a command names, and what it does with it.

use crate::rig::find::{or_meant, simulated_port};
use crate::rig::rings::sizes_of_rings;
use std::str::FromStr;

/// The name of a bench.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RigName {
    /// Simulated rings with these numbers of drives.
    Simulated(Vec<u8>),
    /// A file, or a name that `rig list` shows.
    Named(String),
}

impl RigName {
    /// The numbers of drives of simulated rings.
    pub fn sizes(&self) -> Option<&[u8]> {
        match self {
            Self::Simulated(sizes) => Some(sizes),
            Self::Named(_) => None,
        }
    }
}

impl FromStr for RigName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let port = text.strip_prefix("sim:").and_then(simulated_port);
        if let Some((_, drives)) = port {
            return drives.map(|_| Self::Named(text.to_owned()));
        }
        match text.strip_prefix("sim:") {
            Some(sizes) => match sizes_of_rings(sizes) {
                Ok(sizes) => Ok(Self::Simulated(sizes)),
                Err(reason) => Err(or_meant(sizes, reason)),
            },
            None => Ok(Self::Named(text.to_owned())),
        }
    }
}

/// What a command does with a bench.
#[derive(Clone, Copy, Debug)]
pub struct Use {
    /// The command's name, shown to other users who want the bench.
    pub purpose: &'static str,
    /// The command line allows motors to turn.
    pub moves: bool,
    /// The drives stay as they are after success: nothing was changed, or the user asked for it.
    pub holds: bool,
}

impl Use {
    /// For the command of this name.
    pub const fn new(purpose: &'static str, moves: bool, holds: bool) -> Self {
        Self {
            purpose,
            moves,
            holds,
        }
    }

    /// For a command that changes nothing.
    pub const fn look(purpose: &'static str) -> Self {
        Self::new(purpose, false, true)
    }

    /// Whether it changes nothing, so that a failure leaves the drives as they are.
    pub(crate) const fn looks_only(&self) -> bool {
        self.holds && !self.moves
    }
}
