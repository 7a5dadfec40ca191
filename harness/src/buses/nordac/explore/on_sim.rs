//! Cases on simulated slaves, in virtual time.

use super::act::TelegramTalk;
use super::fuzz_case::features;
use super::oracle::{Judgement, Oracle};
use super::play::play;
use super::setup::model;
use crate::buses::nordac::simulate::Setup;
use crate::explore::{ExploreError, Rehearsal, Target, Tried};

/// Plays cases on simulated slaves, and judges them beside the model. That the slaves are simulated, the judge does not use: it takes any
/// value of every open point for possible.
#[derive(Debug)]
pub struct OnLine {
    oracle: Oracle,
    undecided: u64,
}

impl OnLine {
    /// Slaves of this setup.
    #[must_use]
    pub fn new(under_test: Setup) -> Self {
        Self {
            oracle: Oracle::new(under_test),
            undecided: 0,
        }
    }

    /// How many cases were not judged, since too many models would have had to be played.
    #[must_use]
    pub const fn undecided(&self) -> u64 {
        self.undecided
    }
}

impl Target<TelegramTalk> for OnLine {
    fn rehearse(&mut self, case: &TelegramTalk) -> Result<Rehearsal<TelegramTalk>, ExploreError> {
        let setup = model(self.oracle.under_test(), self.oracle.last());
        let seen = play(&setup, case);
        Ok(Rehearsal {
            took: seen.took,
            features: features(&seen),
            seen,
            denied: None,
            of_model: None,
        })
    }

    fn attempt(
        &mut self,
        case: &TelegramTalk,
        _: &Rehearsal<TelegramTalk>,
    ) -> Result<Tried<TelegramTalk>, ExploreError> {
        let seen = play(self.oracle.under_test(), case);
        let took = seen.took;
        let (difference, not_played) = match self.oracle.judge(case, &seen) {
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
}
