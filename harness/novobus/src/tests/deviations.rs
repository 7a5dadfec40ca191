//! Every deviation of a drive is found: by a scenario that passes without it and fails with it.
//!
//! `corpora/deviations.toml` says which scenario finds which deviation, and by what means: over the `wire`
//! alone, with `faults` that a bench injects, or only by a `look` into the drive or at its plugs.
//! `DEVIATIONS=update cargo test -p harness-novobus --lib tests::deviations` plays every scenario with every deviation and rewrites the file.

use super::blind::Blind;
use crate::language::plan::Plan;
use crate::language::read::RingScenario;
use crate::qualify::deviating_masters;
use crate::rig::OnRings as _;
use crate::rig::{Run, parse, session};
use crate::simulate::simulated;
use crate::tests::{ROOT, built_in_sources};
use harness_bench::link::{Capability, Line, Link};
use harness_bench::rig::{PlayedScenario, UseOptions};
use harness_bench::scenario::run::run;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_sim::novobus::deviation::{DEVIATIONS, Deviation, MASTER_DEVIATIONS};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const FILE: &str = "corpora/deviations.toml";
const MASTERS: &str = "corpora/masters.toml";

const HEAD: &str = "\
# Which scenario finds which deviation of a drive (`drivebench deviations`), and by what means:
#   wire    bytes and times at the master, on a ring in which nothing else is done
#   faults  the same, while the bench injects faults, switches power or moves plugs
#   look    only a look into the drive's memory, its error mode or its outputs
# Written by `DEVIATIONS=update cargo test -p harness-novobus --lib tests::deviations`; the test plays every pair.
";

/// The scenarios that find a deviation, the quickest of each kind.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct FindingScenarios {
    wire: Option<String>,
    faults: Option<String>,
    look: Option<String>,
}

/// How a scenario finds a deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Means {
    Wire,
    Faults,
    Look,
}

/// A scenario that passes without a deviation, as it is or with drives of the model `nd21` only.
struct PassingScenario {
    name: String,
    text: String,
    /// Where header lines can be put, and those that go there.
    at: usize,
    lines: String,
    two_rings: Option<u8>,
    /// Whether nothing is done to the ring, its drives and their plugs.
    alone: bool,
    /// Whether it can be judged to its end from the bytes at the master alone.
    blind: bool,
    cost: u64,
}

impl PassingScenario {
    fn new(entry: &RingScenario, nd21: bool) -> Option<Self> {
        let text = entry.source.text.to_string();
        let at = text.find("\nring ")? + 1;
        let at = at + text[at..].find('\n')? + 1;
        let read = RingScenario::new(entry.source.clone(), None).ok()?;
        let rings = &read.scenario.header.rings;
        let mut candidate = Self {
            name: entry.short_name().to_owned(),
            text,
            at,
            lines: String::new(),
            two_rings: rings.get(1).map(|ring| ring.default - 1),
            alone: true,
            blind: true,
            cost: 0,
        };
        if nd21 {
            candidate.lines = candidate.of_all("model nd21");
        }
        let sound = candidate.with("")?;
        let plan = &sound.plan;
        let hands = [
            Capability::Interposer,
            Capability::Power,
            Capability::Simulator,
        ];
        candidate.alone = !plan.needs.iter().any(|need| hands.contains(need));
        candidate.blind = run(plan, &mut Blind(simulated(plan))).verdict != Verdict::Failed;
        let mut link = simulated(plan);
        let passes = run(plan, &mut link).verdict == Verdict::Passed;
        candidate.cost = link.carried() * 10 + link.now().since_start().as_nanos() / 1_000_000;
        passes.then_some(candidate)
    }

    /// A header line for every drive of every ring.
    fn of_all(&self, what: &str) -> String {
        let mut lines = format!("drive 0..last {what}\n");
        if let Some(last) = self.two_rings {
            lines += &format!("drive 2:0..{last} {what}\n");
        }
        lines
    }

    fn with(&self, more: &str) -> Option<RingScenario> {
        let (head, rest) = self.text.split_at(self.at);
        let text = format!("{head}{}{more}{rest}", self.lines);
        let source = Source::from_bytes(self.name.clone(), text.into_bytes()).expect("a text");
        RingScenario::new(source, None).ok()
    }

    /// By what means it finds the deviation, if it does.
    fn finds(&self, deviation: &Deviation) -> Option<Means> {
        let wrong = self.with(&self.of_all(&format!("deviates {}", deviation.name)))?;
        let wrong = &wrong.plan;
        let fails = |link: &mut dyn Link| run(wrong, link).verdict == Verdict::Failed;
        if self.blind && fails(&mut Blind(simulated(wrong))) {
            return Some(if self.alone {
                Means::Wire
            } else {
                Means::Faults
            });
        }
        fails(&mut simulated(wrong)).then_some(Means::Look)
    }
}

fn scenarios() -> Vec<RingScenario> {
    let entries = built_in_sources().map(|source| RingScenario::new(source, None));
    entries.map(|entry| entry.expect("no mistakes")).collect()
}

fn file() -> PathBuf {
    Path::new(ROOT).join(FILE)
}

fn search() -> String {
    let scenarios = scenarios();
    let candidates = [false, true].map(|nd21| {
        let candidates = scenarios
            .iter()
            .filter_map(|s| PassingScenario::new(s, nd21));
        let mut candidates: Vec<_> = candidates.collect();
        candidates.sort_by_key(|candidate| candidate.cost);
        candidates
    });
    let mut text = HEAD.to_owned();
    for deviation in DEVIATIONS.all() {
        let mut by = FindingScenarios::default();
        for candidate in &candidates[usize::from(deviation.is_behind_the_bus())] {
            let place = match candidate.finds(deviation) {
                Some(Means::Wire) => &mut by.wire,
                Some(Means::Faults) => &mut by.faults,
                Some(Means::Look) => &mut by.look,
                None => continue,
            };
            place.get_or_insert_with(|| candidate.name.clone());
            if by.wire.is_some() {
                break;
            }
        }
        text += &format!("\n[{}]\n", deviation.name);
        for (means, scenario) in [("wire", by.wire), ("faults", by.faults), ("look", by.look)] {
            if let Some(scenario) = scenario {
                text += &format!("{means} = \"{scenario}\"\n");
            }
        }
    }
    text
}

#[test]
fn every_deviation_is_found() {
    if std::env::var("DEVIATIONS").is_ok_and(|value| value == "update") {
        std::fs::write(file(), search()).expect("a file");
    }
    let text = std::fs::read_to_string(file()).expect("a file");
    let found: BTreeMap<String, FindingScenarios> = toml::from_str(&text).expect("a table");
    let scenarios = scenarios();
    let mut unseen = Vec::new();
    for deviation in DEVIATIONS.all() {
        let by = found.get(deviation.name).cloned().unwrap_or_default();
        let means = [
            (by.wire, Means::Wire),
            (by.faults, Means::Faults),
            (by.look, Means::Look),
        ];
        let mut any = false;
        for (name, means) in means.into_iter().filter_map(|(name, m)| Some((name?, m))) {
            let entry = scenarios.iter().find(|entry| entry.short_name() == name);
            let entry = entry.unwrap_or_else(|| panic!("no scenario {name}"));
            let candidate = PassingScenario::new(entry, deviation.is_behind_the_bus());
            let found = candidate.and_then(|candidate| candidate.finds(deviation));
            assert_eq!(found, Some(means), "{}: {name}", deviation.name);
            any = true;
        }
        if !any {
            unseen.push(deviation.name);
        }
    }
    assert!(unseen.is_empty(), "no scenario finds {unseen:?}");
    let names = DEVIATIONS.names();
    let unknown = found.keys().find(|name| !names.contains(&name.as_str()));
    assert_eq!(unknown, None, "{FILE} names a deviation that there is not");
}

/// The scenario that finds each deviation of the bench's own master.
fn masters() -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(Path::new(ROOT).join(MASTERS));
    let found: BTreeMap<String, String> = toml::from_str(&text.expect("a file")).expect("a table");
    let names = MASTER_DEVIATIONS.names();
    let unknown = found.keys().find(|name| !names.contains(&name.as_str()));
    assert_eq!(
        unknown, None,
        "{MASTERS} names a deviation that there is not"
    );
    found
}

fn found_by<'s>(
    name: &str,
    by: &BTreeMap<String, String>,
    scenarios: &'s [RingScenario],
) -> &'s RingScenario {
    let scenario = by.get(name).map_or("", String::as_str);
    let entry = scenarios
        .iter()
        .find(|entry| entry.short_name() == scenario);
    entry.unwrap_or_else(|| panic!("{name}: no scenario {scenario:?}"))
}

#[test]
fn every_wrong_master_is_found() {
    let (by, scenarios) = (masters(), scenarios());
    for deviation in MASTER_DEVIATIONS.all() {
        let entry = found_by(deviation.name, &by, &scenarios);
        let mut plan = entry.plan.clone();
        for (master, verdict) in [(None, Verdict::Passed), (Some(deviation), Verdict::Failed)] {
            plan.master = master;
            let outcome = run(&plan, &mut simulated(&plan));
            assert_eq!(outcome.verdict, verdict, "{}", deviation.name);
        }
    }
}

/// On a rig the bench is blamed for a wrong master, and the replayed record names that master.
#[test]
fn every_wrong_master_is_named() {
    let (by, scenarios) = (masters(), scenarios());
    for deviation in MASTER_DEVIATIONS.all() {
        let text = format!(
            "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n\
             [sim]\nsetup = [\"master deviates {}\"]\n\
             [limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\nallow_outputs = true\nallow_monitoring = true\n",
            deviation.name
        );
        let source = Source::from_bytes("desk.toml".to_owned(), text.into_bytes());
        let rig = parse(&source.expect("a text")).expect("a rig");
        let options = UseOptions {
            allow_motion: true,
            ..UseOptions::default()
        };
        let mut session = session::open(&rig, &options).expect("a rig in use");
        let plan = found_by(deviation.name, &by, &scenarios).plan.clone();
        let mut on_rig = Run::new(&mut session).expect("a twin");
        let played = on_rig.play(&plan, None).expect("a healthy rig");
        assert_eq!(
            played.outcome.verdict,
            Verdict::RigError,
            "{}",
            deviation.name
        );
        let driven: Vec<_> = played
            .attempts
            .iter()
            .filter_map(|a| a.beside().driven.clone())
            .collect();
        assert!(!driven.is_empty(), "{}", deviation.name);
        let named = deviating_masters(&driven);
        assert!(named.contains(&deviation), "{}: {named:?}", deviation.name);
        drop(on_rig);
        let _end = session.close(false);
    }
}

/// Plays on a simulated rig of three drives with this setup and these limits.
fn on_a_rig(setup: &str, limits: &str, plans: &[Plan]) -> Vec<PlayedScenario> {
    let text = format!(
        "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n[sim]\nsetup = [{setup}]\n[limits]\n{limits}"
    );
    let source = Source::from_bytes("desk.toml".to_owned(), text.into_bytes());
    let rig = parse(&source.expect("a text")).expect("a rig");
    let options = UseOptions {
        allow_motion: !limits.is_empty(),
        ..UseOptions::default()
    };
    let mut session = session::open(&rig, &options).expect("a rig in use");
    let mut on_rig = Run::new(&mut session).expect("a twin");
    let played = plans
        .iter()
        .map(|plan| on_rig.play(plan, None).expect("a healthy rig"));
    let played = played.collect();
    drop(on_rig);
    let _end = session.close(false);
    played
}

/// ND21 9.9, 14.10.2: drives that send zeros without end keep no bench busy, and what they do is not its own master's fault.
#[test]
fn drives_that_send_without_end_are_to_blame() {
    let limits: String = ["motion", "reset", "eeprom", "outputs", "monitoring"]
        .map(|what| format!("allow_{what} = true\n"))
        .concat();
    for (deviation, name) in [
        ("answers-late", "9.9-master-silent"),
        ("time-out-always", "9.9-driver-silence"),
    ] {
        let scenarios = scenarios();
        let entry = scenarios.iter().find(|s| s.short_name() == name);
        let plan = entry.expect("a scenario").plan.clone();
        let setup = format!("\"drive 1 deviates {deviation}\"");
        let played = on_a_rig(&setup, &limits, &[plan]).remove(0);
        assert_eq!(
            played.outcome.verdict,
            Verdict::Failed,
            "{:#?}",
            played.outcome
        );
        for trace in played.attempts.iter().flat_map(|attempt| &attempt.traces) {
            let carried = trace.channels.iter().map(|link| link.octets().len());
            assert!(carried.sum::<usize>() < 100_000, "{name}");
        }
    }
}

/// ND21 9.8: what breaks a check sequence off is tried on a rig that allows nothing, and shows a wrong drive wherever it stands: the drives in front
/// of it count the bytes up (9.7).
#[test]
fn a_broken_sequence_is_tried_with_every_drive() {
    let scenarios = scenarios();
    let tried = ["9.8-sequence-with-gaps", "9.8-sequence-with-gaps-behind"];
    let plans = scenarios.iter().filter(|s| tried.contains(&s.short_name()));
    let plans: Vec<_> = plans.map(|s| s.plan.clone()).collect();
    assert_eq!(plans.len(), 2);
    let judged = |setup: &str| -> Vec<Verdict> {
        let played = on_a_rig(setup, "", &plans);
        played.iter().map(|play| play.outcome.verdict).collect()
    };
    assert_eq!(judged(""), [Verdict::Passed; 2]);
    for drive in 0..3 {
        let setup = format!("\"drive {drive} deviates broken-check-sequence-accepted\"");
        assert!(judged(&setup).contains(&Verdict::Failed), "drive {drive}");
    }
}

#[test]
fn names_are_unique_and_sections_are_the_manuals() {
    let mut names = DEVIATIONS.names();
    names.sort_unstable();
    let all = names.len();
    names.dedup();
    assert_eq!(names.len(), all);
    assert!(all >= 40, "{all}");
    for deviation in DEVIATIONS.all() {
        let kebab = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        assert!(deviation.name.chars().all(kebab), "{}", deviation.name);
        let chapter = deviation.section.split('.').next();
        assert!(
            matches!(chapter, Some("8" | "9" | "10" | "13" | "14")),
            "{}",
            deviation.name
        );
    }
}
