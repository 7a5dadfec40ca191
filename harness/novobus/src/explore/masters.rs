//! Cases for the bench's own master: jobs on a ring with faults, judged by the truth (`harness_sim::novobus::fuzz::jobs`).
//!
//! The judge knows the injected faults and reads the drives directly, so that no second master is needed as a reference. Cases are made
//! from a seed and are independent of each other.

use harness_bench::explore::Dice;
use harness_sim::novobus::deviation::MasterDeviation;
use harness_sim::novobus::fuzz::jobs::{Lie, Work, judged};

/// Maximum number of jobs and faults of a case.
const MOST_RECORDS: usize = 24;

/// Kinds of records (see [`Work::read`]): jobs, faults at a byte, a cut, another byte on the last link.
const JOBS: [u8; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
const FAULTS: [u8; 6] = [10, 11, 12, 13, 14, 15];

/// The input of a case, as the fuzz target `jobs` takes it: of a seed, and the number of the case.
#[must_use]
pub(crate) fn input(seed: u64, number: u64) -> Vec<u8> {
    let mut dice = Dice::of_part(seed, number);
    let mut input = vec![dice.byte(), dice.byte()];
    let jobs = 1 + dice.below(MOST_RECORDS - 4);
    // Without a fault there is no excuse; with one its name must be right; several test how much is corrected.
    let faults = dice.pick(&[0, 1, 1, 1, 2, 3]).copied().unwrap_or(0);
    for index in 0..jobs + faults {
        let kinds: &[u8] = if index < jobs { &JOBS } else { &FAULTS };
        input.push(dice.pick(kinds).copied().unwrap_or(0));
        let bytes: [u8; 5] = std::array::from_fn(|_| dice.byte());
        input.extend(bytes);
    }
    input
}

/// What the case of this number is.
#[must_use]
pub(crate) fn case(seed: u64, number: u64) -> Work {
    Work::read(&input(seed, number))
}

/// How many cases it takes until a wrong master is found, and by what; `None` where `most` do not show it.
#[must_use]
pub(crate) fn cases_until_found(
    deviates: &'static MasterDeviation,
    seed: u64,
    most: u64,
) -> Option<(u64, Lie)> {
    (0..most).find_map(|number| {
        let lie = judged(&case(seed, number), Some(deviates))?;
        Some((number + 1, lie))
    })
}
