//! Whether drives do what their manual says, with any values of its open points.
//!
//! What the drives sent is compared with what the model sends. Where it differs, the model is played again with other values of the open
//! points (`explore::search`). Only what no such model explains is a difference.

use super::{LineBus, LineTalk, Seen};
use crate::explore::search::{ModelSpace, SearchOutcome, explain};

/// How unlike a piece and none are.
const UNLIKE: i64 = 1_000_000;

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
        let played = TalkReplay {
            under_test: &self.under_test,
            talk,
            seen,
        };
        let begins = std::iter::once(&self.last).chain(&self.begins);
        match explain(&played, begins.cloned()) {
            SearchOutcome::By(found) => {
                self.last = found;
                Judgement::Explained
            }
            SearchOutcome::Not(best) => {
                let expected = played.expected(&best);
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

/// A conversation that was played on the drives under test.
struct TalkReplay<'p, B: LineBus> {
    under_test: &'p B::Setup,
    talk: &'p LineTalk<B>,
    seen: &'p Seen<B>,
}

impl<B: LineBus> TalkReplay<'_, B> {
    fn expected(&self, values: &[B::Properties]) -> Seen<B> {
        B::play(&B::model(self.under_test, values), self.talk)
    }
}

impl<B: LineBus> ModelSpace for TalkReplay<'_, B> {
    type Assumed = Vec<B::Properties>;
    /// Pieces before the first difference, and how like this one is.
    type Agreement = (usize, i64);

    fn agreement(&self, assumed: &Self::Assumed) -> Option<(usize, i64)> {
        let expected = self.expected(assumed);
        let place = first::<B>(&expected, self.seen)?;
        let unlike = match (expected.said.get(place), self.seen.said.get(place)) {
            (Some(expected), Some(seen)) => B::unlike(expected, seen),
            _ => UNLIKE,
        };
        Some((place, -unlike))
    }

    fn neighbours(&self, assumed: &Self::Assumed) -> Vec<Self::Assumed> {
        let mut all = Vec::new();
        for (place, properties) in assumed.iter().enumerate() {
            for changed in B::neighbours(self.under_test, place, properties) {
                let mut next = assumed.clone();
                next[place] = changed;
                all.push(next);
            }
        }
        all
    }
}

/// The place of the first piece that differs.
fn first<B: LineBus>(expected: &Seen<B>, seen: &Seen<B>) -> Option<usize> {
    let (expected, seen) = (&expected.said, &seen.said);
    let shorter = expected.len().min(seen.len());
    let place = expected.iter().zip(seen).position(|(a, b)| !B::same(a, b));
    place.or((expected.len() != seen.len()).then_some(shorter))
}
