//! How long the page of a 100-axis run takes (the parity error of ND21 9.7 and the check sequence of 9.8), beside a baseline that
//! only writes what every byte is, as CSV; and how long a browser takes to open it, beside an empty page.

use harness::buses::novobus::BUS;
use harness::library::Entry;
use harness::scenario::run::{AtMismatch, Outcome};
use harness::scenario::source::Source;
use harness::shown::{FileForm, ShownRun};
use harness::shown::{Head, ScenarioView, run, section};
use harness_sim::record::Trace;
use std::process::Command;

fn main() {
    divan::main();
}

const TEXTS: [(&str, &str); 2] = [
    (
        "9.7-parity-error",
        include_str!("../../../corpora/scenarios/novobus/9.7-parity-error.scn"),
    ),
    (
        "9.8-check-sequence",
        include_str!("../../../corpora/scenarios/novobus/9.8-check-sequence.scn"),
    ),
];

fn played() -> Vec<(Entry, Outcome, Vec<Trace>)> {
    let all = TEXTS.map(|(name, text)| {
        let source = Source::from_bytes(name.to_owned(), text.into()).expect("a text");
        let entry = Entry::new(source, None).expect("a scenario");
        let plan = &entry.settled;
        let mut link = plan.simulate();
        let outcome = plan.play(&mut *link, AtMismatch::Stop);
        let traces = vec![link.trace(0)];
        (entry, outcome, traces)
    });
    all.into()
}

/// The page of finished runs.
fn page_of(all: &[(Entry, Outcome, Vec<Trace>)]) -> String {
    let shown = all
        .iter()
        .enumerate()
        .map(|(number, (entry, outcome, traces))| {
            let played = ScenarioView {
                name: entry.short_name(),
                title: &entry.scenario.title,
                sources: &[],
                drives: "100",
                text: &entry.source.text,
                outcome,
                traces,
                report: BUS.report,
                rate: harness_proto::line::Rate::default(),
                again: "",
            };
            section(number, &played)
        });
    let head = Head {
        title: "100 axes",
        facts: Vec::new(),
        found: Vec::new(),
    };
    run(&head, shown.collect())
}

/// The page, from the finished runs to its last byte.
#[divan::bench]
fn page(bencher: divan::Bencher<'_, '_>) {
    let all = played();
    bencher.bench_local(|| page_of(&all));
}

/// Whether Debian's `chromium` is not there; `.ci/tools` installs it.
fn no_chromium() -> bool {
    Command::new("chromium").arg("--version").output().is_err()
}

/// A headless browser from its start until a page has been opened, its script has run and its elements are written out.
fn open(bencher: divan::Bencher<'_, '_>, page: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("page.html");
    std::fs::write(&file, page).expect("room");
    bencher.bench_local(|| {
        let mut browser = Command::new("chromium");
        browser.args(["--headless=new", "--no-sandbox", "--dump-dom"]);
        let output = browser.arg(&file).output().expect("chromium");
        assert!(output.status.success());
        output
    });
}

/// The page in a browser.
#[divan::bench(sample_count = 7, sample_size = 1, ignore = no_chromium())]
fn page_opened(bencher: divan::Bencher<'_, '_>) {
    open(bencher, &page_of(&played()));
}

/// The baseline of that: a page with nothing on it.
#[divan::bench(sample_count = 7, sample_size = 1, ignore = no_chromium())]
fn empty_page_opened(bencher: divan::Bencher<'_, '_>) {
    open(bencher, "<!doctype html><title>nothing</title>");
}

/// The baseline: what every byte is, as rows of text.
#[divan::bench]
fn bytes_read(bencher: divan::Bencher<'_, '_>) {
    let all = played();
    bencher.bench_local(|| {
        for (.., traces) in &all {
            let run = ShownRun {
                title: "",
                traces,
                records: &[],
                rate: harness_proto::line::Rate::default(),
            };
            let written = BUS.report.write(&run, FileForm::Csv, &mut std::io::sink());
            written.expect("a sink takes everything");
        }
    });
}
