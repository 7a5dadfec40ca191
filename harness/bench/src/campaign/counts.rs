//! The counts of campaigns as a file, so that parts that were played on several machines can be added.

use super::pairs::{MOST_SINGLES, PlayedPairs};
use super::{Campaign, PlayedCampaign};
use crate::counted::counted;
use crate::partition::{Partition, Spread};
use crate::regular::{self, Links};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The version of the form.
const SCHEMA: u32 = 1;

/// The largest file of counts, in bytes.
const LARGEST: u64 = 1 << 24;

/// The counts of campaigns, or of one part of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CountsFile {
    /// The version of the form: 1.
    schema: u32,
    /// The version of the program that played them.
    drivebench: String,
    /// The part, as on the command line; none of whole campaigns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    partition: Option<String>,
    /// Each campaign, in order.
    pub campaigns: Vec<CampaignCounts>,
}

/// The counts of a campaign, or of one part of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignCounts {
    pub name: String,
    /// The sum of its file, its scenario and the names of all of its cases.
    sha256: String,
    /// How many cases the whole campaign has.
    pub cases: u64,
    /// How many of those that were played are of each class, in order of gravity.
    pub counts: Vec<ClassCount>,
    /// The figures that its file pins.
    pub expect: Vec<ClassCount>,
    /// Where its cases are the pairs of single faults: what the classes do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pairs: Option<PairFacts>,
}

/// Facts of a count of pairs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PairFacts {
    /// What the campaign shows.
    title: String,
    /// How many single faults it has.
    faults: u64,
    /// Of the located pairs on two links, those of which the link closer to the master's receiver was named.
    located_closer: u64,
}

/// Number of cases of a class; the class `cases` is all of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassCount {
    /// The name of the class.
    pub class: String,
    pub cases: u64,
}

impl ClassCount {
    fn of(class: &str, cases: u64) -> Self {
        Self {
            class: class.to_owned(),
            cases,
        }
    }
}

/// Why counts cannot be read or added.
#[derive(Debug, thiserror::Error)]
pub enum CountsError {
    /// A file cannot be read.
    #[error("failed to read {path}: {error}")]
    File { path: String, error: std::io::Error },
    /// A file does not hold counts, or two do not belong together; in a sentence.
    #[error("failed to merge: {0}")]
    Wrong(String),
}

/// What the parts of campaigns come to.
#[derive(Clone, Debug)]
pub struct MergedCounts {
    /// The counts of all parts.
    pub file: CountsFile,
    /// The parts that are missing, and how many there are.
    pub missing: Vec<Partition>,
}

/// What a campaign is: the sum of its texts and of the names of all of its cases.
fn identity(texts: &[&str], cases: &[String]) -> String {
    let mut digest = Sha256::new();
    for text in texts
        .iter()
        .copied()
        .chain(cases.iter().map(String::as_str))
    {
        // The length keeps the border between two texts.
        digest.update((text.len() as u64).to_be_bytes());
        digest.update(text);
    }
    let sum = digest.finalize();
    sum.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What a campaign is as a whole, of which all cases or a part of them are played.
#[derive(Clone, Debug)]
pub struct WholeCampaign {
    sha256: String,
    cases: u64,
    expect: Vec<ClassCount>,
}

impl WholeCampaign {
    /// Of a campaign; of a part, keeps only its cases and no pinned figure in it.
    pub fn of(campaign: &mut dyn Campaign, part: Option<Partition>) -> Self {
        let names = campaign.names();
        let whole = Self::new(&campaign.texts(), &names, &campaign.pinned());
        if let Some(part) = part {
            campaign.keep(&|place| part.has(place, &names[place]));
        }
        whole
    }

    /// Of the pairs of the cases of a campaign.
    #[must_use]
    pub fn of_pairs(campaign: &dyn Campaign) -> Self {
        let names = campaign.names();
        let texts = [&["pairs"], &campaign.texts()[..]].concat();
        let singles = names.len() as u64;
        Self {
            cases: singles * singles.saturating_sub(1) / 2,
            ..Self::new(&texts, &names, &[])
        }
    }

    /// The counts of pairs that were played.
    #[must_use]
    pub fn counts_of_pairs(self, played: &PlayedPairs) -> CampaignCounts {
        let counts = played.named().into_iter();
        let counts = counts.map(|(class, cases)| ClassCount { class, cases });
        CampaignCounts {
            pairs: Some(PairFacts {
                title: played.title.clone(),
                faults: played.singles,
                located_closer: played.closer,
            }),
            ..self.counted(&played.name, counts.collect())
        }
    }

    fn new(texts: &[&str], cases: &[String], expect: &[(&str, u64)]) -> Self {
        let expect = expect.iter();
        Self {
            sha256: identity(texts, cases),
            cases: cases.len() as u64,
            expect: expect
                .map(|(class, count)| ClassCount::of(class, *count))
                .collect(),
        }
    }

    /// The counts of a campaign that was played.
    #[must_use]
    pub fn counts(self, played: &dyn PlayedCampaign) -> CampaignCounts {
        let classes = played.classes().iter().enumerate();
        let counts = classes.map(|(place, class)| ClassCount::of(class.name, played.count(place)));
        self.counted(played.name(), counts.collect())
    }

    fn counted(self, name: &str, counts: Vec<ClassCount>) -> CampaignCounts {
        CampaignCounts {
            name: name.to_owned(),
            sha256: self.sha256,
            cases: self.cases,
            counts,
            expect: self.expect,
            pairs: None,
        }
    }
}

impl CampaignCounts {
    /// The pairs that were counted, where its cases are pairs.
    #[must_use]
    pub fn pairs(&self) -> Option<PlayedPairs> {
        let facts = self.pairs.as_ref()?;
        let named = self.counts.iter();
        let named = named.map(|count| (count.class.as_str(), count.cases));
        let named: Vec<_> = named.collect();
        let (classes, counts) = PlayedPairs::of_named(&named)?;
        Some(PlayedPairs {
            name: self.name.clone(),
            title: facts.title.clone(),
            singles: facts.faults,
            seed: None,
            part: None,
            classes,
            counts,
            closer: facts.located_closer,
        })
    }

    /// How many cases were played; `None` if the numbers are too large.
    #[must_use]
    pub fn played(&self) -> Option<u64> {
        let mut all = self.counts.iter();
        all.try_fold(0u64, |sum, count| sum.checked_add(count.cases))
    }

    /// The pinned figures that are not met: class, expected, found.
    #[must_use]
    pub fn differs(&self) -> Vec<(&str, u64, u64)> {
        let found = |class: &str| match class {
            "cases" => self.played().unwrap_or(u64::MAX),
            class => {
                let mut all = self.counts.iter();
                all.find(|count| count.class == class)
                    .map_or(0, |count| count.cases)
            }
        };
        let pinned = self.expect.iter();
        let compared = pinned.map(|count| (count.class.as_str(), count.cases, found(&count.class)));
        compared
            .filter(|(_, expected, found)| expected != found)
            .collect()
    }
}

impl CountsFile {
    /// Of campaigns that were played, or of a part of them.
    #[must_use]
    pub fn new(part: Option<Partition>, campaigns: Vec<CampaignCounts>) -> Self {
        Self {
            schema: SCHEMA,
            drivebench: env!("CARGO_PKG_VERSION").to_owned(),
            partition: part.map(|part| part.to_string()),
            campaigns,
        }
    }

    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        format!("{value:#}\n")
    }

    /// Reads one part; the part that it is.
    fn read(path: &Path) -> Result<(Self, Partition), CountsError> {
        let bytes =
            regular::read(path, Links::Follow, LARGEST).map_err(|error| CountsError::File {
                path: path.display().to_string(),
                error,
            })?;
        let wrong = |why: String| CountsError::Wrong(format!("{}: {why}", path.display()));
        let file: Self = serde_json::from_slice(&bytes).map_err(|error| {
            wrong(format!(
                "{error}; a file that `campaign --partition slice:M/N --output FILE` wrote is expected"
            ))
        })?;
        if file.schema != SCHEMA {
            return Err(wrong(format!(
                "the schema is {}, and this program reads {SCHEMA}",
                file.schema
            )));
        }
        let Some(partition) = &file.partition else {
            return Err(wrong(
                "it is of whole campaigns; `campaign --partition slice:M/N --output FILE` writes a part".to_owned(),
            ));
        };
        let partition = partition.parse().map_err(&wrong)?;
        if file.campaigns.is_empty() {
            return Err(wrong("it has no campaign".to_owned()));
        }
        Ok((file, partition))
    }

    /// The facts that must be the same in all parts: name and value.
    fn fingerprint(&self, partition: Partition) -> Vec<(String, String)> {
        let mut facts = vec![
            ("version of drivebench".to_owned(), self.drivebench.clone()),
            ("spread".to_owned(), partition.spread.name().to_owned()),
            ("number of parts".to_owned(), partition.of.to_string()),
        ];
        let names = self.campaigns.iter().map(|campaign| &campaign.name);
        let names: Vec<_> = names.collect();
        facts.push(("list of campaigns".to_owned(), format!("{names:?}")));
        for campaign in &self.campaigns {
            let name = &campaign.name;
            let expected = campaign.expect.iter();
            let expected = expected.map(|count| format!("{} {}", count.class, count.cases));
            let expected = expected.collect::<Vec<_>>().join(", ");
            let classes = campaign.counts.iter().map(|count| &count.class);
            let classes: Vec<_> = classes.collect();
            let counted = match &campaign.pairs {
                None => "single cases".to_owned(),
                Some(pairs) => format!("pairs of {} faults", pairs.faults),
            };
            facts.push((format!("count of {name}"), counted));
            facts.push((format!("sum of {name}"), campaign.sha256.clone()));
            let cases = campaign.cases.to_string();
            facts.push((format!("number of cases of {name}"), cases));
            facts.push((format!("list of classes of {name}"), format!("{classes:?}")));
            facts.push((format!("[expect] of {name}"), expected));
        }
        facts
    }
}

/// Adds the counts of parts.
///
/// # Errors
/// A file cannot be read or holds no part, two are the same part or of different campaigns, or the sums cannot be those of the campaigns.
pub fn merge(paths: &[PathBuf]) -> Result<MergedCounts, CountsError> {
    let mut parts: Vec<(&PathBuf, CountsFile, Partition)> = Vec::new();
    for path in paths {
        let (file, partition) = CountsFile::read(path)?;
        if let Some((first, theirs, of)) = parts.first() {
            let ours = file.fingerprint(partition);
            let both = theirs.fingerprint(*of).into_iter().zip(ours);
            let differing = both.into_iter().find(|(theirs, ours)| theirs != ours);
            if let Some(((what, theirs), (_, ours))) = differing {
                return Err(CountsError::Wrong(format!(
                    "{} and {} are no parts of the same campaigns: the {what} is {theirs} in the first and {ours} in the second",
                    first.display(),
                    path.display()
                )));
            }
        }
        if let Some((other, ..)) = parts.iter().find(|(_, _, known)| *known == partition) {
            return Err(CountsError::Wrong(format!(
                "{} and {} are both {partition}; name each part once",
                other.display(),
                path.display()
            )));
        }
        parts.push((path, file, partition));
    }
    let Some((_, first, one)) = parts.first() else {
        return Err(CountsError::Wrong("there is no part".to_owned()));
    };
    let there: BTreeSet<u32> = parts.iter().map(|(_, _, part)| part.number).collect();
    let missing = (1..=one.of).filter(|number| !there.contains(number));
    let missing: Vec<_> = missing.map(|number| Partition { number, ..*one }).collect();
    let mut campaigns = first.campaigns.clone();
    for (place, sum) in campaigns.iter_mut().enumerate() {
        for (path, file, partition) in &parts {
            fits(&file.campaigns[place], *partition)
                .map_err(|why| CountsError::Wrong(format!("{}: {why}", path.display())))?;
        }
        for (class, count) in sum.counts.iter_mut().enumerate() {
            let all = parts
                .iter()
                .map(|(_, file, _)| file.campaigns[place].counts[class].cases);
            // Each part has at most all cases, and there are few parts: see `fits`.
            count.cases = all.fold(0, u64::saturating_add);
        }
        if let Some(sum) = &mut sum.pairs {
            let facts = parts
                .iter()
                .filter_map(|(_, file, _)| file.campaigns[place].pairs.as_ref());
            let all = facts.map(|facts| facts.located_closer);
            sum.located_closer = all.fold(0, u64::saturating_add);
        }
        let played = sum.played().unwrap_or(u64::MAX);
        if played > sum.cases || missing.is_empty() && played != sum.cases {
            return Err(CountsError::Wrong(format!(
                "the parts of {} have {} together, and it has {}",
                sum.name,
                counted(usize::try_from(played).unwrap_or(usize::MAX), "case"),
                sum.cases
            )));
        }
    }
    Ok(MergedCounts {
        file: CountsFile::new(None, campaigns),
        missing,
    })
}

/// How many pairs a slice has: those of which the second fault is one of its faults.
fn share_of_pairs(
    campaign: &CampaignCounts,
    facts: &PairFacts,
    partition: Partition,
) -> Result<u64, String> {
    let (faults, name) = (facts.faults, &campaign.name);
    let most = MOST_SINGLES as u64;
    if faults > most || campaign.cases != faults * faults.saturating_sub(1) / 2 {
        return Err(format!(
            "{name} has {} pairs of {faults} faults, which cannot be",
            campaign.cases
        ));
    }
    let located = campaign.pairs().map(|pairs| pairs.located());
    if located.is_none_or(|located| facts.located_closer > located) {
        return Err(format!("the counts of {name} are not those of pairs"));
    }
    let first = u64::from(partition.number - 1);
    Ok((first..faults).step_by(partition.of as usize).sum())
}

/// Whether a part can have these counts.
fn fits(campaign: &CampaignCounts, partition: Partition) -> Result<(), String> {
    let played = campaign.played().filter(|played| *played <= campaign.cases);
    let Some(played) = played else {
        return Err(format!(
            "it has more cases of {} than the campaign has, {}",
            campaign.name, campaign.cases
        ));
    };
    let share = match &campaign.pairs {
        None => partition.share(campaign.cases),
        Some(facts) => share_of_pairs(campaign, facts, partition)?,
    };
    match partition.spread {
        Spread::Slice if played != share => Err(format!(
            "it has {played} cases of {}, and {partition} has {share}",
            campaign.name
        )),
        _ => Ok(()),
    }
}
