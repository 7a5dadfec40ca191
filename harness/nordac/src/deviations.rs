//! The wrong slaves and the wrong masters of NORDAC inverters.

use harness_bench::command::deviations::DeviationRow;
use harness_sim::nordac::deviation::{MASTER_DEVIATIONS, deviations};

/// The deviations of slaves, and those of the bench's own master.
pub(crate) fn rows() -> [Vec<DeviationRow>; 2] {
    let slaves = deviations().map(|own| DeviationRow {
        name: own.name,
        section: own.section,
        about: own.about,
        models: None,
    });
    let masters = MASTER_DEVIATIONS.iter().map(|own| DeviationRow {
        name: own.name,
        section: own.section,
        about: own.about,
        models: None,
    });
    [slaves.collect(), masters.collect()]
}
