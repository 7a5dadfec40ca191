//! Two faults in a conversation: every pair of a campaign's cases, or a sample of them.

use super::fault::{CaseFaults, InjectedFault};
use super::file::{CampaignFile, MAX_CASES, Pairs};
use super::plan::cases;
use super::run::{Campaign, CaseOutcome, Contradiction};
use crate::campaign::class::CaseClass;
use harness_bench::campaign::pairs::{APART, FaultPairs, MOST_SINGLES, PlayedPairs};
use harness_bench::partition::Partition;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Where the two faults of a pair are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Apart {
    Byte,
    /// In two bytes of one link.
    Link,
    /// On two links.
    Links,
}

impl Apart {
    /// Where the faults of a pair are.
    #[must_use]
    pub(crate) fn of(case: &CaseFaults) -> Self {
        match case.second {
            Some(second) if second.link != case.first.link => Self::Links,
            Some(second) if second.byte != case.first.byte => Self::Link,
            _ => Self::Byte,
        }
    }
}

/// How many pairs are of each class, by where their faults are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PairCounts {
    counts: [[u64; CaseClass::ALL.len()]; APART.len()],
    /// Of the located pairs on two links, those of which the link closer to the master's receiver was named.
    closer: u64,
}

impl PairCounts {
    fn add(&mut self, case: &CaseFaults, class: CaseClass, named: Option<usize>, count: u64) {
        let apart = Apart::of(case);
        self.counts[apart as usize][class as usize] += count;
        let last = case.links().into_iter().max();
        if apart == Apart::Links && class == CaseClass::Located && named == last {
            self.closer += count;
        }
    }

    fn and(&mut self, other: &Self) {
        let counts = self.counts.iter_mut().flatten();
        for (counts, other) in counts.zip(other.counts.iter().flatten()) {
            *counts += other;
        }
        self.closer += other.closer;
    }
}

/// Why the pairs of a campaign cannot be counted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum PairsError {
    /// Its cases are pairs.
    #[error("the cases of {0} are pairs or a sample; name a campaign of all single faults")]
    NoSingles(String),
    /// The driver plays it.
    #[error(
        "the driver plays {0}: it looks at each byte, and its cases do not share; a sample of pairs can be played, see --sample"
    )]
    ByDriver(String),
    /// It has too many cases.
    #[error(
        "{name} has {singles} single faults, and all pairs of at most {MOST_SINGLES} are counted; name fewer links or bytes in its file, or use --sample"
    )]
    TooMany {
        name: String,
        /// How many single faults it has.
        singles: u64,
    },
    /// A case fits no class.
    #[error(transparent)]
    Contradiction(#[from] Contradiction),
    /// Shared and played from the start, a case differs.
    #[error(
        "{campaign}: the case {case} is {shared} where cases share what they have in common, and {alone} from the start; please report it"
    )]
    Differs {
        campaign: String,
        case: String,
        /// Its class where cases share.
        shared: CaseClass,
        /// Its class when it is played from the start.
        alone: CaseClass,
    },
}

/// Counts what `work` makes of each of this number of items, on several threads; each thread works on something of its own.
fn in_threads<W>(
    threads: usize,
    items: usize,
    worker: impl Fn() -> W + Sync,
    work: impl Fn(&mut W, usize, &mut PairCounts) -> Result<(), PairsError> + Sync,
) -> Result<PairCounts, PairsError> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let all = Mutex::new(Ok(PairCounts::default()));
    let thread = || {
        let (mut worker, mut counts) = (worker(), PairCounts::default());
        let mut done = Ok(());
        while !failed.load(Ordering::Relaxed) && done.is_ok() {
            let item = next.fetch_add(1, Ordering::Relaxed);
            if item >= items {
                break;
            }
            done = work(&mut worker, item, &mut counts);
        }
        failed.fetch_or(done.is_err(), Ordering::Relaxed);
        let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
        match (&mut *all, done) {
            (Ok(all), Ok(())) => all.and(&counts),
            (Ok(_), Err(error)) => *all = Err(error),
            (Err(_), _) => {}
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.clamp(1, items.max(1)) {
            scope.spawn(thread);
        }
        thread();
    });
    all.into_inner().unwrap_or_else(PoisonError::into_inner)
}

impl Campaign {
    /// Its cases, where they are all single faults.
    fn singles(&self) -> Result<Vec<InjectedFault>, PairsError> {
        if self.file.pairs.is_some() || self.file.sample.is_some() {
            return Err(PairsError::NoSingles(self.name.clone()));
        }
        Ok(self.cases.iter().map(|case| case.first).collect())
    }

    /// How many pairs of its cases there are, if all of them or a sample of them can be played.
    ///
    /// # Errors
    /// Its cases are no single faults; or all pairs are to be counted, and they are too many or the driver plays them.
    pub(crate) fn pairs(&self, sampled: bool) -> Result<u64, PairsError> {
        let singles = self.singles()?.len() as u64;
        if !sampled && self.sharing().is_none() {
            return Err(PairsError::ByDriver(self.name.clone()));
        }
        if !sampled && self.cases.len() > MOST_SINGLES {
            let name = self.name.clone();
            return Err(PairsError::TooMany { name, singles });
        }
        Ok(singles * singles.saturating_sub(1) / 2)
    }

    /// How many of all pairs of its cases are in this part: a pair belongs to the part of its second fault.
    #[must_use]
    pub(crate) fn pairs_of_part(&self, part: Partition) -> u64 {
        let wanted = self.in_part(Some(part));
        let seconds = (0..self.cases.len()).filter(|place| wanted(*place));
        seconds.map(|place| place as u64).sum()
    }

    /// Whether the single fault at a place belongs to the part.
    fn in_part(&self, part: Option<Partition>) -> impl Fn(usize) -> bool + '_ {
        move |place| {
            let name = || self.cases[place].name(self.shape.drives);
            part.is_none_or(|part| part.has(place, &name()))
        }
    }

    /// Counts what comes of every pair of its cases, or of those of a part ([`Self::pairs_of_part`]), on `threads` threads; `progress` is
    /// called with the number of pairs done since its last call. The counts do not depend on the number of threads.
    ///
    /// # Errors
    /// Its cases are no single faults or too many, the driver plays them, or a pair fits no class.
    pub(crate) fn count_pairs(
        &self,
        part: Option<Partition>,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, PairsError> {
        self.pairs(false)?;
        let singles = self.singles()?;
        let wanted = self.in_part(part);
        let links = usize::from(self.shape.drives) + 1;
        let counts = in_threads(
            threads,
            links,
            || self.sharing(),
            |sharing, item, counts| {
                // The last link has the most pairs.
                let link = links - 1 - item;
                let Some(sharing) = sharing else {
                    return Ok(());
                };
                sharing.pairs(&singles, link, &wanted, &mut |alike| {
                    let outcome = self.outcome(&alike.case, alike.evidence.clone())?;
                    let named = alike.evidence.named;
                    counts.add(&alike.case, outcome.class, named, alike.count);
                    progress(alike.count);
                    Ok(())
                })
            },
        )?;
        Ok(PlayedPairs {
            part,
            ..self.played_pairs(&singles, None, &counts)
        })
    }

    /// Plays `sample` pairs of its cases that are drawn by `seed`, each on a ring of its own from the start. Where cases share what they
    /// have in common, each is played in that way too, and compared.
    ///
    /// # Errors
    /// Its cases are no single faults, a pair fits no class, or a comparison fails.
    pub(crate) fn sample_pairs(
        &self,
        sample: u64,
        seed: u32,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, PairsError> {
        let singles = self.singles()?;
        let file = CampaignFile {
            pairs: Some(Pairs::Any),
            sample: Some(sample.clamp(1, MAX_CASES)),
            seed: Some(seed),
            ..self.file.clone()
        };
        // There are not too many: it is a sample.
        let pairs = cases(&file, &self.shape).unwrap_or_default();
        let counts = in_threads(
            threads,
            pairs.len(),
            || self.player(),
            |player, item, counts| {
                let Some(case) = pairs.get(item) else {
                    return Ok(());
                };
                let (alone, _) = self.play(case)?;
                if player.shares() {
                    self.compare(&player.play(case)?, &alone)?;
                }
                counts.add(case, alone.class, alone.evidence.named, 1);
                progress(1);
                Ok(())
            },
        )?;
        Ok(self.played_pairs(&singles, Some(seed), &counts))
    }

    fn compare(&self, shared: &CaseOutcome, alone: &CaseOutcome) -> Result<(), PairsError> {
        if shared == alone {
            return Ok(());
        }
        Err(PairsError::Differs {
            campaign: self.name.clone(),
            case: alone.case.name(self.shape.drives),
            shared: shared.class,
            alone: alone.class,
        })
    }

    fn played_pairs(
        &self,
        singles: &[InjectedFault],
        seed: Option<u32>,
        counts: &PairCounts,
    ) -> PlayedPairs {
        PlayedPairs {
            name: self.name.trim_end_matches(".toml").to_owned(),
            title: self.file.title.clone(),
            singles: singles.len() as u64,
            seed,
            part: None,
            classes: CaseClass::ALL.map(|class| class.name().to_owned()).into(),
            counts: counts.counts.map(Vec::from),
            closer: counts.closer,
        }
    }
}

impl FaultPairs for Campaign {
    fn all(&self, sampled: bool) -> Result<u64, String> {
        self.pairs(sampled).map_err(|error| error.to_string())
    }

    fn of_part(&self, part: Partition) -> u64 {
        self.pairs_of_part(part)
    }

    fn count(
        &self,
        part: Option<Partition>,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, String> {
        let counted = self.count_pairs(part, threads, progress);
        counted.map_err(|error| error.to_string())
    }

    fn sample(
        &self,
        (sample, seed): (u64, u32),
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, String> {
        let counted = self.sample_pairs(sample, seed, threads, progress);
        counted.map_err(|error| error.to_string())
    }
}
