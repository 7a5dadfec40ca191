//! The program as a stranger uses it: streams, exit codes, messages.

use crate::typed::{code, drivebench, stderr, stdout};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A file in a folder of this test's own.
fn file(test: &str, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file");
    path
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

const GOOD: &str = "title good\nring 2\n> 80\n< 80\n";

/// Exit 0 means that something was judged.
#[test]
fn a_scenario_that_judges_nothing_does_not_pass() {
    for (text_of_it, exit, words) in [
        ("ring 2\n> 80\n", 5, "nothing was judged"),
        (
            "ring 2\n! 1->0 byte 1: drop\n> 80\n",
            5,
            "nothing was judged",
        ),
        ("ring 2\nwait 1ms\n", 5, "nothing was judged"),
        ("bus unitek\ndrive 1\n> 201 31 00 00\n", 0, ""),
        ("bus nordac\nslave 8\n! slave 8: off\n", 0, ""),
    ] {
        let scenario = file("judges-nothing", "s.scn", text_of_it);
        let output = drivebench(&["run", text(&scenario)]);
        let said = stdout(&output) + &stderr(&output);
        assert_eq!(code(&output), exit, "{text_of_it}{said}");
        assert!(said.contains(words), "{text_of_it}{said}");
    }
}

#[test]
fn without_arguments_all_built_in_scenarios_pass_from_any_folder() {
    let output = drivebench(&[]);
    assert_eq!(code(&output), 0, "{}{}", stdout(&output), stderr(&output));
    let lines = stdout(&output);
    assert!(
        lines.lines().filter(|l| l.starts_with("passed ")).count() > 40,
        "{lines}"
    );
    assert!(
        lines
            .lines()
            .last()
            .is_some_and(|l| l.contains(" passed, 0 failed"))
    );
    assert_eq!(
        stderr(&output),
        "",
        "nothing to say, and no progress bar where there is no terminal"
    );
}

#[test]
fn a_path_wins_over_a_built_in_name() {
    let path = file("path_wins", "9.7-parity-error", GOOD);
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["run", "9.7-parity-error"])
        .current_dir(path.parent().expect("a folder"))
        .output()
        .expect("the program starts");
    assert!(stdout(&output).contains("good"), "{}", stdout(&output));
    let built_in = drivebench(&["run", "9.7-parity-error"]);
    assert!(stdout(&built_in).contains("The 100-axis parity error"));
}

#[test]
fn folders_are_searched_and_filtered() {
    let path = file("folders", "a.scn", GOOD);
    file("folders", "b.scn", GOOD.replace("good", "another"));
    file("folders", "notes.txt", "no scenario");
    let folder = text(path.parent().expect("a folder"));
    let both = drivebench(&["run", folder]);
    assert!(
        stdout(&both).contains("2 passed, 0 failed"),
        "{}",
        stdout(&both)
    );
    let one = drivebench(&["run", folder, "--filter", "ANOTHER"]);
    assert!(
        stdout(&one).contains("1 passed, 0 failed"),
        "{}",
        stdout(&one)
    );
    let none = ["--filter", "nothing of the kind"];
    for command in [&["run", folder][..], &["qualify", "--rig", "sim:2"]] {
        let output = drivebench(&[command, &none].concat());
        assert_eq!(code(&output), 4, "{}", stdout(&output));
    }
}

#[test]
fn a_mismatch_is_shown_as_the_manuals_table() {
    let path = file(
        "mismatch",
        "wrong.scn",
        "title wrong\nsource nd21 9.7\nring 3\n> 88 FE C0 13 FE D1\n< 88 01 C0 13 77 A5\n",
    );
    let output = drivebench(&["run", text(&path)]);
    assert_eq!(code(&output), 1);
    assert!(stdout(&output).starts_with("failed wrong "));
    let shown = stderr(&output);
    for part in [
        "wrong.scn:5:1: the master received 00 where 77 is expected",
        "expected  88 01 C0 13 77 A5",
        "received  88 01 C0 13 00 2D",
        "^^ byte 5 at the master",
        "→    5      FE  FE  >00  [00]",
        "see nd21 9.7",
    ] {
        assert!(shown.contains(part), "{part}\n{shown}");
    }
}

#[test]
fn a_byte_that_never_comes_is_named() {
    let path = file("missing", "a.scn", "title a\nring 1\n> 80\n< 80 80\n");
    let output = drivebench(&["run", text(&path)]);
    assert_eq!(code(&output), 1);
    assert!(
        stderr(&output).contains("nothing more was received up to"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn wrong_files_are_exit_code_2_and_nothing_is_played() {
    let good = file("wrong_files", "good.scn", GOOD);
    let binary = file("wrong_files", "binary.scn", [0x7F, b'E', b'L', b'F', 0, 1]);
    let large = file("wrong_files", "large.scn", vec![b'\n'; 10 << 20]);
    let latin = file("wrong_files", "latin.scn", b"title caf\xE9\n");
    let empty = file("wrong_files", "empty.scn", "");
    for (path, message) in [
        (text(&binary), "byte 4 is 00"),
        (text(&large), "more than 1024 KiB"),
        (text(&latin), "byte 9 is E9"),
        (text(&empty), "how many drives"),
        ("/dev/zero", "is not a regular file"),
        ("no-such-file.scn", "failed to find no-such-file.scn"),
        ("9.7-parity-eror", "did you mean `9.7-parity-error`?"),
    ] {
        for command in ["run", "check", "trace"] {
            let output = drivebench(&[command, path]);
            assert_eq!(code(&output), 2, "{command} {path}: {}", stderr(&output));
            assert!(
                stderr(&output).contains(message),
                "{path}: {}",
                stderr(&output)
            );
            assert_eq!(stdout(&output), "", "{command} {path}");
        }
        let output = drivebench(&["run", text(&good), path]);
        assert_eq!(code(&output), 2);
        assert_eq!(
            stdout(&output),
            "",
            "nothing is played when one file is wrong"
        );
    }
}

#[test]
fn rings_that_cannot_be_are_refused_with_the_manuals_limit() {
    for size in ["0", "251", "99999999999999999999"] {
        let path = file("rings", "a.scn", format!("title a\nring {size}\n> 80\n"));
        let output = drivebench(&["check", text(&path)]);
        assert_eq!(code(&output), 2);
        assert!(
            stderr(&output).contains("1 to 250 (ND21 8.4)"),
            "{}",
            stderr(&output)
        );
        let output = drivebench(&["run", "--ring", size]);
        assert_eq!(code(&output), 2, "--ring {size}");
        assert!(stderr(&output).contains("250"), "{}", stderr(&output));
    }
}

#[test]
fn wrong_options_are_exit_code_2() {
    for arguments in [
        &["rnu"][..],
        &["run", "--no-such-option"],
        &["trace"],
        &["trace", "9.7-parity-error", "--format", "xml"],
        &["trace", "9.7-parity-error", "--rows", "9..3"],
        &["trace", "9.7-parity-error", "--rows", "0..3"],
        &["trace", "9.7-parity-error", "--ring", "99"],
        &["trace", "/tmp"],
        &["check"],
        &["completions", "tcl"],
        &["man", "/no/such/folder"],
    ] {
        let output = drivebench(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}: {}", stderr(&output));
        assert_ne!(stderr(&output), "");
        assert_eq!(stdout(&output), "");
    }
}

#[test]
fn a_ring_of_another_size_is_taken_where_the_scenario_allows_it() {
    let output = drivebench(&["run", "9.2-synco", "--ring", "250"]);
    assert_eq!(code(&output), 0);
    assert!(
        stdout(&output).contains("250 drives"),
        "{}",
        stdout(&output)
    );
    // What is wrong in the default ring only is no mistake in this one.
    let text_of_it = "ring 3..250\n> 80\n? drive 95 memory FE13 = 00\n";
    let path = file("sizes", "a.scn", text_of_it);
    assert_eq!(code(&drivebench(&["run", text(&path), "--ring", "100"])), 0);
    assert_eq!(code(&drivebench(&["run", text(&path)])), 2);
}

/// A scenario that was named is not played on a ring of another size than the one asked for; one of a folder is, and the run says so.
#[test]
fn a_ring_of_another_size_is_refused_where_the_named_scenario_forbids_it() {
    let path = file("other_sizes", "a.scn", "title a\nring 1..60\n> 80\n< 80\n");
    for named in [text(&path), "9.4-process-data-cut", "8.2-exchange-1"] {
        let output = drivebench(&["run", named, "--ring", "61"]);
        assert_eq!(code(&output), 2, "{named}");
        let said = stderr(&output);
        assert!(said.contains("not for a ring of 61"), "{said}");
        assert!(said.contains("nothing was played"), "{said}");
    }
    let folder = path.parent().expect("a folder");
    let output = drivebench(&["run", text(folder), "--ring", "61"]);
    assert_eq!(code(&output), 0);
    let said = stderr(&output);
    let expected =
        "on benches of their own sizes, because they are not for rings of 61 drives: 1 scenario\n";
    assert_eq!(said, expected);
    let output = drivebench(&["run", text(folder), "--ring", "60"]);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
}

#[test]
fn the_trace_of_an_example_is_what_the_documentation_says() {
    let output = drivebench(&["trace", "9.7-parity-error", "--format", "json"]);
    assert_eq!(code(&output), 0);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(json["schema"], 1);
    assert_eq!(json["ring"], 100);
    assert_eq!(json["links"].as_array().map(Vec::len), Some(101));
    assert_eq!(json["links"][0]["from"], "master");
    assert_eq!(json["links"][0]["to"], "99");
    assert_eq!(json["links"][100]["to"], "master");
    let first = &json["links"][0]["bytes"][0];
    assert_eq!(
        first,
        &serde_json::json!({"t_ns": 286_458, "sent": 136, "received": 136, "error": null})
    );
    let damaged = &json["links"][2]["bytes"][9];
    assert_eq!(damaged["sent"], 0x13);
    assert_eq!(damaged["received"], 0x12);
    assert_eq!(damaged["error"], "parity");
    let mark = &json["marks"][0];
    assert_eq!(mark["drive"], 97);
    assert_eq!(mark["byte"], 10);
    assert_eq!(mark["kind"], "detected");
    assert_eq!(mark["cause"], "parity");
}

#[test]
fn two_rings_run_on_one_clock() {
    let path = file(
        "two_rings",
        "a.scn",
        "title a\nring 2, 3\nstrict\ndrive 2:1 memory FE13 = 77\n> 80\n2> 80 80\n< 80\n2< 80 80\n\
         read-byte 2:1 FE13 = 77\n! 2:1->0 byte 20: drop\n? drives 2:0..last normal\n",
    );
    let output = drivebench(&["trace", text(&path), "--format", "json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(json["ring"], 2);
    assert_eq!(json["second"]["ring"], 3);
    assert!(stderr(&output).contains("this fault never happened: 2:1->0 byte 20: drop"));
}

const RECORDED: &str = "title recorded\nring 2\ndrive 0..last model nd21\nrecord drive 0 nsoll every 1ms\n\
    record drive 0 ps_status changes\nwrite-word 0 nsoll = 1500rpm\nwrite-byte 0 ps_status = 08\nwait 20ms\n";

#[test]
fn what_was_recorded_is_shown_below_the_scenario() {
    let path = file("recorded", "a.scn", RECORDED);
    let output = drivebench(&["run", text(&path)]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let shown = stdout(&output);
    for part in [
        "passed a ",
        "  drive 0 nsoll, every 1.000 ms\n",
        "  1499.9 rpm |   *****",
        "       0 rpm |***\n",
        "  drive 0 ps_status, changes\n",
        "08  acceleration and constant drive\n",
        "1 passed, 0 failed",
    ] {
        assert!(shown.contains(part), "{part}\n{shown}");
    }
    assert!(shown.is_ascii(), "{shown}");
    assert_eq!(
        stdout(&drivebench(&["run", text(&path)])),
        shown,
        "twice the same"
    );
    let table = drivebench(&["trace", text(&path)]);
    assert!(stdout(&table).contains("\ndrive 0 nsoll, every 1.000 ms\n"));
    let output = drivebench(&["trace", text(&path), "--format", "json"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(json["schema"], 1);
    let records = json["records"].as_array().expect("records");
    assert_eq!(records.len(), 2);
    assert_eq!(
        records[1]["samples"][0],
        serde_json::json!({"t_ns": 0, "raw": "00", "value": 0.0})
    );
}

#[test]
fn a_cell_that_is_otherwise_is_shown_in_its_unit() {
    let path = file(
        "otherwise",
        "a.scn",
        "title a\nring 4\ndrive 3 memory nist = 1498.3rpm\nread-word 3 nist = 1500rpm +-1%\n\
         drive 3 nist = 1500rpm +-0.1%\n",
    );
    let output = drivebench(&["run", text(&path)]);
    assert_eq!(code(&output), 1);
    let message = "a.scn:5:1: drive 3: nist is 1498.3 rpm (1618), expected 1500 rpm +-0.1 %\n";
    assert!(stderr(&output).contains(message), "{}", stderr(&output));
    let path = file(
        "otherwise",
        "b.scn",
        "title b\nring 1\ndrive 0 model plain\ndrive 0 rail 850V\n> 80\n",
    );
    let output = drivebench(&["run", text(&path)]);
    assert_eq!(code(&output), 2);
    for part in [
        "b.scn:4:1",
        "drive 0 has no plugs",
        "add `drive 0 model nd21`",
    ] {
        assert!(
            stderr(&output).contains(part),
            "{part}\n{}",
            stderr(&output)
        );
    }
}

#[test]
fn help_has_examples_and_exit_codes() {
    let output = drivebench(&["--help"]);
    assert_eq!(code(&output), 0);
    for part in [
        "Examples:",
        "drivebench trace 9.7-parity-error",
        "Exit codes:",
        "wrong usage",
    ] {
        assert!(stdout(&output).contains(part), "{part}");
    }
    for command in [
        "run",
        "list",
        "check",
        "trace",
        "manual",
        "completions",
        "man",
    ] {
        assert_eq!(code(&drivebench(&[command, "--help"])), 0, "{command}");
    }
    assert!(stdout(&drivebench(&["man"])).contains(".TH drivebench"));
    let pages = tempfile::tempdir().expect("a folder");
    let folder = pages.path().to_str().expect("a text");
    assert_eq!(code(&drivebench(&["man", folder])), 0);
    let has = |page: &str| pages.path().join(format!("drivebench-{page}.1")).exists();
    assert!(has("rig-check") && has("run") && !has("help-run") && !has("rig-help"));
    assert!(stdout(&drivebench(&["completions", "bash"])).contains("drivebench"));
}

#[test]
fn the_manual_shows_what_is_pinned_and_what_is_not() {
    let output = drivebench(&["manual"]);
    assert_eq!(code(&output), 0);
    let shown = stdout(&output);
    let line = |start: &str| {
        let found = shown.lines().find(|line| line.starts_with(start));
        found
            .unwrap_or_else(|| panic!("no line {start}"))
            .to_owned()
    };
    assert!(line("nd21 9.7 ").contains(" 9.7-parity-error"));
    // A connection diagram: no scenario can show it.
    assert!(line("nd21 13.1.5.1 ").ends_with("not yet"));
    assert!(shown.contains("prints \"286,46 ms\", meant is 286.46 us"));
    assert!(
        stdout(&drivebench(&["manual", "--missing"]))
            .lines()
            .all(|l| !l.starts_with("nd21 9.7 "))
    );
}

#[test]
fn deviations_are_listed() {
    let all = stdout(&drivebench(&["deviations"]));
    assert!(all.lines().count() >= 40, "{all}");
    assert!(all.contains("sends-16-zeros"), "{all}");
    let some = stdout(&drivebench(&["deviations", "16 ZEROS"]));
    // Two drives, and below a heading one master.
    assert_eq!(some.lines().count(), 4, "{some}");
    assert!(some.contains("check-sequence-of-16-zeros"), "{some}");
    let json = drivebench(&["deviations", "sends-16", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!(json["schema"], 1);
    assert_eq!(json["deviations"][0]["name"], "sends-16-zeros");
    assert_eq!(json["deviations"][0]["section"], "9.7");
    assert_eq!(
        json["deviations"][0]["models"],
        serde_json::json!(["plain", "nd21"])
    );
    assert_eq!(json["masters"], serde_json::json!([]));
    assert_eq!(code(&drivebench(&["deviations", "no such"])), 4);
}

#[test]
fn cells_are_shown_under_their_printed_names() {
    let all = stdout(&drivebench(&["cells"]));
    assert_eq!(all.lines().count(), 113, "the rows of ND21 14.2.1");
    let nsoll = all
        .lines()
        .find(|line| line.contains(" nsoll "))
        .expect("nsoll");
    assert!(nsoll.starts_with("FF08   2 write"), "{nsoll}");
    assert!(
        nsoll.contains(" rpm ") && nsoll.contains("14.5.3"),
        "{nsoll}"
    );
    let eeprom = stdout(&drivebench(&["cells", "--eeprom", "ee_selftest"]));
    assert!(eeprom.starts_with("47   1 write"), "{eeprom}");
    assert_eq!(code(&drivebench(&["cells", "no such cell"])), 4);
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .arg("manual")
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    // But a failure stays one.
    let path = file("closed_pipe", "a.scn", "ring 1\n> 80\n< A0\n");
    let mut child = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(["run", text(&path), "9.7-parity-error"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
}

/// The whole corpus reaches every transition; with a part of it the command lists the missing ones.
#[test]
fn fuzz_coverage() {
    let output = drivebench(&["fuzz", "coverage"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("(100.0 %)"));
    assert!(stdout(&output).contains("bus_end               49    15045  435 of 435\n"));
    let path = file("fuzz_coverage", "empty", "");
    let folder = path.parent().expect("a folder");
    let _none_before = std::fs::remove_dir_all(folder.join("detector"));
    let empty = drivebench(&["fuzz", "coverage", "--corpus", text(folder)]);
    assert_eq!(code(&empty), 4, "{}", stderr(&empty));
    file("fuzz_coverage/detector", "one.hex", "00 80");
    let part = drivebench(&["fuzz", "coverage", "--corpus", text(folder)]);
    assert_eq!(code(&part), 1, "{}", stderr(&part));
    assert!(stdout(&part).contains("missing              sync byte due"));
    let json = [
        "fuzz",
        "coverage",
        "--corpus",
        text(folder),
        "--format",
        "json",
    ];
    let json: serde_json::Value = serde_json::from_str(&stdout(&drivebench(&json))).expect("JSON");
    assert_eq!(json["reached_by_corpus"], 1);
    let sum =
        serde_json::json!({"target": "detector", "inputs": 1, "bytes": 2, "reached": 1, "of": 175});
    assert_eq!(json["targets"], serde_json::json!([sum]));
    file("fuzz_coverage/detector", "two.hex", "0");
    let half = drivebench(&["fuzz", "coverage", "--corpus", text(folder)]);
    assert_eq!(code(&half), 2);
    assert!(stderr(&half).contains("two.hex: line 1 ends within a byte"));
}

/// What a grown folder reaches beyond the kept one is put beside it as a readable file; a second time nothing is left to do.
#[test]
fn fuzz_distil() {
    let kept = file("fuzz_distil/kept", "one.hex", "00 80");
    let kept = kept.parent().expect("a folder");
    std::fs::remove_dir_all(kept).expect("there");
    file("fuzz_distil/kept", "one.hex", "00 80");
    // SYNCO; SYNCO and PAUSE with a SYNCO that adds nothing.
    file("fuzz_distil/grown", "a", [0, 0x80]);
    let grown = file("fuzz_distil/grown", "b", [0, 0x80, 0x81, 0x80]);
    let grown = grown.parent().expect("a folder");
    let folders = ["--from", text(grown), "--to", text(kept)];
    let distil = |target| drivebench(&[&["fuzz", "distil", target][..], &folders].concat());
    let output = distil("detector");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let name = "9.2-sync-byte-due-no-address-byte-seen--pause.hex";
    let page = stdout(&output);
    assert_eq!(page, format!("{name}\n1 input: 1 feature more, 1 before\n"));
    let written = std::fs::read_to_string(kept.join(name)).expect("written");
    assert!(written.ends_with("PAUSE\n00 81\n"), "{written}");
    let again = distil("detector");
    assert_eq!(
        stdout(&again),
        "0 inputs: 0 features more, 2 before\n",
        "{}",
        stderr(&again)
    );
    // A target whose inputs are texts keeps texts.
    let texts = file("fuzz_distil/texts", "a.scn", "title x\nwait\nring 3\n");
    let texts = texts.parent().expect("a folder");
    let to = texts.with_file_name("kept-texts");
    let _none_before = std::fs::remove_dir_all(&to);
    std::fs::create_dir(&to).expect("made");
    let output = drivebench(&[
        "fuzz",
        "distil",
        "scenario",
        "--from",
        text(texts),
        "--to",
        text(&to),
    ]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let files = std::fs::read_dir(&to).expect("a folder");
    let names: Vec<_> = files
        .map(|file| file.expect("readable").file_name())
        .collect();
    assert!(
        names
            .iter()
            .all(|name| name.to_string_lossy().ends_with(".scn")),
        "{names:?}"
    );
    assert_eq!(names.len(), 1);
    assert_eq!(code(&distil("nonesuch")), 2);
    let nothing = drivebench(&[
        "fuzz",
        "distil",
        "ring",
        "--from",
        text(kept),
        "--to",
        "/nowhere/at/all",
    ]);
    assert_eq!(code(&nothing), 2);
    assert!(stderr(&nothing).contains("/nowhere/at/all"));
}

/// What cannot be written is the bench's fault, whichever command prints it.
#[test]
fn a_full_disk_is_no_success() {
    for command in [
        "--version",
        "--help",
        "help",
        "help run",
        "list",
        "manual",
        "cells",
        "deviations",
        "schema rig",
        "completions bash",
        "man",
        "rig list",
        "run 9.2-synco",
        "trace 9.2-synco",
    ] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
        let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args(command.split(' '))
            .stdout(full.expect("the full device"))
            .stderr(std::process::Stdio::piped())
            .output()
            .expect("the program");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{command}: {said}");
        assert!(said.contains("failed to write"), "{command}: {said}");
    }
}
