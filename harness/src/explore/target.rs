//! What cases are tried on.

use super::Difference;
use super::MasterView;
use super::error::ExploreError;
use super::{Act, AttemptRecord, Case};
use harness_proto::time::Span;
use std::collections::BTreeSet;

/// What the model makes of a case before it is tried.
#[derive(Clone, Debug, Default)]
pub struct Rehearsal {
    /// What the master sees of it.
    pub seen: MasterView,
    /// How long the line is used for it, with all that comes before it on a rig.
    pub took: Span,
    /// What it shows.
    pub features: BTreeSet<u32>,
    /// Why it is not tried: the rig does not allow it, or cannot do it.
    pub denied: Option<String>,
    /// How the model differs from the reference model.
    pub of_model: Option<Difference>,
}

/// The outcome of a case.
#[derive(Clone, Debug, Default)]
pub struct Tried {
    /// How long the line was used for it.
    pub took: Span,
    /// Mismatch with the expected behaviour.
    pub difference: Option<Difference>,
    /// What was sent to the ring between making its drives ready and the case, if the difference may come from that.
    pub before: Option<Vec<Act>>,
    /// Why it was not played after all.
    pub not_played: Option<String>,
}

/// A ring that cases are tried on, beside its model.
pub trait Target {
    /// Plays a case on the model.
    ///
    /// # Errors
    /// The model cannot be made.
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError>;

    /// Tries a case that the model has been through.
    ///
    /// # Errors
    /// The rig cannot go on.
    fn attempt(&mut self, case: &Case, rehearsal: &Rehearsal) -> Result<Tried, ExploreError>;

    /// The last attempt, with all that its difference rests on; `None` where playing it again shows the same.
    fn recorded(&self) -> Option<AttemptRecord> {
        None
    }

    /// Has the drives made ready before the next attempt.
    fn begin(&mut self) {}

    /// Why no further case can be tried, if so: the program has been interrupted, or the rig's file allows no longer run.
    fn over(&mut self) -> Option<String> {
        None
    }
}
