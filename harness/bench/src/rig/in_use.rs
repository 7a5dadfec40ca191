//! How a rig is used, and how its use ended; on every bus.

use super::check::Rig;
use super::session_error::SessionError;
use super::watchdog::Alarm;
use crate::guard::Safe;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How a rig is used.
#[derive(Clone, Debug, Default)]
pub struct UseOptions {
    /// The purpose, shown to others who want the rig.
    pub purpose: String,
    /// How long to wait for a rig that is in use.
    pub wait: Duration,
    /// Whether motors may turn, if the rig's file allows it too.
    pub allow_motion: bool,
    /// Whether to open a ring that fails its health check, to find out what is wrong with it.
    pub ill_as_well: bool,
    /// Whether the lines of a ring that has timed out are [kept](crate::link::Line::keep) until the caller's own master sends.
    pub keeps_lines: bool,
    /// Whether to find out first if bytes with a wrong parity bit can be sent, where the bus has a parity.
    pub tries_line_errors: bool,
    /// Set to end the program.
    pub interrupt: Arc<AtomicBool>,
    /// Called when the program shows no sign of life, after the watchdog has stopped the drives.
    pub alarm: Alarm,
}

impl UseOptions {
    /// Returns an error once the program has been interrupted.
    pub fn unless_interrupted(&self, rig: &Rig) -> Result<(), SessionError> {
        match self.interrupt.load(Ordering::Relaxed) {
            false => Ok(()),
            true => Err(SessionError::Interrupted {
                rig: rig.id().to_owned(),
                end: None,
            }),
        }
    }
}

/// How a session ended.
#[derive(Debug, Default)]
pub struct End {
    /// Whether every drive stands and is blocked; `None` for rings that are simulated in the program.
    pub safe: Option<Safe>,
    /// Power that was to be switched off and is not known to be, in sentences.
    pub power: Vec<String>,
    /// What else went wrong on the way out, in sentences.
    pub remarks: Vec<String>,
}

impl End {
    /// Whether the drives or their power may not be in the safe state.
    #[must_use]
    pub fn is_unsafe(&self) -> bool {
        !self.power.is_empty() || self.safe.as_ref().is_some_and(|safe| !safe.confirmed)
    }
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let safe = self.safe.iter().map(Safe::to_string);
        let others = self.power.iter().chain(&self.remarks).cloned();
        f.write_str(&safe.chain(others).collect::<Vec<_>>().join("; "))
    }
}
