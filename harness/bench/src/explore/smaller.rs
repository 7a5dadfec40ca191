//! Shrinks a finding: removes what is not needed to reproduce it and simplifies the rest.
//!
//! Every accepted step lowers the measure of the conversation, so shrinking ends. The order of the steps is fixed, so the result is
//! reproducible. On hardware the runs dominate the cost, so the steps that remove most come first: everything after the difference, then
//! acts, drives, and at last parts of acts, time and values.

use super::target::Target;
use super::{Differing as _, ExploreError, Finding, FuzzCase};
use std::collections::BTreeSet;
use std::ops::Range;

/// A conversation that can be shrunk.
pub trait Shrinkable: FuzzCase {
    /// Orders conversations by size.
    type Measure: Ord;

    /// How many acts are left at first where runs of acts are left out, long runs first.
    const FIRST_LEFT: usize = 0;

    fn measure(&self) -> Self::Measure;

    fn acts(&mut self) -> &mut Vec<Self::Act>;

    /// Acts that may show the same, the smallest first.
    fn simpler(act: &Self::Act) -> Vec<Self::Act>;

    /// The conversation without these acts, in one way or in several.
    fn without(&self, acts: Range<usize>) -> Vec<Self> {
        let mut rest = self.clone();
        drop(rest.acts().drain(acts));
        vec![rest]
    }

    /// The conversation up to a difference, the shortest first.
    fn up_to(&self, _: &Self::Difference) -> Vec<Self> {
        Vec::new()
    }

    /// Subjects with simpler drives, or with another simplification of several acts.
    fn reduced(_: &Subject<Self>) -> Vec<Subject<Self>> {
        Vec::new()
    }
}

/// What is shrunk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Subject<C: FuzzCase> {
    pub case: C,
    /// What its drives are made of.
    pub setup: C::Setup,
}

/// The result of shrinking.
#[derive(Clone, Debug)]
pub struct ShrinkOutcome<C: FuzzCase> {
    /// The smallest subject found.
    pub subject: Subject<C>,
    /// How its drives differ from the expected behaviour.
    pub difference: C::Difference,
    pub runs: u32,
    /// Whether nothing more could be removed; false if the limit of runs was reached first.
    pub complete: bool,
}

/// Numbers of repetitions to try in place of `count`, the smallest first.
pub fn fewer(count: u8) -> impl Iterator<Item = u8> {
    let tried = [1, count / 2, count - count / 4, count.saturating_sub(1)].into_iter();
    tried.filter(move |fewer| (1..count).contains(fewer))
}

impl<C: FuzzCase> Finding<C> {
    /// What is shrunk of it.
    #[must_use]
    pub fn subject(&self) -> Subject<C> {
        Subject {
            case: self.case.clone(),
            setup: self.setup.clone(),
        }
    }

    /// The finding after it was shrunk.
    #[must_use]
    pub fn shrunk(&self, small: ShrinkOutcome<C>) -> Self {
        Self {
            shrunk_in: Some(small.runs),
            difference: small.difference,
            setup: small.subject.setup,
            case: small.subject.case,
            attempts: Vec::new(),
            ..self.clone()
        }
    }
}

/// How the drives of a target differ in a subject's conversation; `None` if they do not, or if it is not permitted.
///
/// # Errors
/// The target fails.
pub(crate) fn asked<C: FuzzCase>(
    subject: &Subject<C>,
    target: &mut dyn Target<C>,
) -> Result<Option<C::Difference>, ExploreError> {
    let rehearsal = target.rehearse(&subject.case)?;
    if rehearsal.denied.is_some() {
        return Ok(None);
    }
    target.begin();
    Ok(target.attempt(&subject.case, &rehearsal)?.difference)
}

/// Tries a subject and returns how its drives differ from the expected behaviour, or `None` if they do not.
pub type SubjectJudge<'a, C> =
    dyn FnMut(&Subject<C>) -> Result<Option<<C as FuzzCase>::Difference>, ExploreError> + 'a;

/// Shrinks a subject in at most `most_runs` runs. The result differs in the same way as `difference`.
///
/// # Errors
/// A run is not possible.
pub fn shrink<C: Shrinkable>(
    subject: Subject<C>,
    difference: C::Difference,
    most_runs: u32,
    ask: &mut SubjectJudge<'_, C>,
) -> Result<ShrinkOutcome<C>, ExploreError> {
    let mut shrinker = Shrinker {
        best: subject,
        first: difference.clone(),
        difference,
        tried: BTreeSet::new(),
        runs: 0,
        most_runs,
        ask,
    };
    loop {
        let before = shrinker.best.case.measure();
        shrinker.pass()?;
        if shrinker.is_spent() || shrinker.best.case.measure() == before {
            break;
        }
    }
    Ok(ShrinkOutcome {
        complete: !shrinker.is_spent(),
        subject: shrinker.best,
        difference: shrinker.difference,
        runs: shrinker.runs,
    })
}

struct Shrinker<'a, 'b, C: FuzzCase> {
    best: Subject<C>,
    first: C::Difference,
    difference: C::Difference,
    /// Subjects already tried.
    tried: BTreeSet<String>,
    runs: u32,
    most_runs: u32,
    ask: &'a mut SubjectJudge<'b, C>,
}

impl<C: Shrinkable> Shrinker<'_, '_, C> {
    const fn is_spent(&self) -> bool {
        self.runs >= self.most_runs
    }

    /// Tries a smaller candidate and accepts it if it shows the same kind of difference.
    fn offer(&mut self, mut candidate: Subject<C>) -> Result<bool, ExploreError> {
        let smaller = candidate.case.measure() < self.best.case.measure();
        if !smaller || candidate.case.acts().is_empty() || self.is_spent() {
            return Ok(false);
        }
        if !self.tried.insert(format!("{candidate:?}")) {
            return Ok(false);
        }
        self.runs += 1;
        match (self.ask)(&candidate)? {
            Some(difference) if difference.is_like(&self.first) => {
                self.difference = difference;
                self.best = candidate;
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Offers the candidates that `of` makes of the best subject. After each accepted one, `of` makes the rest from the new best subject.
    fn offer_each(
        &mut self,
        of: impl Fn(&mut Subject<C>, &C::Difference) -> Vec<Subject<C>>,
    ) -> Result<(), ExploreError> {
        let mut at = 0;
        while let Some(candidate) = of(&mut self.best, &self.difference).into_iter().nth(at) {
            at += usize::from(!self.offer(candidate)?);
        }
        Ok(())
    }

    fn pass(&mut self) -> Result<(), ExploreError> {
        let with = |best: &Subject<C>, case| Subject {
            case,
            setup: best.setup.clone(),
        };
        self.offer_each(|best, difference| {
            let cut = best.case.up_to(difference).into_iter();
            cut.map(|case| with(best, case)).collect()
        })?;
        let mut length = self.count().saturating_sub(C::FIRST_LEFT);
        while length > 0 {
            let mut from = 0;
            while from < self.count() {
                let to = (from + length).min(self.count());
                let mut dropped = false;
                for case in self.best.case.without(from..to) {
                    dropped = self.offer(with(&self.best, case))?;
                    if dropped {
                        break;
                    }
                }
                if !dropped {
                    from += length;
                }
            }
            length = (length / 2).min(self.count());
        }
        self.offer_each(|best, _| C::reduced(best))?;
        let mut at = 0;
        while at < self.count() {
            self.offer_each(|best, _| {
                let simpler = C::simpler(&best.case.acts()[at]).into_iter();
                let changed = simpler.map(|act| {
                    let mut case = best.case.clone();
                    case.acts()[at] = act;
                    with(best, case)
                });
                changed.collect()
            })?;
            at += 1;
        }
        Ok(())
    }

    fn count(&mut self) -> usize {
        self.best.case.acts().len()
    }
}
