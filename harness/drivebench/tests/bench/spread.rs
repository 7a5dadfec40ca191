//! Campaigns and fuzz runs that are spread over machines.

use crate::program::{Desk, ended, said};
use serde_json::Value;
use std::fs;

/// A campaign on a ring, and one on CAN, each of some hundred cases; with all figures pinned.
const SILENCE: &str = "schema = 1\ntitle = \"Silences\"\nscenario = \"9.9-monitored-writes\"\nfaults = [\"gap\", \"break\"]\ngaps = [1]\n\
                       breaks = [\"11ms\"]\n[expect]\ncases = 456\n";
const FRAMES: &str = "schema = 1\nbus = \"unitek\"\ntitle = \"Lost frames\"\nsteps = [\"read O_BTB\", \"write VAR4 = 11223344\", \"read VAR4\"]\n\
                      faults = [\"lost\", \"doubled\", \"late\"]\ndelays = [\"3ms\", \"15ms\"]\nread-back = false\n[expect]\ncases = 20\n";

fn desk() -> Desk {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    fs::write(desk.path("silence.toml"), SILENCE).expect("room");
    fs::write(desk.path("frames.toml"), FRAMES).expect("room");
    desk
}

/// Counts campaigns, or a part of them, into a file.
fn count(desk: &Desk, file: &str, more: &[&str]) -> std::process::Output {
    let own = ["campaign", "silence.toml", "frames.toml", "--output", file];
    desk.run(&[&own, more].concat())
}

fn parts(desk: &Desk, spread: &str, of: usize) -> Vec<String> {
    let mut files = Vec::new();
    for number in 1..=of {
        let (file, part) = (
            format!("{spread}-{number}-{of}.json"),
            format!("{spread}:{number}/{of}"),
        );
        let output = count(desk, &file, &["--partition", &part]);
        ended(&output, 0, &format!("{part} was counted"));
        files.push(file);
    }
    files
}

fn merge(desk: &Desk, files: &[impl AsRef<str>], output: &str) -> std::process::Output {
    let files: Vec<_> = files.iter().map(AsRef::as_ref).collect();
    desk.run(&[&["merge"], &files[..], &["--output", output]].concat())
}

fn text(desk: &Desk, name: &str) -> String {
    fs::read_to_string(desk.path(name)).expect("a file")
}

#[test]
fn merged_counts_equal_one_machine() {
    let desk = desk();
    let whole = count(&desk, "whole.json", &[]);
    assert_eq!(whole.status.code(), Some(0), "{}", said(&whole));
    for (spread, of) in [("slice", 1), ("slice", 3), ("hash", 2), ("hash", 4)] {
        let files = parts(&desk, spread, of);
        let merged = format!("{spread}-{of}.json");
        ended(
            &merge(&desk, &files, &merged),
            0,
            "silence: 456 of 456 cases",
        );
        assert_eq!(
            text(&desk, &merged),
            text(&desk, "whole.json"),
            "{spread} {of}"
        );
    }
}

/// Two faults in one conversation: a pair is in the part of its second fault.
#[test]
fn merged_counts_of_pairs_equal_one_machine() {
    let desk = Desk::new("drives = 3\ntransport = \"sim\"\n");
    let lost =
        "schema = 1\ntitle = \"Lost\"\nscenario = \"9.6-every-write\"\nfaults = [\"drop\"]\n";
    fs::write(desk.path("lost.toml"), lost).expect("room");
    let count = |file: &str, more: &[&str]| {
        let own = ["campaign", "lost.toml", "--pairs", "--output", file];
        desk.run(&[&own, more].concat())
    };
    let whole = count("whole.json", &[]);
    ended(&whole, 0, "lost: all 48516 pairs of 312 faults");
    for (spread, of) in [("slice", 3), ("hash", 2)] {
        let mut files = Vec::new();
        for number in 1..=of {
            let (part, file) = (
                format!("{spread}:{number}/{of}"),
                format!("{spread}-{number}.json"),
            );
            let output = count(&file, &["--partition", &part]);
            ended(
                &output,
                0,
                &format!("of 48516 pairs, part {part}, of 312 faults"),
            );
            files.push(file);
        }
        let name = format!("{spread}.json");
        let merged = merge(&desk, &files, &name);
        assert_eq!(merged.status.code(), Some(0), "{}", said(&merged));
        assert_eq!(merged.stdout, whole.stdout, "{spread}");
        assert_eq!(text(&desk, &name), text(&desk, "whole.json"), "{spread}");
        let missing = merge(&desk, &files[1..], &format!("{spread}-missing.json"));
        ended(&missing, 5, &format!("part {spread}:1/{of} is missing"));
    }
    let singles = [
        "campaign",
        "lost.toml",
        "--output",
        "single.json",
        "--partition",
        "slice:2/3",
    ];
    ended(&desk.run(&singles), 0, "slice:2/3 was counted");
    let mixed = merge(&desk, &["slice-1.json", "single.json"], "mixed.json");
    ended(
        &mixed,
        2,
        "the count of lost is pairs of 312 faults in the first and single cases in the second",
    );
    let edited = text(&desk, "slice-2.json").replace("\"faults\": 312", "\"faults\": 313");
    fs::write(desk.path("slice-2.json"), edited).expect("room");
    ended(
        &merge(&desk, &["slice-2.json"], "edited.json"),
        2,
        "lost has 48516 pairs of 313 faults, which cannot be",
    );
    let sampled = count("sample.json", &["--sample", "20"]);
    ended(&sampled, 2, "--sample");
}

#[test]
fn parts_of_counts_are_compared_with_the_pinned_figures_together() {
    let desk = desk();
    let wrong = SILENCE.replace("cases = 456", "cases = 456\nharmless = 1");
    fs::write(desk.path("silence.toml"), wrong).expect("room");
    let files = parts(&desk, "slice", 2);
    ended(
        &merge(&desk, &files, "all.json"),
        1,
        "differs: harmless is ",
    );
    ended(&merge(&desk, &files, "all.json"), 2, "all.json exists");
    ended(
        &merge(&desk, &files[..1], "one.json"),
        5,
        "incomplete   part slice:2/2 is missing",
    );
}

#[test]
fn other_counts_are_refused() {
    let desk = desk();
    let files = parts(&desk, "slice", 2);
    let [one, two] = &files[..] else {
        panic!("{files:?}");
    };
    parts(&desk, "slice", 3);
    count(&desk, "whole.json", &[]);
    fs::write(
        desk.path("silence.toml"),
        SILENCE.replace("gaps = [1]", "gaps = [2]"),
    )
    .expect("room");
    count(&desk, "other.json", &["--partition", "slice:2/2"]);
    let refused = |files: &[&str], words: &str| {
        ended(&merge(&desk, files, "out.json"), 2, words);
        assert!(!desk.path("out.json").exists());
    };
    refused(&[one, one], "are both slice:1/2");
    refused(
        &[one, "slice-2-3.json"],
        "the number of parts is 2 in the first and 3 in the second",
    );
    refused(&[one, "other.json"], "the sum of silence is ");
    refused(&["whole.json"], "it is of whole campaigns");
    refused(
        &["silence.toml"],
        "a file that `campaign --partition slice:M/N --output FILE` wrote is expected",
    );
    refused(&[one, "absent.json"], "absent.json");
    // Edited counts.
    let before = text(&desk, two);
    let edit = |change: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&before).expect("JSON");
        change(&mut value);
        fs::write(desk.path(two), value.to_string()).expect("room");
    };
    edit(&|own| own["campaigns"][0]["counts"][0]["cases"] = 100_000.into());
    refused(
        &[one, two],
        "more cases of silence than the campaign has, 456",
    );
    edit(&|own| own["campaigns"][0]["counts"][0]["cases"] = u64::MAX.into());
    refused(
        &[one, two],
        "more cases of silence than the campaign has, 456",
    );
    edit(&|own| own["campaigns"][0]["counts"][1]["cases"] = 0.into());
    refused(&[one, two], "and slice:2/2 has 228");
    edit(&|own| own["campaigns"] = Value::Array(Vec::new()));
    refused(&[two], "it has no campaign");
    edit(&|own| {
        own["campaigns"][1]["counts"]
            .as_array_mut()
            .expect("a list")
            .pop();
    });
    refused(&[one, two], "the list of classes of frames is ");
    edit(&|own| own["partition"] = "slice:3/2".into());
    refused(&[one, two], "slice:M/N or hash:M/N is expected");
    edit(&|own| own["schema"] = 9.into());
    refused(&[one, two], "the schema is 9");
}

#[test]
fn a_part_of_a_fuzz_run_has_a_seed_and_cases_of_its_own() {
    let desk = desk();
    let run = |folder: &str, more: &[&str]| {
        let own = ["fuzz", "run", "--rig", "sim:2", "--out", folder];
        let output = desk.run(&[&own, more].concat());
        (said(&output), output.status.code())
    };
    let parted = ["--seed", "1", "--cases", "40", "--partition", "slice:3/16"];
    let (said, code) = run("part", &parted);
    // printf 1:3/16 | sha256sum
    let seed = 0x2080_e1dc_8f9d_fad4_u64.to_string();
    assert!(
        said.contains(&format!("slice:3/16 has the seed {seed}")),
        "{said}"
    );
    assert_eq!(code, Some(0), "{said}");
    run("same", &["--seed", &seed, "--cases", "3"]);
    let log = |folder: &str| fs::read(desk.path(folder).join("run.jsonl")).expect("a record");
    assert_eq!(log("part"), log("same"));
    let none = ["--cases", "2", "--partition", "hash:3/16"];
    assert_eq!(run("none", &none).1, Some(4));
    assert!(!desk.path("none").exists());
    assert_eq!(run("wrong", &["--partition", "slice:0/3"]).1, Some(2));
}

#[test]
fn a_partition_of_other_commands_is_m_of_n() {
    let desk = desk();
    let wrong = ["--partition", "slice:4/3"];
    for command in [
        &["campaign", "--output", "c.json"][..],
        &["qualify", "--rig", "sim:1"],
    ] {
        let output = desk.run(&[command, &wrong].concat());
        ended(&output, 2, "slice:M/N or hash:M/N is expected");
    }
    ended(
        &desk.run(&["campaign", "--partition", "slice:1/3"]),
        2,
        "--output",
    );
}
