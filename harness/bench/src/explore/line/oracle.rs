//! Whether drives do what their manual says, with any values of its open points.
//!
//! What the drives sent is compared with what the model sends. Where it differs, the model is played again with other values of the open
//! points (`qualify::search`). Only what no such model explains is a difference.

use super::{LineBus, LineTalk, Seen};
use crate::qualify::search::{SearchOutcome, SearchWay, explain};

/// How unlike a piece and none are.
const UNLIKE: i64 = 1_000_000;

const WAY: SearchWay = SearchWay {
    most_changed: 8,
    followed: 3,
    all: false,
};

/// The outcome of a conversation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Judgement<D> {
    /// Some values of the open points explain everything.
    Explained,
    /// No model does; the best one is this.
    Differs(Box<D>),
    /// Too many models would have to be played.
    Undecided,
}

/// Judges conversations on one line.
#[derive(Clone, Debug)]
pub(crate) struct Oracle<B: LineBus> {
    under_test: B::Setup,
    begins: Vec<Vec<B::Properties>>,
    /// What explained the last conversation.
    last: Vec<B::Properties>,
}

impl<B: LineBus> Oracle<B> {
    /// Judges these drives.
    pub(crate) fn new(under_test: B::Setup) -> Self {
        let begins = B::begins(&under_test);
        Self {
            last: begins.first().cloned().unwrap_or_default(),
            begins,
            under_test,
        }
    }

    pub(crate) const fn under_test(&self) -> &B::Setup {
        &self.under_test
    }

    /// The drives as the manual has them, with the most likely values of its open points.
    pub(crate) fn model(&self) -> B::Setup {
        B::model(&self.under_test, &self.last)
    }

    /// Judges what the drives under test have done in a conversation.
    pub(crate) fn judge(&mut self, talk: &LineTalk<B>, seen: &Seen<B>) -> Judgement<B::Difference> {
        let under_test = &self.under_test;
        let play = |values: &Vec<_>| B::play(&B::model(under_test, values), talk);
        // Pieces before the first difference, and how like this one is.
        let agreement = |values: &Vec<_>| {
            let expected = play(values);
            let place = first::<B>(&expected, seen)?;
            let unlike = match (expected.said.get(place), seen.said.get(place)) {
                (Some(expected), Some(seen)) => B::unlike(expected, seen),
                _ => UNLIKE,
            };
            Some((place, -unlike))
        };
        let neighbours = |values: &Vec<_>| {
            let near = |place| B::neighbours(under_test, place, &values[place]).into_iter();
            let changed = |place: usize| {
                near(place).map(move |changed| {
                    let mut next = values.clone();
                    next[place] = changed;
                    next
                })
            };
            (0..values.len()).flat_map(changed).collect()
        };
        let begins = std::iter::once(&self.last).chain(&self.begins).cloned();
        match explain(begins, WAY, agreement, neighbours, |_, _| Vec::new()) {
            SearchOutcome::By(mut found) => {
                self.last = found.swap_remove(0);
                Judgement::Explained
            }
            SearchOutcome::Not(best) => {
                let expected = play(&best);
                let under = B::lines(&self.under_test, &best);
                let found = first::<B>(&expected, seen).and_then(|place| {
                    B::difference(&self.under_test, place, (&expected, seen), under)
                });
                found.map_or(Judgement::Undecided, |difference| {
                    Judgement::Differs(Box::new(difference))
                })
            }
            SearchOutcome::Undecided => Judgement::Undecided,
        }
    }
}

/// The place of the first piece that differs.
fn first<B: LineBus>(expected: &Seen<B>, seen: &Seen<B>) -> Option<usize> {
    let (expected, seen) = (&expected.said, &seen.said);
    let shorter = expected.len().min(seen.len());
    let place = expected.iter().zip(seen).position(|(a, b)| !B::same(a, b));
    place.or((expected.len() != seen.len()).then_some(shorter))
}
