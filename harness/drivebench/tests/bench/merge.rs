//! Runs that are spread over machines: the merged parts say what one machine says, and nothing else is merged.

use crate::program::{Desk, ended, said};
use harness::capture::MAX_FILE;
use harness::evidence::derive;
use std::fs;
use std::path::Path;
use std::process::Output;

/// Nine scenarios: one fails, one is for another ring, and two have the same name.
const SCENARIOS: [(&str, &str); 9] = [
    ("a/one", "ring 3\n> 80\n< 80\n"),
    ("a/two", "ring 3\n> 89\n< 89\n"),
    ("a/wrong", "ring 3\n> 82\n< 83\n"),
    ("a/zero", "ring 3\n> 84\n< 84\n"),
    ("b/five", "ring 5\n> 80\n< 80\n"),
    ("b/four", "ring 3\n> 85\n< 85\n"),
    ("b/one", "ring 3\n> 86\n< 86\n"),
    ("b/six", "ring 3\n> 87\n< 87\n"),
    ("b/ten", "ring 3\n> 88\n< 88\n"),
];

/// A desk with these scenarios in the folder `all`.
fn desk(scenarios: &[(&str, &str)]) -> Desk {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    for (name, text) in scenarios {
        let path = desk.path(&format!("all/{name}.scn"));
        fs::create_dir_all(path.parent().expect("a folder")).expect("room");
        let text = format!("title {name}\nsource nd21 9.2\n{text}");
        fs::write(path, text).expect("room");
    }
    desk
}

fn run(desk: &Desk, rig: &str, folder: &str, more: &[&str]) -> Output {
    let own = ["run", "all", "--rig", rig, "--evidence", folder];
    desk.run(&[&own, more].concat())
}

/// Plays every part, and returns their folders: a part without scenarios has none.
fn parts(desk: &Desk, rig: &str, spread: &str, of: usize) -> Vec<String> {
    let mut folders = Vec::new();
    for number in 1..=of {
        let folder = format!("{spread}-{number}-{of}");
        let partition = format!("{spread}:{number}/{of}");
        let output = run(desk, rig, &folder, &["--partition", &partition]);
        match output.status.code() {
            Some(4) => ended(&output, 4, &format!("{partition} has no scenario")),
            _ => folders.push(folder),
        }
    }
    folders
}

fn merge(desk: &Desk, folders: &[impl AsRef<str>], output: &str, more: &[&str]) -> Output {
    let folders: Vec<_> = folders.iter().map(AsRef::as_ref).collect();
    desk.run(&[&["merge"], &folders[..], &["--output", output], more].concat())
}

fn text(desk: &Desk, name: &str) -> String {
    fs::read_to_string(desk.path(name)).expect("a file")
}

/// The names of the cases in JUnit, in order, each with what came of it.
fn cases(desk: &Desk, name: &str) -> Vec<String> {
    let xml = text(desk, name);
    let document = roxmltree::Document::parse(&xml).expect("XML");
    let all = document
        .descendants()
        .filter(|own| own.has_tag_name("testcase"));
    let cases = all.map(|own| {
        let what = own.children().find(|inner| inner.is_element());
        let what = what.map_or("passed", |inner| inner.tag_name().name());
        format!("{} {what}", own.attribute("name").unwrap_or_default())
    });
    cases.collect()
}

#[track_caller]
fn equal_to_one_machine(rig: &str, sizes: &[usize]) {
    let desk = desk(&SCENARIOS);
    let whole = run(&desk, rig, "whole", &[]);
    ended(&whole, 1, "7 passed, 1 failed, 1 skipped (9 scenarios");
    for spread in ["slice", "hash"] {
        for &of in sizes {
            let folders = parts(&desk, rig, spread, of);
            let merged = format!("merged-{spread}-{of}");
            let output = merge(&desk, &folders, &merged, &[]);
            ended(&output, 1, "7 passed, 1 failed, 1 skipped (9 scenarios");
            let report = format!("{merged}/report.txt");
            assert_eq!(text(&desk, &report), text(&desk, "whole/report.txt"));
            let junit = format!("{merged}/junit.xml");
            assert_eq!(cases(&desk, &junit), cases(&desk, "whole/junit.xml"));
            if of != 3 {
                continue;
            }
            ended(
                &desk.run(&["verify", &merged]),
                0,
                "8 attempts judged again, 0 things wrong",
            );
            let made = ["report", &merged, "--junit", "again.xml"];
            ended(&desk.run(&made), 0, "");
            assert_eq!(cases(&desk, "again.xml"), cases(&desk, "whole/junit.xml"));
        }
    }
}

#[test]
fn merged_parts_equal_one_machine_with_drives_for_each_scenario() {
    equal_to_one_machine("sim:3", &[1, 2, 3, 4]);
}

#[test]
fn merged_parts_equal_one_machine_on_a_rig() {
    equal_to_one_machine("desk.toml", &[3]);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn more_merged_parts_equal_one_machine() {
    equal_to_one_machine("sim:3", &[5, 9, 12]);
    equal_to_one_machine("desk.toml", &[1, 2, 4, 12]);
}

#[test]
fn a_missing_part_is_never_passed() {
    let right: Vec<_> = SCENARIOS
        .into_iter()
        .filter(|own| own.0 != "a/wrong")
        .collect();
    let desk = desk(&right);
    let folders = parts(&desk, "sim:3", "slice", 3);
    ended(&merge(&desk, &folders, "all-of-it", &[]), 0, "3 of 3 parts");
    // What a link leads to is not the folder that was merged.
    let place = desk.path("all-of-it/parts");
    fs::rename(&place, desk.path("elsewhere")).expect("a folder");
    std::os::unix::fs::symlink(desk.path("elsewhere"), &place).expect("a link");
    let linked = desk.run(&["verify", "all-of-it"]);
    let words = "parts is a symbolic link, which has no place in evidence";
    ended(&linked, 2, words);
    ended(&linked, 2, "all-of-it is not an evidence folder: ");
    ended(
        &merge(&desk, &folders, "strict", &["--require-all"]),
        5,
        "1 skipped",
    );
    let output = merge(&desk, &folders[..2], "two", &[]);
    ended(
        &output,
        5,
        "incomplete   part slice:3/3 is missing: 2 scenarios not run",
    );
    assert!(text(&desk, "two/report.txt").contains("part slice:3/3 is missing"));
    ended(&desk.run(&["verify", "two"]), 5, "incomplete");
    // A part that was killed before its last scenario was settled.
    let record = text(&desk, "slice-2-3/run.jsonl");
    let place = record
        .rfind("{\"kind\":\"scenario\"")
        .unwrap_or_else(|| panic!("{record}"));
    fs::write(desk.path("slice-2-3/run.jsonl"), &record[..place]).expect("room");
    for name in ["SHA256SUMS", "junit.xml", "report.txt", "report.html"] {
        fs::remove_file(desk.path("slice-2-3").join(name)).expect("a file");
    }
    let output = merge(&desk, &folders, "killed", &[]);
    ended(
        &output,
        5,
        "part slice:2/3 did not come to its end: 1 scenario not run",
    );
    ended(&desk.run(&["verify", "killed"]), 5, "incomplete");
}

/// What is merged are the parts of one run, each once, as they were written.
#[test]
fn other_folders_are_refused() {
    let desk = desk(&SCENARIOS);
    let folders = parts(&desk, "sim:3", "slice", 2);
    let [one, two] = &folders[..] else {
        panic!("{folders:?}");
    };
    parts(&desk, "sim:3", "slice", 3);
    parts(&desk, "sim:3", "hash", 2);
    parts(&desk, "desk.toml", "slice", 4);
    run(&desk, "sim:3", "whole", &[]);
    run(
        &desk,
        "sim:3",
        "filtered",
        &["--partition", "slice:2/2", "--filter", "one"],
    );
    fs::rename(desk.path("all/b/ten.scn"), desk.path("all/b/eleven.scn")).expect("a file");
    run(&desk, "sim:3", "renamed", &["--partition", "slice:2/2"]);
    fs::create_dir(desk.path("empty")).expect("room");
    let refused = |folders: &[&str], words: &str| {
        let output = merge(&desk, folders, "out", &[]);
        ended(&output, 2, words);
        assert!(!desk.path("out/merge.json").exists());
    };
    refused(&[one, one], "are both slice:1/2");
    refused(
        &[one, "slice-2-3"],
        "the number of parts is 2 in the first and 3 in the second",
    );
    refused(
        &[one, "hash-2-2"],
        "the spread is slice in the first and hash in the second",
    );
    refused(
        &[one, "filtered"],
        "the filter is none in the first and one in the second",
    );
    refused(&[one, "renamed"], "the corpus is ");
    refused(&["slice-1-2", "slice-1-4"], "is ");
    refused(
        &["whole"],
        "whole is no part of a run: its record has no partition",
    );
    refused(&["absent"], "absent is not an evidence folder");
    refused(&["empty"], "empty is not an evidence folder");
    refused(&["all"], "all is not an evidence folder");
    let inside = format!("{one}/out");
    ended(
        &merge(&desk, &folders, &inside, &[]),
        2,
        "which must stay as it is",
    );
    // A verdict is edited in the record of a part, and its sums made to fit.
    edit(
        &desk.path(two).join("run.jsonl"),
        "\"failed\"",
        "\"passed\"",
    );
    edit(
        &desk.path(one).join("run.jsonl"),
        "\"failed\"",
        "\"passed\"",
    );
    refused(&[one, two], "is not what its record gives");
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).expect("a file");
    fs::write(path, text.replace(from, to)).expect("room");
}

/// Whatever is edited in a merged folder, `verify` says so.
#[test]
fn an_edited_merge_is_refused() {
    let desk = desk(&SCENARIOS);
    let folders = parts(&desk, "sim:3", "slice", 2);
    let edits: [(&str, &str, &str); 7] = [
        ("merge.json", "failed", "passed"),
        ("merge.json", "slice:2/2", "slice:1/2"),
        ("junit.xml", "failures=\"1\"", "failures=\"0\""),
        ("report.txt", "failed", "passed"),
        ("report.html", "failed", "passed"),
        ("parts/1/run.jsonl", "failed", "passed"),
        ("parts/2/run.jsonl", "slice:2/2", "slice:1/2"),
    ];
    for (number, (name, from, to)) in edits.into_iter().enumerate() {
        let merged = format!("merged-{number}");
        merge(&desk, &folders, &merged, &[]);
        ended(&desk.run(&["verify", &merged]), 0, "0 things wrong");
        let path = desk.path(&merged).join(name);
        let before = fs::read(&path).expect("a file");
        edit(&path, from, to);
        let edited = fs::read(&path).expect("a file") != before;
        assert!(edited, "{name}: nothing was edited");
        let verified = desk.run(&["verify", &merged]);
        let code = verified.status.code();
        assert!(matches!(code, Some(1 | 2)), "{name}: {}", said(&verified));
    }
    merge(&desk, &folders, "added", &[]);
    fs::write(desk.path("added/more.txt"), "more").expect("room");
    ended(
        &desk.run(&["verify", "added"]),
        1,
        "more.txt is not a file of a merged run",
    );
    merge(&desk, &folders, "removed", &[]);
    fs::remove_dir_all(desk.path("removed/parts/2")).expect("a folder");
    ended(
        &desk.run(&["verify", "removed"]),
        1,
        "part slice:2/2 is missing",
    );
    let again = merge(&desk, &folders, "added", &[]);
    ended(&again, 2, "is not empty");
}

/// A scenario that the user named and the rig denies is wrong usage, in the parts as in the whole.
#[test]
fn a_denied_scenario_that_was_named_is_wrong_usage() {
    let desk = Desk::limited("drives = 3\ntransport = \"sim\"\n", "");
    let scenarios = ["9.5-every-unknown-command", "9.2-bad-sync-bytes"];
    let play = |folder: &str, more: &[&str]| {
        let own = ["run", "--rig", "desk.toml", "--evidence", folder];
        desk.run(&[&own, &scenarios[..], more].concat())
    };
    ended(&play("whole", &[]), 2, "2 skipped (2 scenarios");
    let mut folders = Vec::new();
    for number in 1..=2 {
        let folder = format!("part-{number}");
        play(&folder, &["--partition", &format!("slice:{number}/2")]);
        folders.push(folder);
    }
    let merged = merge(&desk, &folders, "merged", &[]);
    ended(&merged, 2, "2 skipped (2 scenarios");
}

#[test]
fn a_partition_is_m_of_n() {
    let desk = desk(&SCENARIOS);
    for wrong in [
        "slice:0/3",
        "slice:4/3",
        "slice:1/0",
        "hash:x",
        "slice:1/10001",
    ] {
        let output = desk.run(&["run", "all", "--partition", wrong]);
        ended(&output, 2, "slice:M/N or hash:M/N is expected");
    }
    let output = desk.run(&[
        "run",
        "all",
        "--partition",
        "slice:2/3",
        "--junit",
        "part.xml",
    ]);
    ended(&output, 0, "3 scenarios");
    assert_eq!(cases(&desk, "part.xml").len(), 3);
}

/// What did not pass is played again; a verdict counts only as its folder proves it.
#[test]
fn what_did_not_pass_is_played_again() {
    let desk = desk(&SCENARIOS);
    run(&desk, "sim:3", "whole", &[]);
    let again = |folder: &str, more: &[&str]| run(&desk, "sim:3", folder, more);
    let output = again("first", &["--rerun", "whole"]);
    ended(&output, 1, "0 passed, 1 failed, 1 skipped (2 scenarios");
    ended(&output, 1, "not played again, passed before: 7 scenarios");
    // A filter leaves the failed one out: it is still outstanding.
    let output = again("second", &["--rerun", "whole", "--filter", "b/"]);
    ended(&output, 5, "still outstanding, not selected: wrong");
    // The same of a merged folder.
    let folders = parts(&desk, "sim:3", "hash", 2);
    merge(&desk, &folders, "merged", &[]);
    let output = again("third", &["--rerun", "merged"]);
    ended(&output, 1, "0 passed, 1 failed, 1 skipped (2 scenarios");
    // A scenario that was changed is new.
    edit(&desk.path("all/a/wrong.scn"), "< 83", "< 82");
    let output = again("fixed", &["--rerun", "whole", "--require-all"]);
    ended(&output, 5, "1 passed, 0 failed, 1 skipped (2 scenarios");
    ended(&desk.run(&["verify", "fixed"]), 0, "0 things wrong");
    fs::remove_file(desk.path("all/b/five.scn")).expect("a file");
    // What was passed before and has another text is outstanding no more only where its old text is not asked for.
    let output = again("none", &["--rerun", "whole", "--rerun", "fixed"]);
    ended(&output, 5, "still outstanding, not selected: wrong");
    assert!(!desk.path("none").exists());
}

#[test]
fn nothing_is_played_again_if_all_has_passed() {
    let right: Vec<_> = SCENARIOS[..2].to_vec();
    let desk = desk(&right);
    run(&desk, "sim:3", "whole", &[]);
    let output = run(&desk, "sim:3", "again", &["--rerun", "whole"]);
    ended(&output, 0, "not played again, passed before: 2 scenarios");
    // A run that was killed has not come to its second scenario.
    let record = text(&desk, "whole/run.jsonl");
    let place = record
        .rfind("{\"kind\":\"scenario\"")
        .expect("a second scenario");
    fs::write(desk.path("whole/run.jsonl"), &record[..place]).expect("room");
    fs::remove_file(desk.path("whole/SHA256SUMS")).expect("a file");
    let output = run(&desk, "sim:3", "left", &["--rerun", "whole"]);
    ended(&output, 0, "1 passed, 0 failed (1 scenario");
    // Others are refused.
    let refused = |rig: &str, folder: &str, words: &str| {
        let output = run(&desk, rig, "never", &["--rerun", folder]);
        ended(&output, 2, words);
    };
    refused(
        "desk.toml",
        "whole",
        "it is of the rig sim-3 with another file",
    );
    refused(
        "sim:3",
        "absent",
        "absent is not an evidence folder: there is no such folder",
    );
    refused("sim:3", "all", "all is not an evidence folder");
    ended(&desk.run(&["run", "all", "--rerun", "whole"]), 2, "--rig");
    edit(&desk.path("left/run.jsonl"), "\"passed\"", "\"failed\"");
    refused("sim:3", "left", "it is not what its record gives");
}

/// A capture that is too long to be read again is kept, and the page and the verdicts are made without it.
#[test]
fn a_capture_of_more_than_256_mib_costs_no_verdict() {
    let desk = desk(&SCENARIOS[..1]);
    ended(&run(&desk, "sim:3", "long", &[]), 0, "1 passed");
    let folder = desk.path("long");
    let before = derive(&folder).expect("a page");
    let capture = folder.join("captures/one.1.json");
    let capture = fs::File::options().write(true).open(capture);
    // A hole: it takes no room.
    let grown = capture.and_then(|file| file.set_len(MAX_FILE + 1));
    grown.expect("a long file");
    let after = derive(&folder).expect("a page");
    assert_eq!(after.junit, before.junit);
    assert!(after.html.contains("passed") && after.html.len() < before.html.len());
}

/// Captures of what passed are left out as `--keep` says, and `verify` knows which.
#[test]
fn captures_are_kept_of_what_failed_and_of_every_nth() {
    let desk = desk(&SCENARIOS);
    for (rig, keep, kept) in [
        ("sim:3", "failed", &["wrong.1.json"][..]),
        (
            "sim:3",
            "3",
            &["four.1.json", "one.1.json", "ten.1.json", "wrong.1.json"],
        ),
        ("desk.toml", "failed", &["wrong.1.json"]),
        ("desk.toml", "1000", &["one.1.json", "wrong.1.json"]),
    ] {
        let folder = format!("{}-{keep}", &rig[..3]);
        let output = run(&desk, rig, &folder, &["--keep", keep]);
        ended(&output, 1, "7 passed, 1 failed, 1 skipped");
        ended(
            &output,
            1,
            " MB (an estimate), and those of attempts that do not pass",
        );
        ended(
            &output,
            1,
            &format!("; {} captures left out", 8 - kept.len()),
        );
        let captures = fs::read_dir(desk.path(&folder).join("captures")).expect("a folder");
        let names = captures.map(|own| own.expect("an entry").file_name());
        let mut names: Vec<_> = names
            .map(|own| own.into_string().expect("a name"))
            .collect();
        names.sort();
        assert_eq!(names, kept);
        let verified = desk.run(&["verify", &folder]);
        ended(
            &verified,
            0,
            &format!("left out on purpose (`--keep {keep}`)"),
        );
        ended(&verified, 0, "8 attempts judged again, 0 things wrong");
    }
    // One that was to be left out, and one that was to be kept.
    let captures = desk.path("sim-failed/captures");
    fs::copy(captures.join("wrong.1.json"), captures.join("two.1.json")).expect("room");
    ended(
        &desk.run(&["verify", "sim-failed"]),
        1,
        "captures/two.1.json",
    );
    fs::remove_file(desk.path("des-1000/captures/one.1.json")).expect("a file");
    ended(
        &desk.run(&["verify", "des-1000"]),
        1,
        "captures/one.1.json is missing",
    );
    edit(
        &desk.path("sim-3/run.jsonl"),
        "\"keep\":\"3\"",
        "\"keep\":\"failed\"",
    );
    ended(
        &desk.run(&["verify", "sim-3"]),
        1,
        "is not a file of this run",
    );
    for wrong in ["0", "-1", "some", "4294967296"] {
        let keep = format!("--keep={wrong}");
        let output = run(&desk, "sim:3", "none", &[&keep]);
        ended(&output, 2, "all, failed, or a number from 1 is expected");
    }
}

const FRAMES: &str = "bus = \"unitek\"\ndrives = [{ node = 1 }]\n[sim]\nbus = \"unitek\"\n";
const OCTETS: &str = "bus = \"nordac\"\ndrives = [{ address = 8 }]\n[sim]\nbus = \"nordac\"\n";

/// Rigs with a port; the longer test has those of octets.
#[test]
fn merged_parts_equal_one_machine_on_rigs_with_a_port() {
    equal_on_ports(&[(FRAMES, "unitek-fault")]);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn more_merged_parts_equal_one_machine_on_rigs_with_a_port() {
    equal_on_ports(&[
        (OCTETS, "nordac-2.5.1-address"),
        (OCTETS, "nordac-en-1-fc-"),
    ]);
}

fn equal_on_ports(rigs: &[(&str, &str)]) {
    for &(port, filter) in rigs {
        let limits =
            "[limits]\nallow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\n";
        let desk = Desk::of_file(&format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\n{port}{limits}"
        ));
        let play = |folder: &str, more: &[&str]| {
            let own = ["run", "--rig", "desk.toml", "--filter", filter];
            desk.run(&[&own, more, &["--evidence", folder]].concat())
        };
        let whole = play("whole", &["--keep", "failed"]);
        ended(&desk.run(&["verify", "whole"]), 0, "0 things wrong");
        let parts = ["slice:1/3", "slice:2/3", "slice:3/3"];
        let folders = ["one", "two", "three"];
        for (part, folder) in parts.iter().zip(folders) {
            play(folder, &["--partition", part, "--keep", "2"]);
        }
        let merged = merge(&desk, &folders, "merged", &[]);
        let code = whole.status.code();
        assert_eq!(merged.status.code(), code, "{}", said(&merged));
        for name in ["report.txt", "junit.xml"] {
            let verdicts = |folder: &str| match name {
                "junit.xml" => cases(&desk, &format!("{folder}/{name}")),
                _ => vec![text(&desk, &format!("{folder}/{name}"))],
            };
            assert_eq!(verdicts("merged"), verdicts("whole"), "{filter}");
        }
        ended(&desk.run(&["verify", "merged"]), 0, "0 things wrong");
        let output = play("again", &["--rerun", "merged"]);
        assert_eq!(output.status.code(), code, "{}", said(&output));
    }
}
