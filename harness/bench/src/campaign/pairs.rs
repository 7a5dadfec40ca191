//! Two faults in a conversation: the counts of every pair of a campaign's cases, or of a sample of them.

use super::share::share;
use crate::counted::counted;
use crate::partition::Partition;
use std::fmt::Write as _;

/// The most single faults of which all pairs are counted: what becomes of each is kept.
pub const MOST_SINGLES: usize = 30_000;

/// Where the two faults of a pair are, the closest first.
pub const APART: [&str; 3] = ["one byte", "one link", "two links"];

/// The class of pairs of which a damaged link was named.
pub const LOCATED: &str = "located";

/// A campaign of single faults, of which pairs can be played.
pub trait FaultPairs {
    /// How many pairs there are, if all of them or a sample of them can be played.
    ///
    /// # Errors
    /// Its cases are no single faults; or all pairs are to be counted, and they are too many or cannot share what they have in common.
    fn all(&self, sampled: bool) -> Result<u64, String>;

    /// How many pairs are in this part: a pair belongs to the part of its second fault.
    fn of_part(&self, part: Partition) -> u64;

    /// Counts every pair, or those of a part.
    ///
    /// # Errors
    /// As [`Self::all`]; or a pair fits no class.
    fn count(
        &self,
        part: Option<Partition>,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, String>;

    /// Plays this number of pairs, drawn by a seed.
    ///
    /// # Errors
    /// As [`Self::count`].
    fn sample(
        &self,
        drawn: (u64, u32),
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedPairs, String>;
}

/// Pairs of a campaign that were counted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlayedPairs {
    pub name: String,
    /// What it shows.
    pub title: String,
    /// How many single faults it has.
    pub singles: u64,
    /// The seed of a sample; `None` where every pair was counted.
    pub seed: Option<u32>,
    /// The part that was counted, of all pairs.
    pub part: Option<Partition>,
    /// The names of the classes, the least serious first.
    pub classes: Vec<String>,
    /// How many pairs there are of each class, for each of [`APART`].
    pub counts: [Vec<u64>; APART.len()],
    /// Of the located pairs on two links, those of which the link closer to the master's receiver was named.
    pub closer: u64,
}

impl PlayedPairs {
    /// How many pairs there are.
    #[must_use]
    pub const fn pairs(&self) -> u64 {
        self.singles * self.singles.saturating_sub(1) / 2
    }

    fn played(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    /// The located pairs on two links.
    #[must_use]
    pub fn located(&self) -> u64 {
        let place = self.classes.iter().position(|class| class == LOCATED);
        let [.., links] = &self.counts;
        place
            .and_then(|place| links.get(place))
            .map_or(0, |count| *count)
    }

    /// The counts by the names of the class and of where the faults are, in order.
    #[must_use]
    pub fn named(&self) -> Vec<(String, u64)> {
        let apart = APART.iter().zip(&self.counts);
        let named = apart.flat_map(|(apart, counts)| {
            let classes = self.classes.iter().zip(counts);
            classes.map(move |(class, count)| (format!("{class}, {apart}"), *count))
        });
        named.collect()
    }

    /// The classes and counts of these [names](Self::named); `None` where they are others.
    pub(super) fn of_named(
        named: &[(&str, u64)],
    ) -> Option<(Vec<String>, [Vec<u64>; APART.len()])> {
        let most = named.len() / APART.len();
        let first = named.get(..most)?.iter();
        let classes = first.map(|(name, _)| name.strip_suffix(", one byte").map(str::to_owned));
        let classes: Vec<String> = classes.collect::<Option<_>>()?;
        let of = |apart: usize| -> Option<Vec<u64>> {
            let part = named.get(apart * most..(apart + 1) * most)?.iter();
            let both = part.zip(&classes);
            both.map(|((name, count), class)| {
                (*name == format!("{class}, {}", APART[apart])).then_some(*count)
            })
            .collect()
        };
        let counts = [of(0)?, of(1)?, of(2)?];
        (most > 0 && named.len() == most * APART.len()).then_some((classes, counts))
    }

    /// The counts for people.
    #[must_use]
    pub fn table(&self) -> String {
        let (pairs, played) = (self.pairs(), self.played());
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
        // Writing to a String cannot fail.
        let _infallible = write!(text, "  {:18}", "class");
        for apart in APART {
            let _infallible = write!(text, " {apart:>11}");
        }
        let _infallible = write!(text, " {:>11} {:>9}", "pairs", "share");
        if self.seed.is_some() {
            let _infallible = write!(text, "  of all, with 95 % confidence");
        }
        text.push('\n');
        for (place, class) in self.classes.iter().enumerate() {
            let _infallible = write!(text, "  {class:18}");
            let counts = || self.counts.iter().map(|counts| counts[place]);
            for count in counts() {
                let _infallible = write!(text, " {count:>11}");
            }
            let all: u64 = counts().sum();
            let _infallible = write!(text, " {all:>11} {:>9}", share(all, played));
            if self.seed.is_some() {
                let (low, high) = interval(all, played);
                let _infallible = write!(text, "  {:.3} to {:.3} %", 100.0 * low, 100.0 * high);
            }
            text.push('\n');
        }
        let _infallible = writeln!(
            text,
            "\n  Of the {} located pairs on two links, {} named the link closer to the master's receiver.",
            self.located(),
            self.closer
        );
        text
    }

    /// The counts for tools.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let of = |(apart, counts): (&&str, &Vec<u64>)| {
            let counts = self.classes.iter().zip(counts);
            let counts = counts.map(|(class, count)| (class.clone(), (*count).into()));
            let counts: serde_json::Map<_, _> = counts.collect();
            serde_json::json!({ "apart": apart, "classes": counts })
        };
        let counts: Vec<_> = APART.iter().zip(&self.counts).map(of).collect();
        serde_json::json!({
            "name": self.name,
            "title": self.title,
            "faults": self.singles,
            "pairs": self.pairs(),
            "played": self.played(),
            "seed": self.seed,
            "partition": self.part.map(|part| part.to_string()),
            "counts": counts,
            "located_closer": self.closer,
        })
    }
}

/// Between which shares of all pairs the share of a class lies with 95 % confidence, if `part` of `sample` have it (Wilson's score
/// interval).
fn interval(part: u64, sample: u64) -> (f64, f64) {
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
    use super::{PlayedPairs, interval};

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

    /// Counts in another order, or with one missing, are refused: they would be counted for other classes.
    #[test]
    fn names_of_pairs_are_all_there_in_their_order() {
        let names = ["one byte", "one link", "two links"].map(|apart| {
            let classes = ["located", "corrupted"].into_iter();
            classes.map(move |class| format!("{class}, {apart}"))
        });
        let names: Vec<String> = names.into_iter().flatten().collect();
        let named: Vec<(&str, u64)> = names.iter().map(String::as_str).zip(1..).collect();
        let (classes, counts) = PlayedPairs::of_named(&named).expect("pairs");
        assert_eq!(classes, ["located", "corrupted"]);
        assert_eq!(counts, [[1, 2], [3, 4], [5, 6]]);
        for (one, other) in [(0, 1), (2, 3), (1, 5)] {
            let mut exchanged = named.clone();
            exchanged.swap(one, other);
            assert_eq!(PlayedPairs::of_named(&exchanged), None, "{one} and {other}");
        }
        assert_eq!(PlayedPairs::of_named(&named[..5]), None);
        assert_eq!(PlayedPairs::of_named(&[]), None);
    }
}
