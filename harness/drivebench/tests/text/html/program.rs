//! The commands that write pages.

use super::folder;
use super::parser::{parse, sound};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub(super) fn drivebench(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(arguments).env("NO_COLOR", "1");
    command.output().expect("the program")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

pub(super) fn path(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn run_writes_a_page_over_an_old_one() {
    let home = folder("run");
    let file = home.join("page.html");
    std::fs::write(&file, "old").expect("a file");
    let output = drivebench(&[
        "run",
        "9.2-synco",
        "9.7-parity-error",
        "--html",
        path(&file),
    ]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let html = read(&file);
    sound(&parse(&html));
    assert!(html.contains("2 passed") && html.contains("id=\"s2\""));
    assert_eq!(
        std::fs::read_dir(&home).expect("a folder").count(),
        1,
        "nothing is left beside it"
    );
    // Run twice, the same page.
    drivebench(&[
        "run",
        "9.2-synco",
        "9.7-parity-error",
        "--html",
        path(&file),
    ]);
    assert_eq!(read(&file), html);
}

/// The record is the truth of a run, and the reports follow from it, byte by byte.
#[test]
fn a_folder_gives_its_reports_again() {
    let home = folder("again");
    let (evidence, html, xml) = (
        home.join("evidence"),
        home.join("again.html"),
        home.join("again.xml"),
    );
    let page = home.join("page.html");
    let setup = home.join("wrong.scn");
    std::fs::write(&setup, super::FAILS).expect("a file");
    let output = drivebench(&[
        "run",
        "--rig",
        "sim:3",
        path(&setup),
        "9.2-synco",
        "9.7-parity-error",
        "10.1-read-byte",
        "--evidence",
        path(&evidence),
        "--html",
        path(&page),
    ]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let output = drivebench(&[
        "report",
        path(&evidence),
        "--html",
        path(&html),
        "--junit",
        path(&xml),
    ]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = read(&html);
    assert_eq!(text, read(&evidence.join("report.html")));
    assert_eq!(text, read(&page));
    assert_eq!(read(&xml), read(&evidence.join("junit.xml")));
    sound(&parse(&text));
    // What was skipped is there, and what was expected is known again.
    assert!(text.contains("9.7-parity-error") && text.contains("skipped"));
    assert!(text.contains("Expected and received around byte"));
    assert!(read(&evidence.join("SHA256SUMS")).contains("  report.html\n"));
    let verified = drivebench(&["verify", path(&evidence)]);
    assert_eq!(verified.status.code(), Some(0), "{verified:?}");
}

/// A run that was killed: of every length of its record there is a report or a reason.
#[test]
fn a_folder_that_is_cut_off_gives_what_there_is() {
    let home = folder("cut");
    let evidence = home.join("evidence");
    let output = drivebench(&[
        "run",
        "--rig",
        "sim:3",
        "9.2-synco",
        "10.1-read-byte",
        "--evidence",
        path(&evidence),
    ]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let record = evidence.join("run.jsonl");
    let whole = std::fs::read(&record).expect("a record");
    let html = home.join("page.html");
    let lines = whole.iter().filter(|byte| **byte == b'\n').count();
    let length = |count: usize| {
        let ends = whole.iter().enumerate().filter(|(_, byte)| **byte == b'\n');
        ends.map(|(at, _)| at + 1).nth(count - 1).expect("a line")
    };
    for cut in [
        length(1),
        length(2),
        length(lines / 2) + 7,
        length(lines - 2),
        length(lines - 1),
    ] {
        std::fs::write(&record, &whole[..cut]).expect("a file");
        let output = drivebench(&["report", path(&evidence), "--html", path(&html)]);
        assert_eq!(output.status.code(), Some(0), "{cut}: {output:?}");
        let text = read(&html);
        sound(&parse(&text));
        assert!(text.contains("the record ends before the run did"), "{cut}");
    }
    // A verdict that there is not, and a name that leads elsewhere.
    let text = String::from_utf8(whole.clone()).expect("text");
    let named = text.replace("\"name\":\"9.2-synco\"", "\"name\":\"../../9.2-synco\"");
    std::fs::write(&record, named).expect("a file");
    let output = drivebench(&["report", path(&evidence), "--html", path(&html)]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    sound(&parse(&read(&html)));
    let judged = text.replace("\"verdict\":\"passed\"", "\"verdict\":\"splendid\"");
    std::fs::write(&record, judged).expect("a file");
    let output = drivebench(&["report", path(&evidence), "--html", path(&html)]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("`splendid` is not a verdict"));
    std::fs::write(&record, "{\"kind\":\"other\"}\n").expect("a file");
    std::fs::remove_file(&html).expect("a file");
    for folder in [path(&evidence), path(&home), "/dev/null"] {
        let output = drivebench(&["report", folder, "--html", path(&html)]);
        assert_eq!(output.status.code(), Some(2), "{folder}: {output:?}");
        assert!(!html.exists() && !output.stderr.is_empty());
    }
}

/// Fuzzes a ring with a drive that ignores writes until that is found; the folder of the run, and its page.
pub(super) fn finding(folder: &Path) -> (PathBuf, PathBuf) {
    let (out, html) = (folder.join("run"), folder.join("page.html"));
    let run = "fuzz run --seed 7 --cases 2000 --deviates 1=writes-ignored --findings 1";
    let files = ["--out", path(&out), "--html", path(&html)];
    let arguments: Vec<_> = run.split(' ').chain(files).collect();
    let output = drivebench(&arguments);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    (out, html)
}

/// The page of a run of fuzzing: what was found with its picture, made again from the folder.
#[test]
fn fuzzing_writes_a_page() {
    let home = folder("fuzz");
    let again = home.join("again.html");
    let (out, html) = finding(&home);
    let text = read(&html);
    let parsed = parse(&text);
    sound(&parsed);
    for words in [
        "1 finding",
        "drive 1 deviates writes-ignored",
        "Transitions reached",
        "Expected and received around byte",
    ] {
        assert!(text.contains(words), "{words}");
    }
    assert!(
        text.contains("drivebench shrink finding-"),
        "the command that plays it again"
    );
    let output = drivebench(&["report", path(&out), "--html", path(&again)]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(read(&again), text);
    let output = drivebench(&["report", path(&out), "--junit", path(&again)]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
}

/// The page of a campaign: the same figures as its table, and a cell for each byte of each link.
#[test]
fn a_campaign_writes_a_page() {
    let home = folder("campaign");
    let html = home.join("page.html");
    let output = drivebench(&["campaign", "9.9-silence", "--html", path(&html)]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = read(&html);
    let parsed = parse(&text);
    sound(&parsed);
    let all = parsed.all();
    let map = all
        .iter()
        .find(|element| element.attribute("class") == Some("heat"))
        .expect("a map");
    let rows: Vec<_> = map
        .all()
        .into_iter()
        .filter(|element| element.name == "tr")
        .collect();
    // Three drives have four links.
    assert!(rows.iter().all(|row| {
        row.all()
            .iter()
            .filter(|element| element.name == "td" || element.name == "th")
            .count()
            == 5
    }));
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let located = printed
        .lines()
        .find(|line| line.contains("located"))
        .expect("a row");
    let count = located.split_whitespace().nth(1).expect("a count");
    let row = all
        .iter()
        .filter(|element| element.name == "tr")
        .find(|row| row.text().replace('\n', " ").trim().starts_with("located"))
        .expect("a row");
    assert!(row.text().contains(count), "{count}");
    assert!(text.contains("drivebench campaign 9.9-silence --case"));
}
