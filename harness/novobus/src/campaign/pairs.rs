//! Two faults in a conversation: every pair of a campaign's cases, or a sample of them.

use super::fault::{CaseFaults, Injected};
use super::file::{CampaignFile, MAX_CASES, Pairs};
use super::plan::cases;
use super::run::{Campaign, CaseOutcome, Contradiction};
use crate::campaign::class::CaseClass;
use harness_bench::campaign::share::share;
use harness_bench::counted::counted;
use harness_bench::partition::Partition;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// The most single faults of which all pairs are counted: what becomes of each is kept.
pub(super) const MOST_SINGLES: usize = 30_000;

/// Where the two faults of a pair are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Apart {
    /// In one byte.
    Byte,
    /// In two bytes of one link.
    Link,
    /// On two links.
    Links,
}

impl Apart {
    /// All of them, the closest first.
    pub const ALL: [Self; 3] = [Self::Byte, Self::Link, Self::Links];

    /// Where the faults of a pair are.
    #[must_use]
    pub fn of(case: &CaseFaults) -> Self {
        match case.second {
            Some(second) if second.link != case.first.link => Self::Links,
            Some(second) if second.byte != case.first.byte => Self::Link,
            _ => Self::Byte,
        }
    }

    /// The name in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Byte => "one byte",
            Self::Link => "one link",
            Self::Links => "two links",
        }
    }
}

/// How many pairs are of each class, by where their faults are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PairCounts {
    counts: [[u64; CaseClass::ALL.len()]; Apart::ALL.len()],
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
        let own = self.counts.iter_mut().flatten();
        for (own, other) in own.zip(other.counts.iter().flatten()) {
            *own += other;
        }
        self.closer += other.closer;
    }

    /// How many pairs there are of a class, with their faults so far apart.
    #[must_use]
    pub const fn count(&self, apart: Apart, class: CaseClass) -> u64 {
        self.counts[apart as usize][class as usize]
    }

    /// How many pairs there are of a class.
    #[must_use]
    pub fn of(&self, class: CaseClass) -> u64 {
        Apart::ALL.iter().map(|own| self.count(*own, class)).sum()
    }

    /// Of the located pairs on two links, those of which the link closer to the master's receiver was named.
    #[must_use]
    pub const fn closer(&self) -> u64 {
        self.closer
    }

    /// How many pairs were played.
    #[must_use]
    pub fn played(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    /// The counts by the names of where the faults are and of the class, in order.
    pub(super) fn named(&self) -> Vec<(String, u64)> {
        let names = Apart::ALL.iter().flat_map(|apart| {
            let classes = CaseClass::ALL.iter();
            classes.map(|class| format!("{}, {}", class.name(), apart.name()))
        });
        names.zip(self.counts.iter().flatten().copied()).collect()
    }

    /// The counts with these [names](Self::named), and [`Self::closer`]; `None` where the names are others.
    pub(super) fn of_named<'a>(
        named: impl Iterator<Item = (&'a str, u64)>,
        closer: u64,
    ) -> Option<Self> {
        let mut all = Self::default();
        let (names, counts): (Vec<_>, Vec<_>) = named.unzip();
        let own = all.named();
        let known = own.iter().map(|(name, _)| name.as_str());
        if !known.eq(names) {
            return None;
        }
        for (own, count) in all.counts.iter_mut().flatten().zip(counts) {
            *own = count;
        }
        all.closer = closer;
        Some(all)
    }
}

/// Pairs of a campaign that were counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlayedPairs {
    /// The campaign's name.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// How many single faults it has.
    pub singles: u64,
    /// The seed of a sample; `None` where every pair was counted.
    pub seed: Option<u32>,
    /// The part that was counted, of all pairs.
    pub part: Option<Partition>,
    /// The counts.
    pub counts: PairCounts,
}

/// Why the pairs of a campaign cannot be counted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PairsError {
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
        /// Which campaign.
        name: String,
        /// How many single faults it has.
        singles: u64,
    },
    /// A case fits no class.
    #[error(transparent)]
    Contradiction(#[from] Contradiction),
    /// Shared and played from the start, a case differs.
    #[error(
        "{campaign}: the case {case} is {shared} where cases share what they have in common, and {own} from the start; please report it"
    )]
    Differs {
        /// Of which campaign.
        campaign: String,
        /// Which case.
        case: String,
        /// Its class where cases share.
        shared: CaseClass,
        /// Its class when it is played from the start.
        own: CaseClass,
    },
}

/// Counts what `work` makes of each of this number of items, on several threads; each thread works on something of its own.
fn in_threads<W>(
    threads: usize,
    items: usize,
    own: impl Fn() -> W + Sync,
    work: impl Fn(&mut W, usize, &mut PairCounts) -> Result<(), PairsError> + Sync,
) -> Result<PairCounts, PairsError> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let all = Mutex::new(Ok(PairCounts::default()));
    let thread = || {
        let (mut own, mut counts) = (own(), PairCounts::default());
        let mut done = Ok(());
        while !failed.load(Ordering::Relaxed) && done.is_ok() {
            let item = next.fetch_add(1, Ordering::Relaxed);
            if item >= items {
                break;
            }
            done = work(&mut own, item, &mut counts);
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
    fn singles(&self) -> Result<Vec<Injected>, PairsError> {
        if self.file.pairs.is_some() || self.file.sample.is_some() {
            return Err(PairsError::NoSingles(self.name.clone()));
        }
        Ok(self.cases.iter().map(|case| case.first).collect())
    }

    /// How many pairs of its cases there are, if all of them or a sample of them can be played.
    ///
    /// # Errors
    /// Its cases are no single faults; or all pairs are to be counted, and they are too many or the driver plays them.
    pub fn pairs(&self, sampled: bool) -> Result<u64, PairsError> {
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
    pub fn pairs_of_part(&self, part: Partition) -> u64 {
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
    pub fn count_pairs(
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
            ..self.played_pairs(&singles, None, counts)
        })
    }

    /// Plays `sample` pairs of its cases that are drawn by `seed`, each on a ring of its own from the start. Where cases share what they
    /// have in common, each is played in that way too, and compared.
    ///
    /// # Errors
    /// Its cases are no single faults, a pair fits no class, or a comparison fails.
    pub fn sample_pairs(
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
                let (own, _) = self.play(case)?;
                if player.shares() {
                    self.compare(&player.play(case)?, &own)?;
                }
                counts.add(case, own.class, own.evidence.named, 1);
                progress(1);
                Ok(())
            },
        )?;
        Ok(self.played_pairs(&singles, Some(seed), counts))
    }

    fn compare(&self, shared: &CaseOutcome, own: &CaseOutcome) -> Result<(), PairsError> {
        if shared == own {
            return Ok(());
        }
        Err(PairsError::Differs {
            campaign: self.name.clone(),
            case: own.case.name(self.shape.drives),
            shared: shared.class,
            own: own.class,
        })
    }

    fn played_pairs(
        &self,
        singles: &[Injected],
        seed: Option<u32>,
        counts: PairCounts,
    ) -> PlayedPairs {
        PlayedPairs {
            name: self.name.trim_end_matches(".toml").to_owned(),
            title: self.file.title.clone(),
            singles: singles.len() as u64,
            seed,
            part: None,
            counts,
        }
    }
}

impl PlayedPairs {
    /// How many pairs there are.
    #[must_use]
    pub const fn pairs(&self) -> u64 {
        self.singles * self.singles.saturating_sub(1) / 2
    }

    /// The counts for people.
    #[must_use]
    pub fn table(&self) -> String {
        let counts = &self.counts;
        let (pairs, played) = (self.pairs(), counts.played());
        let what = match (self.seed, self.part) {
            (Some(seed), _) => format!("{played} of {pairs} pairs, seed {seed}"),
            (None, Some(part)) => format!("{played} of {pairs} pairs, part {part},"),
            (None, None) if played == pairs => format!("all {pairs} pairs"),
            (None, None) => format!("{played} of {pairs} pairs"),
        };
        let mut text = format!(
            "{}\n{}: {what} of {}\n\n",
            self.title,
            self.name,
            counted(self.singles, "fault")
        );
        let _infallible = write!(text, "  {:18}", "class");
        for apart in Apart::ALL {
            let _infallible = write!(text, " {:>11}", apart.name());
        }
        let _infallible = write!(text, " {:>11} {:>9}", "pairs", "share");
        if self.seed.is_some() {
            let _infallible = write!(text, "  of all, with 95 % confidence");
        }
        text.push('\n');
        for class in CaseClass::ALL {
            let _infallible = write!(text, "  {class:18}");
            for apart in Apart::ALL {
                let _infallible = write!(text, " {:>11}", counts.count(apart, class));
            }
            let all = counts.of(class);
            let _infallible = write!(text, " {all:>11} {:>9}", share(all, played));
            if self.seed.is_some() {
                let (low, high) = interval(all, played);
                let _infallible = write!(text, "  {:.3} to {:.3} %", 100.0 * low, 100.0 * high);
            }
            text.push('\n');
        }
        let located = counts.count(Apart::Links, CaseClass::Located);
        let _infallible = writeln!(
            text,
            "\n  Of the {located} located pairs on two links, {} named the link closer to the master's receiver.",
            counts.closer()
        );
        text
    }

    /// The counts for tools.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let of = |apart: Apart| {
            let classes = CaseClass::ALL.iter();
            let counts =
                classes.map(|own| (own.name().to_owned(), self.counts.count(apart, *own).into()));
            let counts: serde_json::Map<_, _> = counts.collect();
            serde_json::json!({ "apart": apart.name(), "classes": counts })
        };
        serde_json::json!({
            "name": self.name,
            "title": self.title,
            "faults": self.singles,
            "pairs": self.pairs(),
            "played": self.counts.played(),
            "seed": self.seed,
            "partition": self.part.map(|part| part.to_string()),
            "counts": Apart::ALL.map(of),
            "located_closer": self.counts.closer(),
        })
    }
}

/// Between which shares of all pairs the share of a class lies with 95 % confidence, if `part` of `sample` have it (Wilson's score
/// interval).
#[must_use]
pub fn interval(part: u64, sample: u64) -> (f64, f64) {
    const Z: f64 = 1.959_964;
    if sample == 0 {
        return (0.0, 1.0);
    }
    let count = sample as f64;
    let share = part as f64 / count;
    let middle = share + Z * Z / (2.0 * count);
    let half = Z * (share * (1.0 - share) / count + Z * Z / (4.0 * count * count)).sqrt();
    let whole = 1.0 + Z * Z / count;
    let low = if part == 0 {
        0.0
    } else {
        (middle - half) / whole
    };
    let high = if part == sample {
        1.0
    } else {
        (middle + half) / whole
    };
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::interval;

    /// Figures of Wilson's interval as tables print them.
    #[test]
    fn the_interval_of_a_share() {
        let close = |(low, high): (f64, f64), (a, b): (f64, f64)| {
            assert!(
                (low - a).abs() < 5e-4 && (high - b).abs() < 5e-4,
                "{low} {high}"
            );
        };
        close(interval(0, 10), (0.0, 0.2775));
        close(interval(5, 10), (0.2366, 0.7634));
        close(interval(10, 10), (0.7225, 1.0));
        close(interval(0, 0), (0.0, 1.0));
        close(interval(81, 263), (0.2553, 0.3662));
    }
}
