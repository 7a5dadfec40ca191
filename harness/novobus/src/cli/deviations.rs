//! The wrong drives and the wrong masters of the ring.

use harness_bench::command::deviations::DeviationRow;
use harness_sim::novobus::deviation::{deviations, master_deviations};

/// The deviations of drives, and those of the bench's own master.
pub(crate) fn rows() -> [Vec<DeviationRow>; 2] {
    let drives = deviations().map(|own| DeviationRow {
        name: own.name,
        section: own.section,
        about: own.about,
        models: Some(if own.behind_the_bus {
            &["nd21"]
        } else {
            &["plain", "nd21"]
        }),
    });
    let masters = master_deviations().map(|own| DeviationRow {
        name: own.name,
        section: own.section,
        about: own.about,
        models: None,
    });
    [drives.collect(), masters.collect()]
}
