//! Which captures a folder keeps. The record holds every attempt in any case, so `verify` judges what has no capture too.

use super::files::CAPTURES;
use super::record::RecordLine;
use crate::library::Entry;
use crate::scenario::verdict::Verdict;
use std::collections::BTreeSet;
use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

/// What a byte on a link takes in a capture, in bytes.
const EACH_BYTE: u64 = 64;
/// What a scenario in which the driver plays leaves for each link, in bytes: the mean of the built-in scenarios, 18 to 29 kB on rings of 1 to
/// 100 drives, rounded up. Its file does not say how many bytes the driver sends.
const EACH_LINK: u64 = 30_000;
/// What a scenario on a shared line leaves, in bytes: the mean of the built-in scenarios on CAN is 1.3 kB.
const SHARED_LINE: u64 = 2_000;

/// Which captures are kept: those of attempts that did not pass always are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All.
    #[default]
    All,
    /// No others.
    Failed,
    /// The first attempt that passed, and each N-th behind it.
    Every(NonZeroU32),
}

impl Keep {
    /// How many bytes the captures of these scenarios take if all of them are played and pass: an estimate. A scenario that sends its
    /// bytes itself is counted by them.
    #[must_use]
    pub fn estimate<'e>(self, entries: impl Iterator<Item = &'e Entry>) -> u64 {
        let sizes = entries.map(|entry| match entry.settled.rings() {
            Some(rings) => {
                let links = rings.drives.iter().map(|drives| u64::from(*drives) + 1);
                let of_link = match entry.settled.pieces_sent() as u64 {
                    0 => EACH_LINK,
                    sent => EACH_BYTE * sent,
                };
                of_link * links.sum::<u64>()
            }
            None => SHARED_LINE,
        });
        match self {
            Self::All => sizes.sum(),
            Self::Failed => 0,
            Self::Every(every) => sizes.step_by(every.get() as usize).sum(),
        }
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::Failed => f.write_str("failed"),
            Self::Every(every) => every.fmt(f),
        }
    }
}

impl FromStr for Keep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            "failed" => Ok(Self::Failed),
            text => text.parse().map(Self::Every).map_err(|_| {
                "all, failed, or a number from 1 is expected: the captures of every N-th attempt that passed".to_owned()
            }),
        }
    }
}

/// Decides attempt by attempt.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Keeping {
    keep: Keep,
    /// How many attempts have passed.
    passed: u32,
}

impl Keeping {
    pub(super) const fn new(keep: Keep) -> Self {
        Self { keep, passed: 0 }
    }

    /// Whether the capture of the next attempt, with this verdict, is kept.
    pub(super) fn keeps(&mut self, verdict: &str) -> bool {
        if verdict != Verdict::Passed.name() {
            return true;
        }
        let number = self.passed;
        self.passed = number.wrapping_add(1);
        match self.keep {
            Keep::All => true,
            Keep::Failed => false,
            Keep::Every(every) => number % every == 0,
        }
    }
}

/// The captures that were left out of the folder of this record.
pub(super) fn left_out(lines: &[RecordLine], keep: Keep) -> BTreeSet<String> {
    let mut keeping = Keeping::new(keep);
    let mut files = BTreeSet::new();
    let mut file = String::new();
    for line in lines {
        match line {
            RecordLine::Scenario { name, attempt, .. } => {
                file = format!("{CAPTURES}/{name}.{attempt}.json");
            }
            RecordLine::Verdict { verdict, .. } if !keeping.keeps(verdict) => {
                files.insert(std::mem::take(&mut file));
            }
            _ => {}
        }
    }
    files
}
