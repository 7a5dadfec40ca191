//! A scenario played on a simulated bench.

use crate::library::Entry;
use crate::scenario::run::{AtMismatch, Outcome};
use harness_sim::record::Trace;
use std::sync::atomic::AtomicBool;

/// A scenario that was played, with what it left.
pub(crate) struct PlayedOnce {
    pub(crate) outcome: Outcome,
    pub(crate) traces: Vec<Trace>,
}

/// Plays a scenario on a simulated bench.
pub(crate) fn play_entry(entry: &Entry, at_mismatch: AtMismatch) -> PlayedOnce {
    play_entry_until(entry, at_mismatch, &AtomicBool::new(false))
}

/// The same, aborted once `interrupt` is set.
pub(crate) fn play_entry_until(
    entry: &Entry,
    at_mismatch: AtMismatch,
    interrupt: &AtomicBool,
) -> PlayedOnce {
    let plan = &entry.settled;
    let mut link = plan.simulate();
    let outcome = plan.play_until(&mut *link, at_mismatch, interrupt);
    PlayedOnce {
        outcome,
        traces: (0..plan.ports()).map(|port| link.trace(port)).collect(),
    }
}
