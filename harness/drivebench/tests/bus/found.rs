//! Every deviation of a drive, and of its master, is found: by a scenario that passes without it and fails with it.

use harness::library::Entry;
use harness::scenario::files::sources;
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use harness::scenario::verdict::Verdict;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The deviations of a bus.
pub(crate) struct Deviations {
    /// The file that says which scenario finds which.
    pub(crate) file: &'static str,
    /// Its first lines.
    pub(crate) head: &'static str,
    /// The header line of the scenarios, behind which more header lines can stand.
    pub(crate) bus: &'static str,
    /// The word with which a line about a drive begins.
    pub(crate) device: &'static str,
    /// What stands in scenarios in which the bench's master takes part.
    pub(crate) driven: &'static str,
    /// The names of the deviations of drives.
    pub(crate) drives: Vec<&'static str>,
    /// The names of the deviations of the master.
    pub(crate) masters: Vec<&'static str>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Found {
    drive: BTreeMap<String, String>,
    master: BTreeMap<String, String>,
}

impl Deviations {
    fn file(&self) -> PathBuf {
        Path::new(env!("TREE")).join(self.file)
    }

    fn scenarios(&self) -> BTreeMap<String, Source> {
        let sources = sources(&[]).expect("built-in scenarios");
        let of_bus = sources
            .into_iter()
            .filter(|source| source.text.contains(self.bus));
        let name = |source: &Source| {
            let name = source.name.rsplit('/').next().unwrap_or_default();
            name.trim_end_matches(".scn").to_owned()
        };
        of_bus.map(|source| (name(&source), source)).collect()
    }

    /// The verdict with these lines in the header, and how much was carried.
    fn played(&self, source: &Source, lines: &str) -> (Verdict, u64) {
        let text = source
            .text
            .replace(self.bus, &format!("{}{lines}", self.bus));
        let source = Source::from_bytes(source.name.clone(), text.into_bytes()).expect("a text");
        let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
        let plan = &entry.settled;
        let mut link = plan.simulate();
        let outcome = plan.play(&mut *link, AtMismatch::Stop);
        (outcome.verdict, link.carried())
    }

    /// A header line for every drive of a scenario.
    fn of_all(&self, source: &Source, name: &str) -> String {
        let lines = source.text.lines();
        let rest = |line: &'_ str| Some(line.strip_prefix(self.device)?.trim_start().to_owned());
        let numbers = lines.filter_map(rest);
        let numbers: BTreeSet<_> = numbers
            .filter_map(|rest| rest.split(' ').next().map(str::to_owned))
            .collect();
        let line = |number: &String| format!("{} {number} deviates {name}\n", self.device);
        numbers.iter().map(line).collect()
    }

    fn search(&self) -> String {
        let scenarios = self.scenarios();
        let cost = |source: &Source| {
            let (verdict, carried) = self.played(source, "");
            (verdict == Verdict::Passed).then_some(carried)
        };
        let mut order: Vec<_> = scenarios
            .iter()
            .filter_map(|(name, source)| Some((cost(source)?, name, source)))
            .collect();
        order.sort_by_key(|(cost, name, _)| (*cost, (*name).clone()));
        let finds = |source: &Source, lines: &str| self.played(source, lines).0 == Verdict::Failed;
        let mut text = format!("{}\n[drive]\n", self.head);
        for name in &self.drives {
            let mut all = order.iter();
            let found = all.find(|(.., source)| finds(source, &self.of_all(source, name)));
            if let Some((_, scenario, _)) = found {
                text += &format!("{name} = \"{scenario}\"\n");
            }
        }
        text += "\n[master]\n";
        for name in &self.masters {
            let mut driven = order
                .iter()
                .filter(|(.., source)| source.text.contains(self.driven));
            let found = driven.find(|(.., source)| finds(source, &of_master(name)));
            if let Some((_, scenario, _)) = found {
                text += &format!("{name} = \"{scenario}\"\n");
            }
        }
        text
    }

    /// Plays each pair of the file.
    pub(crate) fn all_are_found(&self) {
        if std::env::var("DEVIATIONS").is_ok_and(|value| value == "update") {
            std::fs::write(self.file(), self.search()).expect("a file");
        }
        let text = std::fs::read_to_string(self.file()).expect("a file");
        let found: Found = toml::from_str(&text).expect("a table");
        let scenarios = self.scenarios();
        let mut unseen = Vec::new();
        let mut check = |name: &str, by: Option<&String>, lines: &dyn Fn(&Source) -> String| {
            let Some(scenario) = by else {
                unseen.push(name.to_owned());
                return;
            };
            let source = &scenarios[scenario];
            let right = self.played(source, "").0;
            assert_eq!(right, Verdict::Passed, "{scenario}");
            let verdict = self.played(source, &lines(source)).0;
            assert_eq!(verdict, Verdict::Failed, "{name}: {scenario}");
        };
        for name in &self.drives {
            let lines = |source: &Source| self.of_all(source, name);
            check(name, found.drive.get(*name), &lines);
        }
        for name in &self.masters {
            check(name, found.master.get(*name), &|_| of_master(name));
        }
        assert!(unseen.is_empty(), "no scenario finds {unseen:?}");
        let known: BTreeSet<_> = self.drives.iter().copied().collect();
        let all = found.drive.keys().all(|name| known.contains(name.as_str()));
        assert!(all, "{}", self.file);
        assert_eq!(found.master.len(), self.masters.len(), "{}", self.file);
    }
}

fn of_master(name: &str) -> String {
    format!("master deviates {name}\n")
}
