//! The wrong drives and the wrong masters of the ring.

use harness_bench::command::deviations::DeviationRow;
use harness_sim::novobus::deviation::{DEVIATIONS, MASTER_DEVIATIONS};

/// The deviations of drives, and those of the bench's own master.
pub(crate) fn rows() -> [Vec<DeviationRow>; 2] {
    let drives = DEVIATIONS.all().map(|row| DeviationRow {
        models: Some(if row.is_behind_the_bus() {
            &["nd21"]
        } else {
            &["plain", "nd21"]
        }),
        ..DeviationRow::of(row)
    });
    [drives.collect(), DeviationRow::all(&MASTER_DEVIATIONS)]
}
