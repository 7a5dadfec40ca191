//! Every deviation of a UNITEK drive, and of its driver, is found: by a scenario that passes without it and fails with it.
//!
//! `corpora/unitek-deviations.toml` says which scenario finds which.
//! `DEVIATIONS=update cargo test --test bus unitek` plays every scenario with every deviation and rewrites the file.

use harness::library::{Entry, sources};
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use harness::scenario::verdict::Verdict;
use harness_sim::unitek::deviation::{MASTER_DEVIATIONS, deviations};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const FILE: &str = "corpora/unitek-deviations.toml";

const HEAD: &str = "\
# Which scenario finds which deviation of a UNITEK drive, and of its driver (`master deviates`).
# Written by `DEVIATIONS=update cargo test --test bus unitek`; the test plays every pair.
";

/// The line behind which more header lines can stand.
const BUS: &str = "bus     unitek\n";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Found {
    drive: BTreeMap<String, String>,
    master: BTreeMap<String, String>,
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE)
}

fn scenarios() -> BTreeMap<String, Source> {
    let sources = sources(&[]).expect("built-in scenarios");
    let own = sources.into_iter().filter(|own| own.text.contains(BUS));
    let name = |own: &Source| {
        let name = own.name.rsplit('/').next().unwrap_or_default();
        name.trim_end_matches(".scn").to_owned()
    };
    own.map(|own| (name(&own), own)).collect()
}

/// The verdict with these lines in the header, and how many frames were carried.
fn played(source: &Source, lines: &str) -> (Verdict, u64) {
    let text = source.text.replace(BUS, &format!("{BUS}{lines}"));
    let source = Source::from_bytes(source.name.clone(), text.into_bytes()).expect("a text");
    let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
    let plan = entry.settled().expect("a bus that is built");
    let mut link = plan.simulate();
    let outcome = plan.play(&mut *link, AtMismatch::Stop);
    (outcome.verdict, link.carried())
}

/// A header line for every drive of a scenario.
fn of_all(source: &Source, name: &str) -> String {
    let lines = source.text.lines();
    let numbers = lines.filter_map(|line| line.strip_prefix("drive ")?.split(' ').next());
    let numbers: BTreeSet<_> = numbers.collect();
    let line = |number: &&str| format!("drive {number} deviates {name}\n");
    numbers.iter().map(line).collect()
}

fn of_master(name: &str) -> String {
    format!("master deviates {name}\n")
}

fn search() -> String {
    let scenarios = scenarios();
    let cost = |source: &Source| {
        let (verdict, carried) = played(source, "");
        (verdict == Verdict::Passed).then_some(carried)
    };
    let mut order: Vec<_> = scenarios
        .iter()
        .filter_map(|(name, source)| Some((cost(source)?, name, source)))
        .collect();
    order.sort_by_key(|(cost, name, _)| (*cost, (*name).clone()));
    let mut text = format!("{HEAD}\n[drive]\n");
    let mut note = |deviation: &str, lines: &dyn Fn(&Source) -> String| {
        let found = order
            .iter()
            .find(|(_, _, source)| played(source, &lines(source)).0 == Verdict::Failed);
        if let Some((_, name, _)) = found {
            text += &format!("{deviation} = \"{name}\"\n");
        }
    };
    for deviation in deviations() {
        note(deviation.name, &|source| of_all(source, deviation.name));
    }
    let mut masters = String::from("\n[master]\n");
    for deviation in MASTER_DEVIATIONS {
        let driven = order
            .iter()
            .filter(|(_, _, source)| source.text.contains("\nmaster "));
        let mut driven = driven.filter(|(_, _, source)| {
            played(source, &of_master(deviation.name)).0 == Verdict::Failed
        });
        if let Some((_, name, _)) = driven.next() {
            masters += &format!("{} = \"{name}\"\n", deviation.name);
        }
    }
    text + &masters
}

#[test]
fn every_deviation_is_found() {
    if std::env::var("DEVIATIONS").is_ok_and(|value| value == "update") {
        std::fs::write(file(), search()).expect("a file");
    }
    let text = std::fs::read_to_string(file()).expect("a file");
    let found: Found = toml::from_str(&text).expect("a table");
    let scenarios = scenarios();
    let mut unseen = Vec::new();
    let mut check = |name: &str, by: Option<&String>, lines: &dyn Fn(&Source) -> String| {
        let Some(scenario) = by else {
            unseen.push(name.to_owned());
            return;
        };
        let source = &scenarios[scenario];
        assert_eq!(played(source, "").0, Verdict::Passed, "{scenario}");
        let verdict = played(source, &lines(source)).0;
        assert_eq!(verdict, Verdict::Failed, "{name}: {scenario}");
    };
    for own in deviations() {
        check(own.name, found.drive.get(own.name), &|source| {
            of_all(source, own.name)
        });
    }
    for own in MASTER_DEVIATIONS {
        check(own.name, found.master.get(own.name), &|_| {
            of_master(own.name)
        });
    }
    assert!(unseen.is_empty(), "no scenario finds {unseen:?}");
    let known: BTreeSet<_> = deviations().map(|own| own.name).collect();
    assert!(
        found.drive.keys().all(|name| known.contains(name.as_str())),
        "{FILE}"
    );
    assert_eq!(found.master.len(), MASTER_DEVIATIONS.len(), "{FILE}");
}
