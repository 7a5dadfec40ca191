//! Cases on simulated rings, in virtual time.

use super::case::Case;
use super::error::ExploreError;
use super::novelty::features;
use super::oracle::{against_model, against_reference, beside};
use super::play::play;
use super::setup::Setup;
use super::target::{Rehearsal, Target, Tried};
use crate::link::{Link, SimulatedLink};

/// A simulated ring beside its model, and beside the reference model where its drives are plain and sound.
#[derive(Debug)]
pub struct OnSim {
    setup: Setup,
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
    /// Rings of this setup.
    #[must_use]
    pub const fn new(setup: Setup) -> Self {
        Self { setup, fresh: None }
    }

    fn fresh(&mut self, case: &Case) -> Result<&Fresh, ExploreError> {
        let sizes = case.sizes();
        let fresh = match self.fresh.take().filter(|fresh| fresh.sizes == sizes) {
            Some(fresh) => fresh,
            None => Fresh {
                model: self.setup.model(&sizes)?,
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

impl Target for OnSim {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        let with_reference = self.setup.is_plain() && self.setup.deviates.is_empty();
        let mut link = self.fresh(case)?.model.clone();
        let seen = play(&mut link, case);
        let trace = link.trace(case.ring());
        let of_model = match with_reference {
            true => against_reference(case, &link, &trace).or_else(|| beside(case, &link)),
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
                not_played: None,
            });
        };
        let seen = play(&mut link, case);
        Ok(Tried {
            took: seen.took,
            difference: against_model(case, &rehearsal.seen, &seen).or_else(|| beside(case, &link)),
            not_played: None,
        })
    }
}
