//! Keeps cases that show something new, so that other cases can be made from them.

use super::Case;
use super::FuzzCase;
use crate::explore::Dice;
use std::collections::BTreeSet;

/// Maximum number of cases kept.
pub const MOST_KEPT: usize = 2_000;

/// The cases that are kept, and what all of them have shown.
#[derive(Clone, Debug)]
pub struct Pool<C: FuzzCase = Case> {
    cases: Vec<C>,
    /// Which of them are with which drives ([`FuzzCase::lane`]).
    of_lane: [Vec<usize>; 2],
    shown: BTreeSet<u32>,
}

impl<C: FuzzCase> Default for Pool<C> {
    fn default() -> Self {
        Self {
            cases: Vec::new(),
            of_lane: Default::default(),
            shown: BTreeSet::new(),
        }
    }
}

impl<C: FuzzCase> Pool<C> {
    /// Keeps a case that shows new features. Returns the number of new features, 0 if the case is not kept.
    pub fn offer(&mut self, case: &C, features: &BTreeSet<u32>) -> usize {
        let new = features.difference(&self.shown).count();
        if new == 0 || self.cases.len() >= MOST_KEPT {
            return 0;
        }
        self.shown.extend(features);
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
        let own = self.of_lane.get(lane)?;
        let from = if dice.percent(50) {
            own.len() * 3 / 4
        } else {
            0
        };
        let at = own.get(from + dice.below(own.len() - from))?;
        self.cases.get(*at)
    }
}

/// FNV-1a: a number for a feature.
pub(crate) fn hash(words: &[u32]) -> u32 {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.fold(0x811C_9DC5, |hash: u32, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

/// Cases in an order in which each shows as much new as any could, as long as one shows something.
#[must_use]
pub fn by_novelty<C>(cases: Vec<(C, BTreeSet<u32>)>) -> Vec<C> {
    let mut rest = cases;
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
