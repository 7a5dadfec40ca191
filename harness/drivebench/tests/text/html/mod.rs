//! The page of a run: its structure, its bounds, text that would be markup, and what a browser makes of it.

mod browser;
mod curves;
mod devtools;
mod hostile;
mod live;
mod pages;
mod parser;
mod program;

use harness::buses::novobus::BUS;
use harness::library::Entry;
use harness::scenario::run::{AtMismatch, Outcome};
use harness::scenario::source::Source;
use harness::shown::{Head, ScenarioView, ShownScenario, run, section};
use harness_sim::record::Trace;
use std::path::{Path, PathBuf};

/// A folder of one test's own, empty.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"))
        .join("html")
        .join(name);
    let _not_there = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A built-in scenario's text.
fn text(name: &str) -> String {
    let path = Path::new(env!("TREE")).join(format!("corpora/scenarios/novobus/{name}.scn"));
    std::fs::read_to_string(path).expect("a scenario")
}

/// A scenario, played.
fn played(name: &str, text: &str) -> (Entry, Outcome, Vec<Trace>) {
    let source = Source::from_bytes(format!("{name}.scn"), text.into()).expect("a text");
    let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{:#?}\n{text}", p.all()));
    let plan = &entry.settled;
    let mut link = plan.simulate();
    let outcome = plan.play(&mut *link, AtMismatch::Stop);
    let traces = (0..plan.ports()).map(|ring| link.trace(ring)).collect();
    (entry, outcome, traces)
}

/// Its section.
fn shown(number: usize, name: &str, text: &str) -> ShownScenario {
    let (entry, outcome, traces) = played(name, text);
    let sources: Vec<_> = entry
        .scenario
        .sources
        .iter()
        .map(|s| s.text.clone())
        .collect();
    let drives = traces[0].stations.to_string();
    let view = ScenarioView {
        name: entry.short_name(),
        title: &entry.scenario.title,
        sources: &sources,
        drives: &drives,
        text,
        outcome: &outcome,
        traces: &traces,
        report: entry.report,
        rate: entry.rate(),
        again: "drivebench trace it",
    };
    section(number, &view)
}

/// The page of scenarios by name and text.
fn page(scenarios: &[(&str, String)]) -> String {
    let all = scenarios.iter().enumerate();
    let all = all
        .map(|(number, (name, text))| shown(number + 1, name, text))
        .collect();
    let head = Head {
        found: Vec::new(),
        title: "drivebench: a test",
        facts: Vec::new(),
    };
    run(&head, all)
}

/// A scenario that fails: the third byte that comes is another one.
const FAILS: &str = "title One byte is not as it should be\nsource nd21 10.1 read-byte\nring 3\ndrive 1 memory FE13 = 88\n\n\
                     > 88 FE C0 13 FE D1\n> 80*3\n< 88 01 C1 13 88 A5 80*3\n";
