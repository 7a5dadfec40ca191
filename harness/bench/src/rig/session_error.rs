//! Why a rig cannot be used.

use super::hook::HookError;
use super::in_use::End;
use super::lock::LockError;
use crate::scenario::problem::Problems;
use std::error::Error;

/// What the bus of a rig says of it.
type BoxedError = Box<dyn Error + Send + Sync>;

/// Why a rig cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Its drives are on another bus.
    #[error(
        "rig {rig} has drives on the bus {bus}, and this command serves rings only; read, write, watch, info, params, position, go, stop, block, run and rig check serve it"
    )]
    OtherBus { rig: String, bus: &'static str },
    /// A port cannot be opened, its drives do not answer, or its bus is in use.
    #[error("rig {rig}: {why}")]
    Drives {
        rig: String,
        /// What is wrong, in a sentence.
        why: String,
    },
    /// Its file describes drives that cannot be.
    #[error("{0}")]
    Mistakes(Box<Problems>),
    /// Another program has its port.
    #[error("rig {rig}: {why}")]
    PortInUse {
        rig: String,
        /// Which port, and by which program, in a sentence.
        why: String,
    },
    /// It is held or reserved, or its lock cannot be used.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// It must not be used.
    #[error(
        "rig {rig} is in quarantine since {since}: {reason} (`drivebench rig quarantine {rig} --lift`)"
    )]
    Quarantine {
        rig: String,
        since: String,
        reason: String,
    },
    /// The folder of locks.
    #[error("failed to use the folder of locks: {0}; set DRIVEBENCH_STATE to another")]
    State(std::io::Error),
    /// The watchdog cannot be started.
    #[error("failed to start the watchdog: {0}")]
    Watchdog(std::io::Error),
    #[error("rig {rig}: {error}")]
    Hook { rig: String, error: Box<HookError> },
    /// The program was interrupted while it opened the rig.
    #[error("rig {rig}: interrupted{}", .end.as_ref().map_or(" before anything was sent".to_owned(), |end| format!("; {end}")))]
    Interrupted {
        rig: String,
        /// How it was given back; `None` if nothing had been sent to its drives.
        end: Option<Box<End>>,
    },
    /// It is not healthy.
    #[error("rig {rig}, ring {ring}: {ill}{}", likely(cause.as_deref()))]
    Ill {
        rig: String,
        /// Which ring, 1 or 2.
        ring: usize,
        /// What is wrong.
        ill: BoxedError,
        /// The likely cause, and what to do next; only known when a rig is opened.
        cause: Option<BoxedError>,
    },
}

impl SessionError {
    /// The same of a rig that is not healthy, with its likely cause.
    pub fn because(mut self, likely: impl Error + Send + Sync + 'static) -> Self {
        if let Self::Ill { cause, .. } = &mut self {
            *cause = Some(Box::new(likely));
        }
        self
    }
}

fn likely(cause: Option<&(dyn Error + Send + Sync)>) -> String {
    cause.map_or(String::new(), |cause| format!(". Likely cause: {cause}"))
}
