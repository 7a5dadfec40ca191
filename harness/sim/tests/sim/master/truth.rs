//! The judge of jobs (`fuzz::jobs`): a right master never lies, and every wrong one is found by the body of the fuzz target.

use super::common::{Random, repeat, seed};
use harness_sim::novobus::deviation::MASTER_DEVIATIONS;
use harness_sim::novobus::fuzz::jobs::{Work, judged};

/// Cases of the right master; `CASES` asks for more.
const RIGHT: u64 = 3_000;
/// Inputs within which every wrong master is found.
const WRONG: u64 = 20_000;

/// An input of the fuzz target, as a fuzzer begins with: any bytes.
fn input(case: u64) -> Vec<u8> {
    let mut random = Random(seed().wrapping_mul(1_000_003).wrapping_add(case));
    let records = 1 + random.below(24);
    (0..2 + 6 * records)
        .map(|_| random.below(256) as u8)
        .collect()
}

#[test]
fn a_right_master_never_lies() {
    let cases = std::env::var("CASES").ok();
    let cases = cases.and_then(|cases| cases.parse().ok()).unwrap_or(RIGHT);
    for case in 0..cases {
        let work = Work::read(&input(case));
        if let Some(lie) = judged(&work, None) {
            panic!("case {case}: {lie}\n{work:?}; {}", repeat("a_right_master"));
        }
    }
}

#[test]
fn every_wrong_master_is_found() {
    let mut unseen = Vec::new();
    for deviation in MASTER_DEVIATIONS.all() {
        let lies = |case: u64| judged(&Work::read(&input(case)), Some(deviation)).is_some();
        if !(0..WRONG).any(lies) {
            unseen.push(deviation.name);
        }
    }
    assert!(unseen.is_empty(), "{unseen:?}; {}", repeat("every_wrong"));
}
