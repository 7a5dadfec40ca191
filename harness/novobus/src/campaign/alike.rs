//! Every pair of single faults, counted and not listed.
//!
//! For each link, every case that is disturbed before it, or not at all, is taken to it once, and each fault of the link happens to that
//! ([`Sharing`]). What follows is played once for all faults that bring the drive behind the link into the same state, with the same
//! bytes sent on. No pair is left out or estimated.

use super::class::CaseEvidence;
use super::sharing::{Fork, Front, Sharing};
use crate::campaign::fault::{CaseFaults, InjectedFault};
use std::collections::{BTreeMap, HashMap};

/// Pairs of which the same comes.
#[derive(Debug)]
pub(crate) struct AlikePairs<'a> {
    /// One of them; the others have their faults on the same links, and in one byte or not as this one.
    pub(crate) case: CaseFaults,
    /// How many they are.
    pub(crate) count: u64,
    /// What comes of each.
    pub(crate) evidence: &'a CaseEvidence,
}

/// What faults of one link make of a front: with one of them, and how many do.
type Forks = Vec<(Fork, CaseFaults, u64)>;

/// The forks that were met, each with its place; the two faults of a pair are in one byte or not.
type Places = HashMap<(Fork, bool), usize>;

/// Counts a case for its fork.
fn add(forks: &mut Places, all: &mut Forks, fork: Fork, case: CaseFaults) {
    let place = |fault: &InjectedFault| (fault.link, fault.byte);
    let one_byte = case.second.as_ref().map(place) == Some(place(&case.first));
    let place = *forks.entry((fork, one_byte)).or_insert(all.len());
    match all.get_mut(place) {
        Some((_, _, count)) => *count += 1,
        None => all.push((fork, case, 1)),
    }
}

impl Sharing<'_> {
    /// Plays every pair of which the second fault is on link `link` and `wanted`, by its place in `singles`, and gives `found` what comes
    /// of them. `singles` are in the order of links.
    ///
    /// # Errors
    /// That of `found`.
    pub(crate) fn pairs<E>(
        &mut self,
        singles: &[InjectedFault],
        link: usize,
        wanted: &dyn Fn(usize) -> bool,
        found: &mut impl FnMut(AlikePairs<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let from = singles.partition_point(|single| single.link < link);
        let to = singles.partition_point(|single| single.link <= link);
        let (before, on_link) = (&singles[..from], &singles[from..to]);
        let wanted = |place: &usize| wanted(from + place);
        self.pairs_within(on_link, &wanted, found)?;
        // Faults that last longer have a longer opening.
        let mut by_length: BTreeMap<usize, Vec<InjectedFault>> = BTreeMap::new();
        for place in (0..on_link.len()).filter(&wanted) {
            let lasts = self.lasts(&on_link[place], None);
            by_length.entry(lasts).or_default().push(on_link[place]);
        }
        for alike in by_length.values() {
            self.pairs_across(before, alike, found)?;
        }
        Ok(())
    }

    /// Pairs of faults of one link, of which the second is `wanted`.
    fn pairs_within<E>(
        &mut self,
        on_link: &[InjectedFault],
        wanted: &impl Fn(&usize) -> bool,
        found: &mut impl FnMut(AlikePairs<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        for place in (0..on_link.len()).filter(wanted) {
            let second = &on_link[place];
            for first in &on_link[..place] {
                self.sound(self.lasts(first, Some(second)));
            }
            let mark = self.mark();
            let (mut forks, mut all) = (Places::new(), Forks::new());
            for first in &on_link[..place] {
                let case = CaseFaults {
                    first: *first,
                    second: Some(*second),
                };
                let front = self.sound(self.lasts(first, Some(second)));
                if let Some(fork) = self.fork(front, second.link, [first, second]) {
                    add(&mut forks, &mut all, fork, case);
                }
            }
            self.play_all(&all, 1, found)?;
            self.forget_after(mark);
        }
        Ok(())
    }

    /// Pairs of a fault of `before` and one of `alike`, which are on one link behind and last equally long.
    fn pairs_across<E>(
        &mut self,
        before: &[InjectedFault],
        alike: &[InjectedFault],
        found: &mut impl FnMut(AlikePairs<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(any) = alike.first() else {
            return Ok(());
        };
        let mut places: HashMap<Front, usize> = HashMap::new();
        let mut fronts: Vec<(Front, InjectedFault, u64)> = Vec::new();
        for first in before {
            let lasts = self.lasts(first, Some(any));
            let Some(front) = self.damaged(lasts, first) else {
                continue;
            };
            let place = *places.entry(front).or_insert(fronts.len());
            match fronts.get_mut(place) {
                Some((_, _, count)) => *count += 1,
                None => fronts.push((front, *first, 1)),
            }
        }
        let mark = self.mark();
        // Fronts that bring the link the same bytes fork in the same way.
        let mut known: HashMap<_, Forks> = HashMap::new();
        for (front, first, times) in fronts {
            let arriving = self.arriving(front, any.link);
            let mut all = match known.remove(&arriving) {
                Some(all) => all,
                None => self.forks(front, alike),
            };
            for (fork, case, _) in &mut all {
                *fork = fork.of(front);
                case.first = first;
            }
            self.play_all(&all, times, found)?;
            known.insert(arriving, all);
            if self.forget_after(mark) {
                known.clear();
            }
        }
        Ok(())
    }

    /// How a front forks by each of these faults of one link.
    fn forks(&mut self, front: Front, faults: &[InjectedFault]) -> Forks {
        let (mut forks, mut all) = (Places::new(), Forks::new());
        for second in faults {
            if let Some(fork) = self.fork(front, second.link, [second]) {
                let case = CaseFaults {
                    first: *second,
                    second: Some(*second),
                };
                add(&mut forks, &mut all, fork, case);
            }
        }
        all
    }

    fn play_all<E>(
        &mut self,
        all: &Forks,
        times: u64,
        found: &mut impl FnMut(AlikePairs<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        for (fork, case, count) in all {
            let evidence = self.evidence(*fork);
            found(AlikePairs {
                case: *case,
                count: count * times,
                evidence: &evidence,
            })?;
        }
        Ok(())
    }
}
