//! Wrong masters are found by cases made from a seed, and a right one passes them all.

use crate::explore::masters::{case, cases_until_found, input};
use harness_sim::novobus::deviation::MASTER_DEVIATIONS;
use harness_sim::novobus::fuzz::jobs::{Work, judged};

#[test]
fn a_case_is_a_function_of_its_seed_and_number() {
    assert_eq!(case(7, 3), case(7, 3));
    assert_eq!(case(7, 3), Work::read(&input(7, 3)));
    assert_ne!(input(7, 3), input(7, 4));
    assert_ne!(input(7, 3), input(8, 3));
}

#[test]
fn a_right_master_passes() {
    for number in 0..500 {
        assert_eq!(judged(&case(1, number), None), None, "case {number}");
    }
}

#[test]
fn every_wrong_master_is_found_soon() {
    for deviation in MASTER_DEVIATIONS.all() {
        let found = cases_until_found(deviation, 1, 1_000);
        assert!(found.is_some(), "{}", deviation.name);
    }
}

/// The finding names the section that the master breaks.
#[test]
fn the_section_is_named() {
    for (name, section) in [
        ("check-byte-off-by-one", "9.6"),
        ("check-sequence-of-16-zeros", "9.8"),
        ("names-the-link-behind", "9.7"),
        ("repetition-not-told", "11.5"),
    ] {
        let deviation = MASTER_DEVIATIONS.named(name).expect("a deviation");
        let (_, lie) = cases_until_found(deviation, 1, 500).expect("found");
        assert_eq!(lie.section, section, "{name}: {lie}");
    }
}
