//! The search for a model that explains what drives did.
//!
//! What a manual leaves open can have several values. A model is played with some of them; where it differs from what was seen, one value
//! after the other is changed, as long as that explains more. Only what no such model explains is a difference.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::fmt::Debug;

/// The models that are played at most to explain one conversation. Beyond them it is not judged.
const MOST_PLAYED: usize = 2_000;

/// How a search goes on.
#[derive(Clone, Copy, Debug)]
pub struct SearchWay {
    /// How many values in a row are changed at most.
    pub most_changed: usize,
    /// Of the changes that explain more, how many are followed.
    pub followed: usize,
    /// Whether all neighbours are played, however many they are, for all that explain everything.
    pub all: bool,
}

/// Values, and how far the model with them agrees, where more is better; `None` if it explains all.
pub type JudgedValues<A, G> = (Option<G>, A);

/// The outcome of a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SearchOutcome<A> {
    /// Models with these values explain all.
    By(Vec<A>),
    /// No model explains all; the one with these values explains most.
    Not(A),
    /// Too many models would have to be played.
    Undecided,
}

/// Looks for values that explain what was seen, beginning with each of `begins`. `agreement` plays a model, `neighbours` are the values that
/// differ in one open point, and `pairs` those that are tried where no neighbour explains more.
pub fn explain<A: Clone + Debug, G: Copy + Ord>(
    begins: impl IntoIterator<Item = A>,
    way: SearchWay,
    mut agreement: impl FnMut(&A) -> Option<G>,
    neighbours: impl Fn(&A) -> Vec<A>,
    pairs: impl Fn(G, &[JudgedValues<A, G>]) -> Vec<A>,
) -> SearchOutcome<A> {
    let mut search = Search {
        way,
        agreement: &mut agreement,
        neighbours: &neighbours,
        pairs: &pairs,
        tried: BTreeSet::new(),
        best: None,
    };
    for begin in begins {
        let Some(agreement) = search.agreement(&begin) else {
            return SearchOutcome::By(vec![begin]);
        };
        let found = search.from(agreement, &begin, way.most_changed);
        if !found.is_empty() {
            return SearchOutcome::By(found);
        }
    }
    match search.best {
        Some((_, best)) if search.tried.len() < MOST_PLAYED => SearchOutcome::Not(best),
        _ => SearchOutcome::Undecided,
    }
}

type Pairs<'p, A, G> = dyn Fn(G, &[JudgedValues<A, G>]) -> Vec<A> + 'p;

struct Search<'s, A, G> {
    way: SearchWay,
    agreement: &'s mut dyn FnMut(&A) -> Option<G>,
    neighbours: &'s dyn Fn(&A) -> Vec<A>,
    pairs: &'s Pairs<'s, A, G>,
    /// What was played, by its words.
    tried: BTreeSet<String>,
    best: Option<(G, A)>,
}

impl<A: Clone + Debug, G: Copy + Ord> Search<'_, A, G> {
    /// Follows changes that explain more. Empty if none of them explains all.
    fn from(&mut self, so_far: G, begin: &A, left: usize) -> Vec<A> {
        if left == 0 {
            return Vec::new();
        }
        let more = |(agreed, _): &JudgedValues<A, G>| agreed.is_none_or(|agreed| agreed > so_far);
        let mut judged = self.judged((self.neighbours)(begin));
        if !judged.iter().any(more) {
            judged = self.judged((self.pairs)(so_far, &judged));
        }
        judged.retain(more);
        let explain_all = judged.iter().filter(|(agreed, _)| agreed.is_none());
        let explain_all: Vec<_> = explain_all.map(|(_, found)| found.clone()).collect();
        if !explain_all.is_empty() {
            return explain_all;
        }
        judged.sort_by_key(|(agreed, _)| Reverse(*agreed));
        judged
            .into_iter()
            .take(self.way.followed)
            .filter_map(|(agreed, next)| Some(self.from(agreed?, &next, left - 1)))
            .find(|found| !found.is_empty())
            .unwrap_or_default()
    }

    fn judged(&mut self, values: Vec<A>) -> Vec<JudgedValues<A, G>> {
        let mut judged = Vec::new();
        for next in values {
            let all = self.way.all;
            if all || self.tried.len() < MOST_PLAYED && self.tried.insert(format!("{next:?}")) {
                let agreed = self.agreement(&next);
                judged.push((agreed, next));
                if agreed.is_none() && !all {
                    break;
                }
            }
        }
        judged
    }

    fn agreement(&mut self, assumed: &A) -> Option<G> {
        let agreement = (self.agreement)(assumed)?;
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
    fn digits(wanted: [u8; 4]) -> SearchOutcome<[u8; 4]> {
        let way = SearchWay {
            most_changed: 8,
            followed: 3,
            all: false,
        };
        let agreement = |assumed: &[u8; 4]| (0..4).position(|at| wanted[at] != assumed[at]);
        let neighbours = |assumed: &[u8; 4]| {
            let all = (0..4).flat_map(|place| (0..9).map(move |digit| (place, digit)));
            let changed = all.map(|(place, digit)| {
                let mut other = *assumed;
                other[place] = digit;
                other
            });
            changed.filter(|other| other != assumed).collect()
        };
        explain([[0; 4]], way, agreement, neighbours, |_, _| Vec::new())
    }

    #[test]
    fn several_values_are_changed_in_a_row() {
        let found = digits([3, 1, 4, 1]);
        assert_eq!(found, SearchOutcome::By(vec![[3, 1, 4, 1]]));
    }

    #[test]
    fn what_no_value_explains_is_a_difference() {
        let SearchOutcome::Not(best) = digits([3, 1, 9, 1]) else {
            panic!("it is not explained");
        };
        assert_eq!(best[..2], [3, 1]);
    }
}
