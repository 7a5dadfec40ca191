//! The wrong drives and the wrong drivers of UNITEK drives.

use harness_bench::command::deviations::DeviationRow;
use harness_sim::unitek::deviation::{MASTER_DEVIATIONS, deviations};

/// The deviations of drives, and those of the bench's own driver.
pub(crate) fn rows() -> [Vec<DeviationRow>; 2] {
    let drives = deviations().map(|own| DeviationRow {
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
    [drives.collect(), masters.collect()]
}
