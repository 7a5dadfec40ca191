//! The wrong drives and the wrong masters of the ring.

use harness_bench::command::deviations::DeviationRow;
use harness_sim::novobus::deviation::{deviations, master_deviations};

/// The deviations of drives, and those of the bench's own master.
pub(crate) fn rows() -> [Vec<DeviationRow>; 2] {
    let drives = deviations().map(|row| DeviationRow {
        models: Some(if row.behind_the_bus {
            &["nd21"]
        } else {
            &["plain", "nd21"]
        }),
        ..DeviationRow::new(row.name, row.section, row.about)
    });
    let masters = master_deviations();
    let masters = masters.map(|row| DeviationRow::new(row.name, row.section, row.about));
    [drives.collect(), masters.collect()]
}
