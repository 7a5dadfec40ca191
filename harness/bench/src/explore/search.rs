//! The search for a model that explains what drives did.
//!
//! What a manual leaves open can have several values. A model is played with some of them; where it differs from what was seen, one value
//! after the other is changed, as long as that explains more. Only what no such model explains is a difference.

use std::collections::BTreeSet;
use std::fmt::Debug;

/// The models that are played at most to explain one conversation. Beyond them it is not judged.
const MOST_PLAYED: usize = 2_000;

/// How many values in a row are changed at most.
const MOST_CHANGED: usize = 8;

/// Of the changes that explain more, how many are followed.
const FOLLOWED: usize = 3;

/// A conversation that was seen, and models of its drives.
pub trait ModelSpace {
    /// Values of the open points of all drives.
    type Assumed: Clone + Debug;
    /// How far a model agrees with what was seen. More is better.
    type Agreement: Copy + Ord;

    /// How far the model with these values agrees; `None` if it explains all.
    fn agreement(&self, assumed: &Self::Assumed) -> Option<Self::Agreement>;

    /// All values that differ from these in one open point.
    fn neighbours(&self, assumed: &Self::Assumed) -> Vec<Self::Assumed>;
}

/// The outcome of a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SearchOutcome<A> {
    /// A model with these values explains all.
    By(A),
    /// No model explains all; the one with these values explains most.
    Not(A),
    /// Too many models would have to be played.
    Undecided,
}

/// Looks for values that explain what was seen, beginning with each of `begins`.
pub fn explain<E: ModelSpace>(
    seen: &E,
    begins: impl IntoIterator<Item = E::Assumed>,
) -> SearchOutcome<E::Assumed> {
    let mut search = Search {
        seen,
        tried: BTreeSet::new(),
        best: None,
    };
    for begin in begins {
        if let Some(found) = search.from(begin, MOST_CHANGED) {
            return SearchOutcome::By(found);
        }
    }
    match search.best {
        Some((_, best)) if search.tried.len() < MOST_PLAYED => SearchOutcome::Not(best),
        _ => SearchOutcome::Undecided,
    }
}

struct Search<'s, E: ModelSpace> {
    seen: &'s E,
    /// What was played, by its words.
    tried: BTreeSet<String>,
    best: Option<(E::Agreement, E::Assumed)>,
}

impl<E: ModelSpace> Search<'_, E> {
    /// Follows changes that explain more. `None` if none of them explains all.
    fn from(&mut self, begin: E::Assumed, left: usize) -> Option<E::Assumed> {
        let Some(agreement) = self.agreement(&begin) else {
            return Some(begin);
        };
        if left == 0 {
            return None;
        }
        let mut better = Vec::new();
        for next in self.seen.neighbours(&begin) {
            let words = format!("{next:?}");
            if self.tried.len() >= MOST_PLAYED || !self.tried.insert(words) {
                continue;
            }
            match self.agreement(&next) {
                None => return Some(next),
                Some(other) if other > agreement => better.push((other, next)),
                Some(_) => {}
            }
        }
        better.sort_by_key(|(agreement, _)| std::cmp::Reverse(*agreement));
        better.truncate(FOLLOWED);
        better
            .into_iter()
            .find_map(|(_, next)| self.from(next, left - 1))
    }

    fn agreement(&mut self, assumed: &E::Assumed) -> Option<E::Agreement> {
        let agreement = self.seen.agreement(assumed)?;
        if self.best.as_ref().is_none_or(|(best, _)| *best < agreement) {
            self.best = Some((agreement, assumed.clone()));
        }
        Some(agreement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A number is explained digit by digit; nines cannot be assumed.
    struct Digits([u8; 4]);

    impl ModelSpace for Digits {
        type Assumed = [u8; 4];
        type Agreement = usize;

        fn agreement(&self, assumed: &[u8; 4]) -> Option<usize> {
            self.0
                .iter()
                .zip(assumed)
                .position(|(wanted, value)| wanted != value)
        }

        fn neighbours(&self, assumed: &[u8; 4]) -> Vec<[u8; 4]> {
            let all = (0..4).flat_map(|place| (0..9).map(move |digit| (place, digit)));
            let changed = all.map(|(place, digit)| {
                let mut other = *assumed;
                other[place] = digit;
                other
            });
            changed.filter(|other| other != assumed).collect()
        }
    }

    #[test]
    fn several_values_are_changed_in_a_row() {
        let found = explain(&Digits([3, 1, 4, 1]), [[0; 4]]);
        assert_eq!(found, SearchOutcome::By([3, 1, 4, 1]));
    }

    #[test]
    fn what_no_value_explains_is_a_difference() {
        let SearchOutcome::Not(best) = explain(&Digits([3, 1, 9, 1]), [[0; 4]]) else {
            panic!("it is not explained");
        };
        assert_eq!(best[..2], [3, 1]);
    }
}
