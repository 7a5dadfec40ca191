//! Runs that are spread over machines: the merged parts say what one machine says, and nothing else is merged.

use crate::program::{Desk, ended, said};
use harness::capture::MAX_FILE;
use harness::evidence::derive;
use std::fs;
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
    let fixed = ["run", "all", "--rig", rig, "--evidence", folder];
    desk.run(&[&fixed, more].concat())
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
        .filter(|node| node.has_tag_name("testcase"));
    let cases = all.map(|node| {
        let what = node.children().find(|inner| inner.is_element());
        let what = what.map_or("passed", |inner| inner.tag_name().name());
        format!("{} {what}", node.attribute("name").unwrap_or_default())
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
            let fixed = ["run", "--rig", "desk.toml", "--filter", filter];
            desk.run(&[&fixed, more, &["--evidence", folder]].concat())
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
