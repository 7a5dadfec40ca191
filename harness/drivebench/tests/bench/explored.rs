//! The commands as processes: what is kept, and that a killed run goes on.

use crate::program::{ended, findings, name};
use harness::explore::RECORD;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program to its end.
fn drivebench(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(arguments).stdin(Stdio::null());
    command.output().expect("the program")
}

/// The names of their files.
fn names(folder: &Path) -> Vec<std::ffi::OsString> {
    findings(folder)
        .iter()
        .filter_map(|path| path.file_name().map(ToOwned::to_owned))
        .collect()
}

/// What a record holds but for how often the progress was written.
fn settled(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join(RECORD)).expect("a record");
    let lines = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("a line"));
    let all: Vec<Value> = lines.collect();
    let last = all.iter().rev().find(|line| line["kind"] == "progress");
    let last = last.cloned();
    let mut kept: Vec<_> = all
        .into_iter()
        .filter(|line| line["kind"] != "progress")
        .collect();
    kept.extend(last);
    kept
}

/// Begins a run and kills it (SIGKILL) when some of it is done.
fn begin_and_kill(arguments: &[&str], folder: &Path) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program");
    // Until some of it is done.
    let record = folder.join(RECORD);
    let done =
        || std::fs::read_to_string(&record).is_ok_and(|text| text.contains("\"cases\":300,"));
    while !done() && child.try_wait().expect("a process").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().expect("SIGKILL");
    let _gone = child.wait().expect("an end");
}

/// Killed between two cases a run goes on, and comes to what an undisturbed one comes to.
#[test]
fn a_killed_run_goes_on() {
    for (planted, cases) in [
        (&["--deviates", "1=process-data-ignored"][..], "4000"),
        (
            &["--rig", "sim:2,3", "--deviates", "2:1=process-data-ignored"],
            "2000",
        ),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let (killed, whole) = (folder.path().join("killed"), folder.path().join("whole"));
        let fixed = ["fuzz", "run", "--cases", cases, "--findings", "99"];
        let begin = [&fixed[..], planted, &["--seed", "5", "--out"]].concat();
        let ending = format!("{cases} cases");
        ended(
            &drivebench(&[&begin[..], &[name(&whole)]].concat()),
            1,
            &ending,
        );
        begin_and_kill(&[&begin[..], &[name(&killed)]].concat(), &killed);
        let record = killed.join(RECORD);
        // Half a line at its end, as a killed writer leaves it.
        let mut text = std::fs::read_to_string(&record).expect("a record");
        text.push_str("{\"kind\":\"kept\",\"num");
        std::fs::write(&record, text).expect("room");
        let resumed = drivebench(&[&fixed[..], &["--resume", name(&killed)]].concat());
        ended(&resumed, 1, &ending);
        assert_eq!(settled(&killed), settled(&whole));
        assert_eq!(names(&killed), names(&whole));
        assert!(!names(&killed).is_empty());
        for (one, other) in findings(&killed).iter().zip(findings(&whole)) {
            let read = |path: &Path| std::fs::read(path).expect("a finding");
            assert_eq!(read(one), read(&other));
        }
    }
}

/// The kept conversations show no fault of right drives.
#[test]
fn the_corpus_is_replayed() {
    let corpus = concat!(env!("TREE"), "/corpora/fuzz/ring");
    let replay = ["fuzz", "replay", corpus, "--rig", "sim:3"];
    ended(&drivebench(&replay), 0, "0 found");
}
