//! Every deviation of a UNITEK drive, and of its driver, is found by a scenario.
//!
//! `corpora/unitek-deviations.toml` says which scenario finds which.
//! `DEVIATIONS=update cargo test --test bus unitek` plays every scenario with every deviation and rewrites the file.

use super::found::Deviations;
use harness_sim::unitek::deviation::{DEVIATIONS, MASTER_DEVIATIONS};

#[test]
fn every_deviation_is_found() {
    let all = Deviations {
        file: "corpora/unitek-deviations.toml",
        head: "\
# Which scenario finds which deviation of a UNITEK drive, and of its driver (`master deviates`).
# Written by `DEVIATIONS=update cargo test --test bus unitek`; the test plays every pair.
",
        bus: "bus     unitek\n",
        device: "drive",
        driven: "\nmaster ",
        drives: DEVIATIONS.names(),
        masters: MASTER_DEVIATIONS.names(),
    };
    all.all_are_found();
}
