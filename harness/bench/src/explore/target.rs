//! What cases are tried on.

use super::FuzzCase;
use super::error::ExploreError;
use harness_proto::time::Span;

/// What the model makes of a case before it is tried.
#[derive(Clone, Debug)]
pub struct Rehearsal<C: FuzzCase> {
    /// What the master sees of it.
    pub seen: C::Seen,
    /// How long the line is used for it, with all that comes before it on a rig.
    pub took: Span,
    /// What it shows; the same feature may come several times.
    pub features: Vec<u32>,
    /// Why it is not tried: the rig does not allow it, or cannot do it.
    pub denied: Option<String>,
    /// How the model differs from the reference model.
    pub of_model: Option<C::Difference>,
}

impl<C: FuzzCase> Default for Rehearsal<C> {
    fn default() -> Self {
        Self {
            seen: C::Seen::default(),
            took: Span::ZERO,
            features: Vec::new(),
            denied: None,
            of_model: None,
        }
    }
}

/// The outcome of a case.
#[derive(Clone, Debug)]
pub struct Tried<C: FuzzCase> {
    /// How long the line was used for it.
    pub took: Span,
    /// Mismatch with the expected behaviour.
    pub difference: Option<C::Difference>,
    /// What was sent to the ring between making its drives ready and the case, if the difference may come from that.
    pub before: Option<Vec<C::Act>>,
    /// Why it was not played after all.
    pub not_played: Option<String>,
}

impl<C: FuzzCase> Default for Tried<C> {
    fn default() -> Self {
        Self {
            took: Span::ZERO,
            difference: None,
            before: None,
            not_played: None,
        }
    }
}

/// What cases are tried on, with its model.
pub trait Target<C: FuzzCase> {
    /// Plays a case on the model.
    ///
    /// # Errors
    /// The model cannot be made.
    fn rehearse(&mut self, case: &C) -> Result<Rehearsal<C>, ExploreError>;

    /// Tries a case that the model has been through.
    ///
    /// # Errors
    /// The rig cannot continue.
    fn attempt(&mut self, case: &C, rehearsal: &Rehearsal<C>) -> Result<Tried<C>, ExploreError>;

    /// The last attempt, with all that its difference rests on; `None` where playing it again shows the same.
    fn recorded(&self) -> Option<C::Attempt> {
        None
    }

    /// Has the drives made ready before the next attempt.
    fn begin(&mut self) {}

    /// Why no further case can be tried, if so: the program has been interrupted, or the rig's file allows no longer run.
    fn over(&mut self) -> Option<String> {
        None
    }

    /// Lets the end of the longest run come between two cases, by [`Target::over`], and not in the middle of one.
    fn end_between_cases(&mut self) {}

    /// The number of cases that were not judged, since too many models would have had to be played.
    fn undecided(&self) -> u64 {
        0
    }
}
