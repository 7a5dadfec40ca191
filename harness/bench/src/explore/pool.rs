//! Keeps cases that show something new, so that other cases can be made from them.

use super::FuzzCase;
use crate::explore::Dice;
use std::collections::{BTreeSet, HashSet};
use std::hash::{BuildHasherDefault, Hasher};

/// Maximum number of cases kept.
pub const MOST_KEPT: usize = 2_000;

/// The cases that are kept, and what all of them have shown.
#[derive(Clone, Debug)]
pub struct Pool<C: FuzzCase> {
    cases: Vec<C>,
    /// Which of them are with which drives ([`FuzzCase::lane`]).
    of_lane: [Vec<usize>; 2],
    shown: HashSet<u32, BuildHasherDefault<Spread>>,
}

impl<C: FuzzCase> Default for Pool<C> {
    fn default() -> Self {
        Self {
            cases: Vec::new(),
            of_lane: Default::default(),
            shown: HashSet::default(),
        }
    }
}

/// A hash of features, which are hashes already.
#[derive(Clone, Debug, Default)]
struct Spread(u64);

impl Hasher for Spread {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = self.0 << 8 | u64::from(*byte);
        }
    }

    fn write_u32(&mut self, feature: u32) {
        // The table takes the lowest bits for the place and the highest for a quick comparison.
        self.0 = u64::from(feature).wrapping_mul(0x1_0000_0001);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

impl<C: FuzzCase> Pool<C> {
    /// Keeps a case that shows new features. Returns the number of new features, 0 if the case is not kept.
    pub fn offer(&mut self, case: &C, features: &[u32]) -> usize {
        if self.cases.len() >= MOST_KEPT {
            return 0;
        }
        let is_new = |feature: &&u32| self.shown.insert(**feature);
        let new = features.iter().filter(is_new).count();
        if new == 0 {
            return 0;
        }
        self.of_lane[case.lane()].push(self.cases.len());
        self.cases.push(case.clone());
        new
    }

    /// Those that are kept, the oldest first.
    #[must_use]
    pub fn cases(&self) -> &[C] {
        &self.cases
    }

    /// How many features there are.
    #[must_use]
    pub fn shown(&self) -> usize {
        self.shown.len()
    }

    /// One of them with these drives ([`FuzzCase::lane`]); the younger ones more often.
    pub fn pick(&self, lane: usize, dice: &mut Dice) -> Option<&C> {
        let of_lane = self.of_lane.get(lane)?;
        let from = if dice.percent(50) {
            of_lane.len() * 3 / 4
        } else {
            0
        };
        let at = of_lane.get(from + dice.below(of_lane.len() - from))?;
        self.cases.get(*at)
    }
}

/// FNV-1a: a number for a feature.
pub fn hash(words: &[u32]) -> u32 {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.fold(0x811C_9DC5, |hash: u32, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

/// Cases ordered so that each adds as many new features as any could; those that add none are dropped.
#[must_use]
pub fn by_novelty<C>(cases: Vec<(C, Vec<u32>)>) -> Vec<C> {
    let cases = cases.into_iter();
    let mut rest: Vec<(C, BTreeSet<u32>)> = cases
        .map(|(case, features)| (case, features.into_iter().collect()))
        .collect();
    let mut shown: BTreeSet<u32> = BTreeSet::new();
    let mut ordered = Vec::new();
    while !rest.is_empty() {
        let new = |features: &BTreeSet<u32>| features.difference(&shown).count();
        // The first of the best, so that the order is one.
        let counts: Vec<_> = rest.iter().map(|(_, features)| new(features)).collect();
        let best = counts.iter().copied().max().unwrap_or(0);
        let at = counts.iter().position(|count| *count == best).unwrap_or(0);
        let (case, features) = rest.remove(at);
        if best == 0 {
            break;
        }
        shown.extend(features);
        ordered.push(case);
    }
    ordered
}
