//! Swarm options: each round of a run uses a random subset of what a conversation can have. What is never there lets the rest
//! stand out: a drive that forgets something after ten reads is not found where every third byte is damaged.

use super::Spiced;
use super::dice::Dice;
use std::collections::BTreeSet;

/// A subset of what a conversation can have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swarm<S>(BTreeSet<S>);

impl<S> Default for Swarm<S> {
    fn default() -> Self {
        Self(BTreeSet::new())
    }
}

/// How many cases a round has, all with the same subset.
pub const ROUND: u64 = 100;

impl<S: Spiced> Swarm<S> {
    /// The subset of a round of a run, of what there is. `least` is had where none of `needed` is.
    #[must_use]
    pub fn drawn(seed: u64, round: u64, all: &[S], (needed, least): (&[S], S)) -> Self {
        // Other numbers than those of the cases.
        let mut dice = Dice::of_part(!seed, round);
        let mut chosen: BTreeSet<_> = all.iter().copied().filter(|_| dice.percent(50)).collect();
        if !chosen.iter().any(|spice| needed.contains(spice)) {
            chosen.insert(least);
        }
        Self(chosen)
    }

    #[must_use]
    pub fn has(&self, spice: S) -> bool {
        self.0.contains(&spice)
    }

    /// What of these it has.
    #[must_use]
    pub fn of(&self, spices: &[S]) -> Vec<S> {
        let spices = spices.iter().copied();
        spices.filter(|spice| self.has(*spice)).collect()
    }

    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.0.iter().map(|spice| spice.name()).collect()
    }
}
