//! The commands as processes: exit codes, what is kept, and that a killed run goes on.

use crate::program::{ended, findings, name};
use harness::explore::RECORD;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program to its end.
pub(crate) fn drivebench(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(arguments).stdin(Stdio::null());
    command.output().expect("the program")
}

/// A checkout with nothing in it.
pub(crate) fn empty_checkout(folder: &Path) {
    for inner in [
        "corpora/scenarios/novobus",
        "corpora/fuzz/ring",
        "snapshots/scenarios/novobus",
    ] {
        std::fs::create_dir_all(folder.join(inner)).expect("room");
    }
}

/// The names of their files.
pub(crate) fn names(folder: &Path) -> Vec<std::ffi::OsString> {
    findings(folder)
        .iter()
        .filter_map(|path| path.file_name().map(ToOwned::to_owned))
        .collect()
}

/// What a record holds but for how often the progress was written.
pub(crate) fn settled(folder: &Path) -> Vec<Value> {
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

/// From nothing to a scenario that is kept: `fuzz run`, `shrink`, `promote`, `run`.
#[test]
fn from_a_seed_to_a_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let arguments = [
        "fuzz",
        "run",
        "--deviates",
        "2=and-is-or",
        "--findings",
        "1",
        "--progress",
        "bar",
        "--out",
    ];
    let output = drivebench(&[&arguments[..], &[name(&out)]].concat());
    ended(&output, 1, "1 found, 0 flaky");
    ended(&output, 1, "round 0:");
    // A finished run does not end in silence.
    let resumed = [
        "fuzz",
        "run",
        "--cases",
        "9000",
        "--findings",
        "1",
        "--resume",
    ];
    let resumed = drivebench(&[&resumed[..], &[name(&out)]].concat());
    ended(
        &resumed,
        1,
        "nothing was played: the run has 1 finding already; give --findings with more",
    );
    let found = findings(&out);
    let output = drivebench(&["shrink", name(&found[0])]);
    ended(&output, 0, "nothing more can be taken away");
    let small = found[0].with_file_name(format!(
        "{}-small.json",
        found[0]
            .file_stem()
            .and_then(|stem| stem.to_str())
            .expect("a name")
    ));
    let top = folder.path().join("top");
    empty_checkout(&top);
    let promote = [
        "promote",
        name(&small),
        "--name",
        "10.3-and",
        "--checkout",
        name(&top),
    ];
    ended(
        &drivebench(&promote),
        0,
        "the drives with the finding fail it",
    );
    ended(&drivebench(&promote), 2, "is there already");
    let table = top.join("snapshots/scenarios/novobus/10.3-and.snap");
    let table = std::fs::read_to_string(table).expect("a table");
    assert!(table.contains("passed after"), "{table}");
    let scenario = top.join("corpora/scenarios/novobus/10.3-and.scn");
    ended(&drivebench(&["run", name(&scenario)]), 0, "1 passed");
    // The same conversation with the drive that it was found on.
    let text = std::fs::read_to_string(&scenario).expect("a text");
    let (head, steps) = text.split_once("\n\n").expect("a header");
    let wrong = top.join("wrong.scn");
    std::fs::write(
        &wrong,
        format!("{head}\ndrive 0..last deviates and-is-or\n\n{steps}"),
    )
    .expect("room");
    ended(&drivebench(&["run", name(&wrong)]), 1, "1 failed");
}

/// What a run has kept is tried on another rig, what shows most first (exit code 1 where something is found).
#[test]
fn what_was_kept_is_replayed() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let run = ["fuzz", "run", "--cases", "300", "--out"];
    ended(
        &drivebench(&[&run[..], &[name(&out)]].concat()),
        0,
        "300 cases",
    );
    let rig = folder.path().join("wrong.toml");
    let lines = "schema = 1\n[rig]\nid = \"wrong\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n[sim]\n\
                 setup = [\"drive 0..last model plain\", \"drive 1..2 deviates checksum-wrong\"]\n";
    std::fs::write(&rig, lines).expect("room");
    let replay = ["fuzz", "replay", name(&out), "--wire-time", "2s", "--rig"];
    ended(
        &drivebench(&[&replay[..], &[name(&rig)]].concat()),
        1,
        "checking byte of the answer",
    );
    ended(
        &drivebench(&[&replay[..], &["sim:3"]].concat()),
        0,
        "0 found",
    );
    let corpus = concat!(env!("TREE"), "/corpora/fuzz/ring");
    let replay = ["fuzz", "replay", corpus, "--rig", "sim:3"];
    ended(&drivebench(&replay), 0, "0 found");
}

/// A run that finds nothing passes.
#[test]
fn a_sound_ring_passes() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let arguments = [
        "fuzz",
        "run",
        "--cases",
        "400",
        "--rig",
        "sim:2",
        "--out",
        name(&out),
    ];
    ended(&drivebench(&arguments), 0, "400 cases");
}

/// Begins a run and kills it (SIGKILL) when some of it is done.
pub(crate) fn begin_and_kill(arguments: &[&str], folder: &Path) {
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
    let folder = tempfile::tempdir().expect("a folder");
    let (killed, whole) = (folder.path().join("killed"), folder.path().join("whole"));
    let run = [
        "fuzz",
        "run",
        "--deviates",
        "1=process-data-ignored",
        "--seed",
        "5",
        "--findings",
        "99",
    ];
    let cases = ["--cases", "4000", "--out"];
    let undisturbed = drivebench(&[&run[..], &cases[..], &[name(&whole)]].concat());
    ended(&undisturbed, 1, "4000 cases");
    begin_and_kill(&[&run[..], &cases[..], &[name(&killed)]].concat(), &killed);
    let record = killed.join(RECORD);
    // Half a line at its end, as a killed writer leaves it.
    let mut text = std::fs::read_to_string(&record).expect("a record");
    text.push_str("{\"kind\":\"kept\",\"num");
    std::fs::write(&record, text).expect("room");
    let resumed = drivebench(&[
        "fuzz",
        "run",
        "--cases",
        "4000",
        "--findings",
        "99",
        "--resume",
        name(&killed),
    ]);
    ended(&resumed, 1, "4000 cases");
    assert_eq!(settled(&killed), settled(&whole));
    assert_eq!(names(&killed), names(&whole));
    assert!(!names(&killed).is_empty());
    for (one, other) in findings(&killed).iter().zip(findings(&whole)) {
        let read = |path: &Path| std::fs::read(path).expect("a finding");
        assert_eq!(read(one), read(&other));
    }
}

/// Everything that cannot be says what, where and what to do (exit code 2).
#[test]
fn what_cannot_be() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    std::fs::write(&file, "x").expect("room");
    let under = file.join("run");
    let out = folder.path().join("run");
    let rig = folder.path().join("rig.toml");
    let lines = "schema = 1\n[rig]\nid = \"rig\"\n[ring.1]\ndrives = 3\ntransport = \"sim\"\n[sim]\n\
                 setup = [\"drive 0 property time-out = 15ms\"]\n";
    std::fs::write(&rig, lines).expect("room");
    let run = |more: &[&str]| drivebench(&[&["fuzz", "run", "--cases", "60"][..], more].concat());
    ended(
        &run(&["--out", name(&under)]),
        2,
        "failed to make the folder",
    );
    ended(&run(&["--out", name(folder.path())]), 2, "is not empty");
    ended(
        &run(&["--resume", name(folder.path())]),
        2,
        "there is no run.jsonl in it",
    );
    ended(
        &run(&["--deviates", "1=nonsense"]),
        2,
        "there is no deviation `nonsense`",
    );
    ended(
        &run(&["--deviates", "7=writes-ignored", "--out", name(&out)]),
        2,
        "ring 1 has the drives 0 to 2, and no drive 7",
    );
    ended(&run(&["--confirm", "4/3"]), 2, "such as 2/3");
    ended(
        &run(&["--rig", name(&rig), "--out", name(&out)]),
        2,
        "the rig says `drive 0 property time-out = 15ms`",
    );
    let plain = folder.path().join("plain.toml");
    let lines = lines.replace("property time-out = 15ms", "model plain");
    std::fs::write(&plain, lines).expect("room");
    ended(
        &run(&[
            "--rig",
            name(&plain),
            "--out",
            name(&folder.path().join("mixed")),
        ]),
        2,
        "makes some of them plain",
    );
    ended(
        &run(&["--deviates", "2:1=writes-ignored", "--out", name(&out)]),
        2,
        "no ring 2",
    );
    ended(
        &run(&["--deviates", "3:1=writes-ignored"]),
        2,
        "in ring 2 as 2:1=",
    );
    ended(&run(&["--out", name(&out)]), 0, "60 cases");
}

/// A run in which no case was judged has not passed.
#[test]
fn nothing_judged_has_not_passed() {
    let folder = tempfile::tempdir().expect("a folder");
    for bound in [["--cases", "0"], ["--wire-time", "1ms"]] {
        let out = folder.path().join(bound[0]);
        let run = ["fuzz", "run", bound[0], bound[1], "--out", name(&out)];
        ended(&drivebench(&run), 5, "0 cases");
    }
    let out = folder.path().join("run");
    let run = ["fuzz", "run", "--cases", "60", "--out", name(&out)];
    ended(&drivebench(&run), 0, "60 cases");
    let replay = |time: &str, code| {
        let replay = [
            "fuzz",
            "replay",
            name(&out),
            "--rig",
            "sim:3",
            "--wire-time",
        ];
        ended(
            &drivebench(&[&replay[..], &[time]].concat()),
            code,
            " 0 found",
        );
    };
    replay("1ms", 5);
    replay("1h", 0);
}

/// Two processes never work on one run.
#[test]
fn one_at_a_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let run = ["fuzz", "run", "--cases", "20", "--out", name(&out)];
    ended(&drivebench(&run), 0, "20 cases");
    // A record of a version that knew no spices.
    let record = out.join(RECORD);
    let text = std::fs::read_to_string(&record).expect("a record");
    let (first, rest) = text.split_once('\n').expect("lines");
    let mut about: Value = serde_json::from_str(first).expect("a line");
    about["spices"] = Value::Array(Vec::new());
    std::fs::write(&record, format!("{about}\n{rest}")).expect("room");
    let held = std::fs::File::open(&record).expect("a record");
    held.lock().expect("a lock");
    let resume = ["fuzz", "run", "--cases", "60", "--resume", name(&out)];
    ended(&drivebench(&resume), 2, "another process works on the run");
    drop(held);
    let spices = "begin another run";
    ended(&drivebench(&resume), 2, spices);
}

/// A damaged record names the line, and what is no finding says so (exit code 2).
#[test]
fn what_is_damaged() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run");
    let run = |more: &[&str]| drivebench(&[&["fuzz", "run", "--cases", "60"][..], more].concat());
    ended(&run(&["--out", name(&out)]), 0, "60 cases");
    let record = out.join(RECORD);
    let text = std::fs::read_to_string(&record).expect("a record");
    let damaged = text.replacen("\"kind\":\"swarm\"", "\"kind\":\"storm\"", 1);
    std::fs::write(&record, damaged).expect("room");
    ended(&run(&["--resume", name(&out)]), 2, "run.jsonl, line 3");
    std::fs::write(&record, "").expect("room");
    ended(&run(&["--resume", name(&out)]), 2, "line 1");
    std::fs::write(&record, [0xFF, 0xFE]).expect("room");
    ended(&run(&["--resume", name(&out)]), 2, "failed to read");
    // Findings that are none.
    let file = folder.path().join("file");
    std::fs::write(&file, "x").expect("room");
    let nothing = folder.path().join("finding-000001.json");
    ended(
        &drivebench(&["shrink", name(&nothing)]),
        2,
        "there is no finding",
    );
    std::fs::write(&nothing, "{}").expect("room");
    ended(
        &drivebench(&["shrink", name(&nothing)]),
        2,
        "is not a finding",
    );
    ended(
        &drivebench(&["promote", name(&nothing), "--name", "x"]),
        2,
        "is not a finding",
    );
    ended(
        &drivebench(&["fuzz", "replay", name(&file), "--rig", "sim:3"]),
        2,
        "failed to read",
    );
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("room");
    ended(
        &drivebench(&["fuzz", "replay", name(&empty), "--rig", "sim:3"]),
        4,
        "holds no case",
    );
    ended(
        &drivebench(&["fuzz", "power", "nonsense"]),
        4,
        "no deviation has this text",
    );
}

/// The table of detection power: one line a deviation.
#[test]
fn power_is_shown() {
    let output = drivebench(&[
        "fuzz",
        "power",
        "checksum-wrong",
        "--seeds",
        "2",
        "--cases",
        "200",
    ]);
    ended(&output, 0, "1 of 1 found within 200 cases");
    ended(&output, 0, "wire 8.2-position-1");
}
