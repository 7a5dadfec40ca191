//! What a run leaves for other tools, and captures that are read back.

mod forms;
mod hostile;
mod round_trip;
mod routes;
mod telegrams;
mod tools;

use harness::buses::novobus::BUS;
use harness::capture::Capture;
use harness::library::Entry;
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use harness::shown::{FileForm, ShownRun};
use harness_proto::line::LineError;
use harness_sim::record::LineByte;

use std::path::{Path, PathBuf};
use std::process::Output;

fn root() -> &'static Path {
    Path::new(env!("TREE"))
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
    let rate = entry.rate();
    let plan = &entry.settled;
    let mut link = plan.simulate();
    plan.play(&mut *link, AtMismatch::GoOn);
    let traces = (0..plan.ports()).map(|ring| link.trace(ring)).collect();
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

/// The same in this form, with this title.
fn written(capture: &Capture, form: FileForm, title: &str) -> Vec<u8> {
    let run = ShownRun {
        title,
        traces: &capture.traces,
        records: &[],
        rate: capture.rate,
    };
    let mut bytes = Vec::new();
    BUS.report.write(&run, form, &mut bytes).expect("a Vec");
    bytes
}

/// What the receiver of a byte noticed.
fn status(byte: &LineByte) -> &'static str {
    match (byte.received, byte.error) {
        (None, _) => "dropped",
        (Some(_), None) => "ok",
        (Some(_), Some(LineError::Parity)) => "parity",
        (Some(_), Some(LineError::Framing)) => "framing",
        (Some(_), Some(LineError::Break)) => "break",
        (Some(_), Some(LineError::Overrun)) => "overrun",
    }
}

/// Every kind of damage on the link between two drives, every byte a telegram of its own.
const DAMAGED: &str = "title damage\nring 2\n\
    ! 1->0 byte 3: flip 2\n! 1->0 byte 5: flip p\n! 1->0 byte 7: flip s\n! 1->0 byte 9: break 300us\n\
    ! 1->0 byte 12: overrun\n! 1->0 byte 14: drop\n! 1->0 byte 16: insert 55\n! 1->0 byte 18: replace 81\n\
    ! 1->0 byte 20: duplicate\n> 80*30\n";

/// On standard output.
fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// It ended with this exit code; what it said on both streams.
#[track_caller]
fn ended(output: &Output, code: i32) -> String {
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{errors}{}", said(output));
    format!("{}{errors}", said(output))
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}
