//! What earlier runs have shown: the verdicts of their folders, which are judged again before anything is left out because of them.

use super::derive::verdict_named;
use super::error::EvidenceError;
use super::files::sum;
use super::merge::{MERGE, opened_parts, verify_merged};
use super::record::RecordLine;
use super::verify::{OpenedFolder, Verified, verify};
use crate::library::Entry;
use crate::rig::Rig;
use crate::scenario::verdict::Verdict;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What came of each scenario of earlier runs.
#[derive(Clone, Debug)]
pub struct Earlier {
    /// By the sum of its text.
    scenarios: BTreeMap<String, KnownScenario>,
}

/// What an earlier run says of a scenario.
#[derive(Clone, Debug)]
struct KnownScenario {
    name: String,
    /// `None` if the run did not come to it.
    verdict: Option<Verdict>,
}

impl KnownScenario {
    /// The verdict of a scenario that need not be played again.
    fn shown(&self) -> Option<Verdict> {
        let done = [Verdict::Passed, Verdict::Marginal];
        self.verdict.filter(|verdict| done.contains(verdict))
    }

    /// Whether the earlier run is not passed because of it. A skipped scenario does not keep a run from passing.
    fn is_outstanding(&self) -> bool {
        self.shown().is_none() && self.verdict != Some(Verdict::Skipped)
    }
}

impl Earlier {
    /// Reads folders of runs on this rig; what a later one says of a scenario replaces what an earlier one says.
    ///
    /// # Errors
    /// A folder is no evidence of a run, is not what its record gives, is of another rig, or was written by another version of this program.
    pub fn read(folders: &[PathBuf], rig: &Rig) -> Result<Self, EvidenceError> {
        let mut scenarios = BTreeMap::new();
        for path in folders {
            scenarios.extend(known(path, rig)?);
        }
        Ok(Self { scenarios })
    }

    /// The verdict of a scenario that need not be played again: it passed, and its text is the same. `None` for all others.
    #[must_use]
    pub fn shown(&self, entry: &Entry) -> Option<Verdict> {
        self.scenarios.get(&text_sum(entry))?.shown()
    }

    /// The names of scenarios that did not pass and are not among these.
    #[must_use]
    pub fn left(&self, entries: &[Entry]) -> Vec<String> {
        let mut left = self.scenarios.clone();
        left.retain(|_, known| known.is_outstanding());
        for entry in entries {
            left.remove(&text_sum(entry));
        }
        left.into_values().map(|known| known.name).collect()
    }
}

fn text_sum(entry: &Entry) -> String {
    sum(entry.source.text.as_bytes())
}

/// What a folder says of each scenario.
fn known(path: &Path, rig: &Rig) -> Result<BTreeMap<String, KnownScenario>, EvidenceError> {
    let refused = |why: String| EvidenceError::Earlier(format!("{}: {why}", path.display()));
    let is_merged = path.join(MERGE).exists();
    let (verified, records) = match is_merged {
        true => (verify_merged(path, None)?.0, opened_parts(path)?),
        false => (verify(path, None)?, vec![OpenedFolder::open(path)?]),
    };
    for record in &records {
        fits(record, rig).map_err(refused)?;
    }
    if let Some(why) = Verified::first_wrong(&verified) {
        return Err(refused(format!(
            "it is not what its record gives: {why}; `drivebench verify` shows all of it"
        )));
    }
    let mut scenarios = BTreeMap::new();
    for record in &records {
        for (sum, name) in selected(record) {
            let verdict = None;
            scenarios
                .entry(sum)
                .or_insert(KnownScenario { name, verdict });
        }
    }
    for record in &records {
        for (sum, name, verdict) in record.lines.iter().filter_map(case) {
            let known = scenarios.entry(sum).or_insert(KnownScenario {
                name: name.clone(),
                verdict: None,
            });
            known.name = name;
            // A text that was played twice has passed if it passed each time.
            if known.verdict.is_none() || known.shown().is_some() {
                known.verdict = Some(verdict);
            }
        }
    }
    Ok(scenarios)
}

/// Whether a record is of a run on this rig, by this program; why not, in a sentence.
fn fits(record: &OpenedFolder, rig: &Rig) -> Result<(), String> {
    let header = &record.header;
    let profile = |rig: &Rig| rig.profile.as_ref().map(|profile| profile.text.clone());
    if header.program != env!("CARGO_PKG_VERSION") {
        return Err(format!(
            "drivebench {} wrote it, and this is {}; play the whole run again",
            header.program,
            env!("CARGO_PKG_VERSION")
        ));
    }
    if header.qualified {
        return Err("it is of `qualify`; a folder of `run --evidence` is expected".to_owned());
    }
    if record.rig.text != rig.text || profile(&record.rig) != profile(rig) {
        return Err(format!(
            "it is of the rig {} with another file; play the whole run again",
            record.rig.id()
        ));
    }
    Ok(())
}

/// The sums and names of the scenarios that were to be played. The record of a run that was killed has no names of those that it did not
/// come to.
fn selected(record: &OpenedFolder) -> Vec<(String, String)> {
    match (&record.header.part, &record.header.selected) {
        (Some(part), _) => {
            let all = part.scenarios.iter();
            all.map(|item| (item.sha256.clone(), item.name.clone()))
                .collect()
        }
        (None, Some(sums)) => {
            let name =
                |sum: &String| format!("a scenario with the sum {}", &sum[..sum.len().min(12)]);
            sums.iter().map(|sum| (sum.clone(), name(sum))).collect()
        }
        (None, None) => Vec::new(),
    }
}

/// The sum of the text, the name and the verdict of a scenario; `None` for other lines.
fn case(line: &RecordLine) -> Option<(String, String, Verdict)> {
    let RecordLine::Case {
        name,
        sha256,
        verdict,
        ..
    } = line
    else {
        return None;
    };
    let verdict = verdict_named(verdict)?;
    Some((sha256.clone()?, name.clone(), verdict))
}
