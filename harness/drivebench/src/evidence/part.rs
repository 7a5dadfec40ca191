//! Parts of a run that was split: what each says of the whole, and whether it is the part that it says it is.

use super::files::sum;
use super::header::Header;
use super::names::Names;
use super::record::{PartItem, RunPart};
use crate::library::Entry;
use crate::partition::Partition;
use std::collections::BTreeSet;

/// A run that is split, and which part of it is played.
#[derive(Clone, Debug)]
pub struct SplitRun {
    /// Which part.
    pub partition: Partition,
    /// The filter of the command.
    filter: Option<String>,
    /// Every scenario, those of other parts included.
    scenarios: Vec<PartItem>,
}

impl SplitRun {
    /// Splits the scenarios that were selected; `is_named` says of each whether the user named it itself.
    #[must_use]
    pub fn new(
        partition: Partition,
        filter: Option<&str>,
        entries: &[Entry],
        is_named: impl Fn(&Entry) -> bool,
    ) -> Self {
        let mut names = Names::default();
        let scenarios = entries.iter().map(|entry| PartItem {
            name: names.next(entry.short_name()),
            named: is_named(entry),
            sha256: sum(entry.source.text.as_bytes()),
        });
        Self {
            partition,
            filter: filter.map(str::to_owned),
            scenarios: scenarios.collect(),
        }
    }

    /// The scenarios of the part.
    #[must_use]
    pub fn share(&self, entries: Vec<Entry>) -> Vec<Entry> {
        let all = entries.into_iter().zip(&self.scenarios).enumerate();
        let share = all.filter(|(place, (_, planned))| self.partition.has(*place, &planned.name));
        share.map(|(_, (entry, _))| entry).collect()
    }

    /// The names of its scenarios in the folder.
    pub(super) fn names(&self) -> Names {
        let of_part = of_part(self.partition, &self.scenarios);
        let name = |planned: &PartItem| planned.name.clone();
        let all: BTreeSet<_> = self.scenarios.iter().map(name).collect();
        Names::planned(of_part.map(name).collect(), all)
    }

    /// What the record says of it.
    pub(super) fn recorded(&self) -> RunPart {
        RunPart {
            partition: self.partition.to_string(),
            filter: self.filter.clone(),
            corpus: digest(&self.scenarios),
            scenarios: self.scenarios.clone(),
        }
    }
}

/// The scenarios of a part, in order.
fn of_part(partition: Partition, all: &[PartItem]) -> impl Iterator<Item = &PartItem> {
    let all = all.iter().enumerate();
    all.filter(move |(place, planned)| partition.has(*place, &planned.name))
        .map(|(_, planned)| planned)
}

/// The sum of all names and texts.
fn digest(all: &[PartItem]) -> String {
    let lines = all.iter().map(|planned| {
        let named = if planned.named { "  named" } else { "" };
        format!("{}  {}{named}\n", planned.sha256, planned.name)
    });
    sum(lines.collect::<String>().as_bytes())
}

impl Header {
    /// The part that the record says it is; `None` for a whole run, and where it says none that can be.
    pub(super) fn partition(&self) -> Option<Partition> {
        self.part.as_ref()?.partition.parse().ok()
    }
}

/// What a record says of its part and cannot be: its own scenarios follow from the list of all and its number.
pub(super) fn differences(part: &RunPart, selected: Option<&Vec<String>>) -> Vec<String> {
    let partition: Partition = match part.partition.parse() {
        Ok(partition) => partition,
        Err(why) => return vec![format!("run.jsonl, line 1: `partition`: {why}")],
    };
    let mut wrong = Vec::new();
    if digest(&part.scenarios) != part.corpus {
        wrong
            .push("run.jsonl, line 1: `corpus` is not the sum of the list of scenarios".to_owned());
    }
    let of_part = of_part(partition, &part.scenarios).map(|item| &item.sha256);
    if !of_part.eq(selected.into_iter().flatten()) {
        wrong.push(format!(
            "run.jsonl, line 1: the selected scenarios are not those of {partition} of the list"
        ));
    }
    wrong
}
