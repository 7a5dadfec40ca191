//! Conversations on simulated drives, in virtual time.

use super::oracle::{Judgement, Oracle};
use super::{LineBus, LineTalk};
use crate::explore::{ExploreError, Rehearsal, Target, Tried};

/// Plays conversations on simulated drives, and judges them beside the model. That the drives are simulated, the judge does not use: it
/// takes any value of every open point for possible.
#[derive(Debug)]
pub(crate) struct OnLine<B: LineBus> {
    oracle: Oracle<B>,
    undecided: u64,
}

impl<B: LineBus> OnLine<B> {
    /// Plays on these drives.
    #[must_use]
    pub(crate) fn new(under_test: B::Setup) -> Self {
        Self {
            oracle: Oracle::new(under_test),
            undecided: 0,
        }
    }
}

impl<B: LineBus> Target<LineTalk<B>> for OnLine<B> {
    fn rehearse(&mut self, talk: &LineTalk<B>) -> Result<Rehearsal<LineTalk<B>>, ExploreError> {
        let seen = B::play(&self.oracle.model(), talk);
        Ok(Rehearsal {
            took: seen.took,
            features: B::features(talk, &seen),
            seen,
            denied: None,
            of_model: None,
        })
    }

    fn attempt(
        &mut self,
        talk: &LineTalk<B>,
        _: &Rehearsal<LineTalk<B>>,
    ) -> Result<Tried<LineTalk<B>>, ExploreError> {
        let seen = B::play(self.oracle.under_test(), talk);
        let took = seen.took;
        let (difference, not_played) = match self.oracle.judge(talk, &seen) {
            Judgement::Explained => (None, None),
            Judgement::Differs(found) => (Some(*found), None),
            Judgement::Undecided => {
                self.undecided += 1;
                let why = "more values of open points than are tried could explain it";
                (None, Some(why.to_owned()))
            }
        };
        Ok(Tried {
            took,
            difference,
            before: None,
            not_played,
        })
    }

    fn undecided(&self) -> u64 {
        self.undecided
    }
}
