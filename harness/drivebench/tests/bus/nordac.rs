//! Every deviation of a NORDAC inverter, and of its master, is found by a scenario.
//!
//! `corpora/nordac-deviations.toml` says which scenario finds which.
//! `DEVIATIONS=update cargo test --test bus nordac` plays every scenario with every deviation and rewrites the file.

use super::found::Deviations;
use harness_sim::nordac::deviation::{DEVIATIONS, MASTER_DEVIATIONS};

#[test]
fn every_deviation_is_found() {
    let all = Deviations {
        file: "corpora/nordac-deviations.toml",
        head: "\
# Which scenario finds which deviation of a NORDAC inverter, and of its master (`master deviates`).
# Written by `DEVIATIONS=update cargo test --test bus nordac`; the test plays every pair.
",
        bus: "bus     nordac\n",
        device: "slave",
        driven: "",
        drives: DEVIATIONS.names(),
        masters: MASTER_DEVIATIONS.names(),
    };
    all.all_are_found();
}
