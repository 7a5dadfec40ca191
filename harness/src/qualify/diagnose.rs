//! What a drive that is otherwise is: the known deviations that explain every byte of a run. And what the bench's own master is, where it is the
//! one that is otherwise.

use super::hypothesis::Hypothesis;
use crate::rig::Driven;
use harness_sim::deviation::{MasterDeviation, deviations, master_deviations};

/// Rings up to this size are asked drive by drive; in larger ones the drives that were named and all together.
const SMALL: u8 = 16;

/// The deviations that a drive of these rings may have: of one drive, then of all.
#[must_use]
pub fn deviating(drives: u8, suspects: &[u8]) -> Vec<Hypothesis> {
    let mut hypotheses = Vec::new();
    let single: Vec<u8> = match drives <= SMALL {
        true => (0..drives).collect(),
        false => suspects.to_vec(),
    };
    for deviation in deviations() {
        for drive in &single {
            hypotheses.push(Hypothesis {
                name: format!(
                    "drive {drive}: {} (ND21 {}): {}",
                    deviation.name, deviation.section, deviation.about
                ),
                lines: vec![format!("drive {drive} deviates {}", deviation.name)],
            });
        }
        if drives > 1 {
            hypotheses.push(Hypothesis {
                name: format!(
                    "every drive: {} (ND21 {}): {}",
                    deviation.name, deviation.section, deviation.about
                ),
                lines: vec![format!("drive 0..last deviates {}", deviation.name)],
            });
        }
    }
    hypotheses
}

/// The deviations of the master under which everything is as it was recorded, in every attempt in which the driver had a part.
#[must_use]
pub fn deviating_masters(attempts: &[Driven]) -> Vec<&'static MasterDeviation> {
    let explains = |deviation: &&'static MasterDeviation| {
        let mut all = attempts.iter();
        all.all(|driven| driven.is_explained_by(Some(deviation)))
    };
    master_deviations().filter(explains).collect()
}
