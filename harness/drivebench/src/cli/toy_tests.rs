//! The example bus `harness/toy`, from the text of a scenario to the table and the page of HTML.

use crate::command::play::play_entry;
use crate::library::Entry;
use crate::library::finding::explain;
use crate::library::page::page;
use crate::scenario::run::{AtMismatch, Outcome};
use crate::scenario::settled::BenchSize;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::shown::{Head, ScenarioView, run, section};
use harness_sim::record::Trace;
use harness_toy::BUS;

const HEADER: &str = "title   A valve opens\nsource  valves 2.1\nbus     valves\n";

fn source(text: &str) -> Source {
    Source {
        name: "valves.scn".to_owned(),
        text: text.into(),
    }
}

/// Plays it as `run` does.
fn played(text: &str) -> (Entry, Outcome, Vec<Trace>) {
    let source = source(&format!("{HEADER}{text}"));
    let entry = Entry::of(&BUS, source, BenchSize::Own).expect("a scenario");
    let played = play_entry(&entry, AtMismatch::GoOn);
    (entry, played.outcome, played.traces)
}

/// The page of HTML that `run --html` writes.
fn html(entry: &Entry, outcome: &Outcome, traces: &[Trace]) -> String {
    let shown = ScenarioView {
        name: entry.short_name(),
        title: &entry.scenario.title,
        sources: &[],
        drives: &entry.drives(),
        text: &entry.source.text,
        outcome,
        traces,
        report: entry.report,
        rate: harness_proto::line::Rate::default(),
        again: "",
    };
    let head = Head {
        found: Vec::new(),
        title: "Valves",
        facts: Vec::new(),
    };
    run(&head, vec![section(1, &shown)])
}

const OPENS: &str = "valve 1\n\nopen 1 = 50\n? valve 1 at 50\n+0.1ms > 101 00\n< 201 00 xx\n";

#[test]
fn from_a_scenario_to_a_table_and_a_page() {
    let (entry, outcome, traces) = &played(OPENS);
    let message = outcome.finding.as_ref().map(|mismatch| &mismatch.message);
    assert_eq!(message, None);
    assert_eq!(outcome.verdict, Verdict::Passed);
    let table = "meaning\n0.126 ms  valve 1: go to 50 %\n0.352 ms  valve 1 is at 50 %\n";
    let text = page(entry, outcome, traces);
    assert!(
        text.starts_with("A valve opens\npins valves 2.1\npassed after "),
        "{text}"
    );
    assert!(text.contains(table), "{text}");
    let html = html(entry, outcome, traces);
    assert!(html.contains("valve 1: go to 50 %"), "{html}");
    assert!(html.contains("passed"), "{html}");
}

#[test]
fn a_wrong_device_fails_in_the_words_of_its_bus() {
    let (entry, outcome, traces) = &played(&OPENS.replace("valve 1\n\n", "valve 1 sticks\n\n"));
    let finding = outcome.finding.as_ref().expect("it fails");
    assert_eq!(outcome.verdict, Verdict::Failed);
    let expected = "the master received 201#0100 where 201 01 32 is expected";
    assert_eq!(finding.message, expected);
    let text = explain(entry, finding, traces);
    assert!(
        text.starts_with("valves.scn:6:1: the master received"),
        "{text}"
    );
    assert!(text.contains("    open 1 = 50\n"), "{text}");
    assert!(text.contains("valve 1 is at 0 %\n"), "{text}");
    assert!(html(entry, outcome, traces).contains(expected));
    let (_, outcome, _) = played("valve 1 sticks\n\n> 101 01 32\n< 201 01 xx\n? valve 1 at 50\n");
    let message = outcome.finding.map(|mismatch| mismatch.message);
    assert_eq!(message.as_deref(), Some("valve 1 is at 0 %, expected 50 %"));
}

#[test]
fn what_no_line_asks_for_is_a_failure() {
    let (_, outcome, _) = played("valve 1\n\n> 101 00\n");
    assert_eq!(outcome.verdict, Verdict::Failed);
    let message = outcome
        .finding
        .map_or(String::new(), |mismatch| mismatch.message);
    assert!(message.starts_with("201#0000 was received"), "{message}");
}

#[test]
fn its_mistakes_have_their_places_and_suggestions() {
    let mistake = |steps: &str| {
        let source = source(&format!("{HEADER}valve 1\n\n{steps}\n"));
        let found = (BUS.settle)(&source, BenchSize::Own).expect_err("a mistake");
        let first = found.all()[0].clone();
        let place = source.text[first.span.start..first.span.end].to_owned();
        (place, first.help.unwrap_or_default())
    };
    assert_eq!(mistake("> 10 00").0, "10");
    assert_eq!(mistake("open 1 = 101").0, "101");
    assert_eq!(mistake("open 2 = 10").0, "open 2 = 10");
    let found = mistake("opne 1 = 10");
    assert_eq!(
        found,
        ("opne".to_owned(), "did you mean `open`?".to_owned())
    );
}
