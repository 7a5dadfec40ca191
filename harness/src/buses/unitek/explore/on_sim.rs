//! Cases on simulated drives, in virtual time.

use super::act::FrameTalk;
use super::fuzz_case::features;
use super::oracle::{Judgement, Oracle};
use super::play::play;
use super::setup::model;
use crate::buses::unitek::simulate::Setup;
use crate::explore::{ExploreError, Rehearsal, Target, Tried};

/// Plays cases on simulated drives, and judges them beside the model. That the drives are simulated, the judge does not use: it takes any
/// value of every open point for possible.
#[derive(Debug)]
pub struct OnBench {
    oracle: Oracle,
    undecided: u64,
}

impl OnBench {
    /// Drives of this setup.
    #[must_use]
    pub fn new(under_test: Setup) -> Self {
        Self {
            oracle: Oracle::new(under_test),
            undecided: 0,
        }
    }

    /// What judges.
    #[must_use]
    pub const fn oracle(&self) -> &Oracle {
        &self.oracle
    }

    /// How many cases were not judged, since too many models would have had to be played.
    #[must_use]
    pub const fn undecided(&self) -> u64 {
        self.undecided
    }
}

impl Target<FrameTalk> for OnBench {
    fn rehearse(&mut self, case: &FrameTalk) -> Result<Rehearsal<FrameTalk>, ExploreError> {
        let assignment = self.oracle.last();
        let setup = model(self.oracle.under_test(), assignment);
        let seen = play(&setup, case);
        Ok(Rehearsal {
            took: seen.took,
            features: features(case, &seen),
            seen,
            denied: None,
            of_model: None,
        })
    }

    fn attempt(
        &mut self,
        case: &FrameTalk,
        _: &Rehearsal<FrameTalk>,
    ) -> Result<Tried<FrameTalk>, ExploreError> {
        let seen = play(self.oracle.under_test(), case);
        let took = seen.took;
        let judged = self.oracle.judge(case, &seen);
        let (difference, not_played) = match judged {
            Judgement::Explained(_) => (None, None),
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
}
