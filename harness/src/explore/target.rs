//! What cases are tried on.

use super::Difference;
use super::Seen;
use super::error::ExploreError;
use super::{Act, Case};
use harness_proto::time::Span;
use std::collections::BTreeSet;

/// What the model makes of a case before it is tried.
#[derive(Clone, Debug, Default)]
pub struct Rehearsal {
    /// What the master sees of it.
    pub seen: Seen,
    /// How long the line is used for it, with all that comes before it on a rig.
    pub took: Span,
    /// What it shows.
    pub features: BTreeSet<u32>,
    /// Why it is not tried: the rig does not allow it, or cannot do it.
    pub denied: Option<String>,
    /// How the model is otherwise than the reference model.
    pub of_model: Option<Difference>,
}

/// What came of a case.
#[derive(Clone, Debug, Default)]
pub struct Tried {
    /// How long the line was used for it.
    pub took: Span,
    /// How the ring was otherwise than it must be.
    pub difference: Option<Difference>,
    /// What was sent to the ring before the case, since its drives were made ready, where the difference may come from that.
    pub before: Option<Vec<Act>>,
    /// Why it was not played after all.
    pub not_played: Option<String>,
}

/// A ring that cases are tried on, beside its model.
pub trait Target {
    /// Lets the model live through a case.
    ///
    /// # Errors
    /// The model cannot be made.
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError>;

    /// Tries a case that the model has been through.
    ///
    /// # Errors
    /// The rig cannot go on.
    fn attempt(&mut self, case: &Case, rehearsal: &Rehearsal) -> Result<Tried, ExploreError>;

    /// Lets the next attempt begin with drives that were made ready for it.
    fn begin(&mut self) {}

    /// Whether no other case can be tried: somebody wants the program to end, or the rig's file allows no longer run.
    fn over(&mut self) -> Option<String> {
        None
    }
}
