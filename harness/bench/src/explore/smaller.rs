//! Shrinks a conversation of acts: as long as the same kind of difference remains, acts are dropped, and times and values are lowered.

use super::target::Target;
use super::{Differing as _, ExploreError, Finding, FuzzCase};

/// A conversation of acts with times between them.
pub trait Acts: FuzzCase {
    fn acts(&mut self) -> &mut Vec<Self::Act>;

    /// The time after an act, in microseconds.
    fn wait(act: &mut Self::Act) -> &mut u64;

    /// Acts that may show the same, the smallest first.
    fn simpler(act: &Self::Act) -> Vec<Self::Act>;

    /// Orders conversations by size.
    fn measure(&self) -> (usize, u64, u64);
}

/// The result of shrinking a finding.
#[derive(Clone, Debug)]
pub(crate) struct Smaller<C: FuzzCase> {
    pub finding: Finding<C>,
    /// Whether nothing more can be taken away.
    pub complete: bool,
}

/// Makes a finding small, in at most `most` runs on `target`.
///
/// # Errors
/// The target fails.
pub(crate) fn smaller<C: Acts>(
    finding: &Finding<C>,
    target: &mut dyn Target<C>,
    most: u32,
) -> Result<Smaller<C>, ExploreError> {
    let mut shrinker = Shrinker {
        target,
        best: finding.case.clone(),
        difference: finding.difference.clone(),
        runs: 0,
        most,
    };
    loop {
        let before = shrinker.best.measure();
        shrinker.leave_out()?;
        shrinker.hurry()?;
        shrinker.simplify()?;
        if shrinker.best.measure() == before || shrinker.is_spent() {
            break;
        }
    }
    Ok(Smaller {
        complete: !shrinker.is_spent(),
        finding: Finding {
            shrunk_in: Some(shrinker.runs),
            difference: shrinker.difference,
            case: shrinker.best,
            ..finding.clone()
        },
    })
}

struct Shrinker<'t, C: FuzzCase> {
    target: &'t mut dyn Target<C>,
    best: C,
    difference: C::Difference,
    runs: u32,
    most: u32,
}

impl<C: Acts> Shrinker<'_, C> {
    fn is_spent(&mut self) -> bool {
        self.runs >= self.most || self.target.over().is_some()
    }

    /// Takes a smaller case if it shows the same kind of difference.
    fn offer(&mut self, case: C) -> Result<bool, ExploreError> {
        if case.measure() >= self.best.measure() || self.is_spent() {
            return Ok(false);
        }
        let rehearsal = self.target.rehearse(&case)?;
        if rehearsal.denied.is_some() {
            return Ok(false);
        }
        self.runs += 1;
        self.target.begin();
        let tried = self.target.attempt(&case, &rehearsal)?;
        let found = tried.difference;
        let Some(difference) = found.filter(|found| found.is_like(&self.difference)) else {
            return Ok(false);
        };
        self.difference = difference;
        self.best = case;
        Ok(true)
    }

    /// Offers the case with one act changed.
    fn change(
        &mut self,
        at: usize,
        change: impl FnOnce(&mut C::Act),
    ) -> Result<bool, ExploreError> {
        let mut case = self.best.clone();
        if let Some(act) = case.acts().get_mut(at) {
            change(act);
        }
        self.offer(case)
    }

    fn count(&mut self) -> usize {
        self.best.acts().len()
    }

    /// Drops acts, long runs of them first. Their time is dropped too, or added to the act before them.
    fn leave_out(&mut self) -> Result<(), ExploreError> {
        let mut length = self.count();
        while length > 0 {
            let mut from = 0;
            while from < self.count() {
                let to = (from + length).min(self.count());
                let mut dropped = self.best.clone();
                let gone: u64 = dropped
                    .acts()
                    .drain(from..to)
                    .map(|mut act| *C::wait(&mut act))
                    .sum();
                let mut waits = dropped.clone();
                if let Some(act) = from.checked_sub(1).and_then(|at| waits.acts().get_mut(at)) {
                    *C::wait(act) += gone;
                }
                if !self.offer(dropped)? && !self.offer(waits)? {
                    from += length;
                }
            }
            length /= 2;
        }
        Ok(())
    }

    /// Lowers waits: to none, to that of a reply, to whole milliseconds, by halves.
    fn hurry(&mut self) -> Result<(), ExploreError> {
        for at in 0..self.count() {
            let Some(waited) = self.best.acts().get_mut(at).map(|act| *C::wait(act)) else {
                break;
            };
            let round = waited / 1_000 * 1_000;
            let steps = [0, 1_000, 2_000, 5_000, 10_000, 50_000, waited / 2, round];
            for wait in steps.into_iter().filter(|wait| *wait < waited) {
                if self.change(at, |act| *C::wait(act) = wait)? {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Replaces acts by simpler ones.
    fn simplify(&mut self) -> Result<(), ExploreError> {
        for at in 0..self.count() {
            loop {
                let Some(act) = self.best.acts().get(at).cloned() else {
                    break;
                };
                let mut taken = false;
                for simpler in C::simpler(&act) {
                    taken = self.change(at, |act| *act = simpler)?;
                    if taken {
                        break;
                    }
                }
                if !taken {
                    break;
                }
            }
        }
        Ok(())
    }
}
