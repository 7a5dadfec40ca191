//! Cases on simulated rings, in virtual time.

use super::case::Case;
use super::oracle::{Difference, against_model, against_reference, against_witnesses, beside};
use super::play::play;
use super::setup::RingSetup;
use crate::explore::features;
use crate::explore::{Rehearsal, Tried};
use crate::link::SimulatedLink;
use harness_bench::explore::ExploreError;
use harness_bench::explore::Target;
use harness_bench::link::Link;
use harness_sim::record::Trace;

/// Compares a simulated ring with its model, and with the reference model if its drives are plain and sound.
#[derive(Debug)]
pub(crate) struct OnSim {
    setup: RingSetup,
    /// Fresh rings of the sizes of the last case.
    fresh: Option<Fresh>,
}

#[derive(Debug)]
struct Fresh {
    sizes: Vec<u8>,
    model: SimulatedLink,
    under_test: Option<SimulatedLink>,
}

impl OnSim {
    #[must_use]
    pub(crate) const fn new(setup: RingSetup) -> Self {
        Self { setup, fresh: None }
    }

    /// How the model itself differs from the expected behaviour.
    fn judge(&self, case: &Case, link: &mut SimulatedLink, trace: &Trace) -> Option<Difference> {
        let difference = match self.setup.is_plain() {
            true => against_reference(case, link, trace),
            false => against_witnesses(case, link, trace),
        };
        difference.or_else(|| beside(case, link))
    }

    /// The same, but creates rings of these sizes at once, so that errors are reported before a run begins.
    ///
    /// # Errors
    /// The lines of the setup have mistakes, or there is no reference for the drives that they describe.
    pub(crate) fn ready(setup: RingSetup, sizes: &[u8]) -> Result<Self, ExploreError> {
        let mut new = Self::new(setup);
        new.fresh_of(sizes.to_vec())?;
        Ok(new)
    }

    /// The model. If no deviation is planted, the model itself is under test, against the reference model or witnesses.
    fn model(&self, sizes: &[u8]) -> Result<SimulatedLink, ExploreError> {
        let mut model = self.setup.model(sizes)?;
        if !self.setup.deviates.is_empty() || self.setup.is_plain() {
            return Ok(model);
        }
        let remedy = "leave the line out, or plant a deviation (--deviates DRIVE=NAME)";
        if let Some(line) = self.setup.sets_property() {
            return Err(ExploreError::Usage(format!(
                "there is nothing to hold these drives against: witnesses know no other property of the bus than the default, and the \
                 rig says `{line}`; {remedy}"
            )));
        }
        match model.witness() {
            true => Ok(model),
            false => Err(ExploreError::Usage(format!(
                "there is nothing to hold these drives against: witnesses judge whole ND21s, and a `model` line of the rig makes some of \
                 them plain; {remedy}"
            ))),
        }
    }

    fn fresh(&mut self, case: &Case) -> Result<&Fresh, ExploreError> {
        self.fresh_of(case.sizes())
    }

    fn fresh_of(&mut self, sizes: Vec<u8>) -> Result<&Fresh, ExploreError> {
        let fresh = match self.fresh.take().filter(|fresh| fresh.sizes == sizes) {
            Some(fresh) => fresh,
            None => Fresh {
                model: self.model(&sizes)?,
                under_test: match self.setup.deviates.is_empty() {
                    true => None,
                    false => Some(self.setup.under_test(&sizes)?),
                },
                sizes,
            },
        };
        Ok(self.fresh.insert(fresh))
    }
}

impl Target<Case> for OnSim {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        let mut link = self.fresh(case)?.model.clone();
        let seen = play(&mut link, case);
        let trace = link.trace(case.ring());
        let of_model = match self.setup.deviates.is_empty() {
            true => self.judge(case, &mut link, &trace),
            false => None,
        };
        Ok(Rehearsal {
            took: seen.took,
            features: features(case, &seen, &trace),
            denied: None,
            seen,
            of_model,
        })
    }

    fn attempt(&mut self, case: &Case, rehearsal: &Rehearsal) -> Result<Tried, ExploreError> {
        let Some(mut link) = self.fresh(case)?.under_test.clone() else {
            return Ok(Tried {
                took: rehearsal.took,
                difference: rehearsal.of_model.clone(),
                ..Tried::default()
            });
        };
        let seen = play(&mut link, case);
        Ok(Tried {
            took: seen.took,
            difference: against_model(case, &rehearsal.seen, &seen).or_else(|| beside(case, &link)),
            ..Tried::default()
        })
    }
}
