//! What a run leaves for other tools, and captures that are read back.

mod empty;
mod forms;
mod frames;
mod hostile;
mod judged;
mod portions;
mod program;
mod round_trip;
mod routes;
mod telegrams;
mod tools;

use harness::buses::novobus::simulate::simulated;
use harness::capture::Capture;
use harness::library::Entry;
use harness::link::Link;
use harness::scenario::run::{AtMismatch, play};
use harness::scenario::source::Source;

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A file in a folder of these tests' own.
fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("captures");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join(name)
}

/// A scenario's run.
fn run(text: &str) -> Capture {
    let source = Source::from_bytes("test.scn".to_owned(), text.into()).expect("a text");
    let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{:#?}\n{text}", p.all()));
    let plan = entry.plan.expect("novobus");
    let mut link = simulated(&plan);
    play(&plan, &mut link, AtMismatch::GoOn);
    let traces = (0..plan.rings.len()).map(|ring| link.trace(ring)).collect();
    let rate = plan.rate;
    Capture {
        rate,
        traces,
        listened: None,
        timed: true,
    }
}

/// A built-in scenario's text.
fn text(name: &str) -> String {
    let path = root().join(format!("corpora/scenarios/novobus/{name}.scn"));
    std::fs::read_to_string(path).expect("a scenario")
}

/// A built-in scenario's run.
fn built_in(name: &str) -> Capture {
    run(&text(name))
}

fn pcapng(capture: &Capture) -> Vec<u8> {
    let mut bytes = Vec::new();
    harness::report::pcapng::write(&capture.traces, capture.rate, &mut bytes).expect("a Vec");
    bytes
}

fn json(capture: &Capture) -> Vec<u8> {
    let mut bytes = Vec::new();
    harness::buses::novobus::report::json::write(&capture.traces, &[], &mut bytes).expect("a Vec");
    bytes
}

/// Every kind of damage on the link between two drives, every byte a telegram of its own.
const DAMAGED: &str = "title damage\nring 2\n\
    ! 1->0 byte 3: flip 2\n! 1->0 byte 5: flip p\n! 1->0 byte 7: flip s\n! 1->0 byte 9: break 300us\n\
    ! 1->0 byte 12: overrun\n! 1->0 byte 14: drop\n! 1->0 byte 16: insert 55\n! 1->0 byte 18: replace 81\n\
    ! 1->0 byte 20: duplicate\n> 80*30\n";
