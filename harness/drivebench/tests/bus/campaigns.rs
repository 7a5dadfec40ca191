//! `drivebench campaign` as a stranger uses it.

use crate::typed::{drivebench, stderr, stdout};
use serde_json::Value;
use std::path::PathBuf;

/// Two bits of one byte of process data, on one link.
fn file(test: &str, more: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("campaign-{test}"));
    std::fs::create_dir_all(&folder).expect("a folder");
    let path = folder.join("a.toml");
    let text = format!(
        "schema = 1\ntitle = \"t\"\nscenario = \"9.6-every-write\"\nfaults = [\"bits\"]\n\
         links = [\"master->2\"]\nbytes = \"35\"\npairs = \"byte\"\n{more}"
    );
    std::fs::write(&path, text).expect("a file");
    path
}

#[test]
fn a_pinned_figure_decides_the_exit_code() {
    // C(8,2) pairs of data bits and 8 of a data bit with the parity bit leave the parity right.
    let right = file("right", "[expect]\ncases = 55\nsilent-corruption = 36\n");
    let output = drivebench(&["campaign", right.to_str().expect("plain")]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(stderr(&output), "");
    let wrong = file("wrong", "[expect]\nsilent-corruption = 0\n");
    let output = drivebench(&["campaign", wrong.to_str().expect("plain")]);
    assert_eq!(output.status.code(), Some(1));
    let differs = "differs: silent-corruption is 36, the file pins 0";
    assert!(stdout(&output).contains(differs), "{}", stdout(&output));
}

#[test]
fn every_case_for_tools_and_one_class_for_people() {
    let path = file("json", "");
    let path = path.to_str().expect("plain");
    let output = drivebench(&["campaign", path, "--format", "json"]);
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let cases = json["campaigns"][0]["cases"].as_array().expect("cases");
    assert_eq!((json["schema"].as_u64(), cases.len()), (Some(1), 55));
    let silent = |case: &&Value| case["class"] == "silent-corruption";
    let first = cases.iter().find(silent).expect("a silent case");
    assert_eq!(first["case"], "master->2:35:0+master->2:35:1");
    assert_eq!(first["wrong"][0]["address"], 0xFF3E);
    assert_eq!(first["wrong"][0]["value"], 0x11);
    let output = drivebench(&["campaign", path, "--only", "silent-corruption"]);
    assert_eq!(stdout(&output).lines().count(), 36);
    let line = "silent-corruption  master->2:35:0+master->2:35:1 drive 2: FF3E";
    assert!(stdout(&output).starts_with(line), "{}", stdout(&output));
}

#[test]
fn one_case_as_a_scenario_that_trace_plays() {
    let case = "98->97:10:0";
    let output = drivebench(&["campaign", "9.7-single-bits", "--case", case]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let replay = file("replay", "").with_file_name("case.scn");
    std::fs::write(&replay, stdout(&output)).expect("a file");
    let output = drivebench(&["trace", replay.to_str().expect("plain"), "--rows", "9..13"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // The rows that the manual prints in 9.7.
    let table = stdout(&output);
    let row = |start: &str| {
        table.lines().any(|line| {
            line.split_whitespace()
                .collect::<Vec<_>>()
                .join(" ")
                .starts_with(start)
        })
    };
    assert!(row("10 13 13 13 12~ !00 00 00"), "{table}");
    assert!(row("11 FE FE FE 00 !00 00"), "{table}");
}

#[test]
fn wrong_usage_says_what_to_do() {
    for (arguments, text) in [
        (
            &["campaign", "9.7-singel-bits"][..],
            "did you mean `9.7-single-bits`?",
        ),
        (
            &["campaign", "--case", "98->97:10:0"],
            "--case needs exactly one campaign",
        ),
        (
            &["campaign", "9.7-single-bits", "--case", "98->96:10:0"],
            "LINK:BYTE:WHAT is expected",
        ),
        (
            &["campaign", "9.7-single-bits", "--threads", "0"],
            "1 to 256",
        ),
    ] {
        let output = drivebench(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(text),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
}

/// Campaigns over frames stand beside those of rings, and can be shown in the same ways.
#[test]
fn campaigns_over_frames() {
    let frames = "unitek/5.3-no-read-back";
    let table = drivebench(&["campaign", frames]);
    assert_eq!(table.status.code(), Some(0), "{}", stderr(&table));
    assert!(stdout(&table).contains("  unnoticed                 5"));
    let listed = drivebench(&["campaign", frames, "--format", "json"]);
    let listed: Value = serde_json::from_str(&stdout(&listed)).expect("JSON");
    let cases = listed["campaigns"][0]["cases"].as_array();
    assert_eq!(cases.map(Vec::len), Some(248));
    let wrong = drivebench(&["campaign", frames, "--only", "unnoticed"]);
    let lines = stdout(&wrong);
    assert_eq!(
        (wrong.status.code(), lines.lines().count()),
        (Some(0), 5),
        "{lines}"
    );
    assert!(
        lines.lines().all(|line| line.starts_with("unnoticed ")),
        "{lines}"
    );
    let both = drivebench(&["campaign", "9.6-single-bits", frames, "--only", "recovered"]);
    assert_eq!(both.status.code(), Some(0), "{}", stderr(&both));
    assert!(!stdout(&both).contains("unnoticed"), "{}", stdout(&both));
    let case = drivebench(&["campaign", frames, "--case", "3:lost"]);
    assert_eq!(case.status.code(), Some(0), "{}", stderr(&case));
    assert!(stdout(&case).contains("lost"), "{}", stdout(&case));
    let case = drivebench(&["campaign", frames, "--case", "3:bent"]);
    assert_eq!(case.status.code(), Some(2));
    assert!(stderr(&case).contains("--format json"), "{}", stderr(&case));
    let page = file("frames", "").with_file_name("frames.html");
    let path = page.to_str().expect("plain");
    let shown = drivebench(&["campaign", frames, "--html", path]);
    assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
    let page = std::fs::read_to_string(&page).expect("a page");
    assert!(page.contains("Where: faults across, frames down"));
}

/// Campaigns of telegrams have classes of their own.
#[test]
fn campaigns_over_telegrams() {
    let wrong = drivebench(&["campaign", "nordac/3.3-telegrams", "--only", "wrong-word"]);
    let lines = stdout(&wrong);
    assert_eq!(
        (wrong.status.code(), lines.lines().count()),
        (Some(0), 6),
        "{lines}"
    );
    assert!(
        lines.lines().all(|line| line.contains(":former")),
        "{lines}"
    );
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_campaign_of_single_bits_over_telegrams() {
    let bits = drivebench(&["campaign", "nordac/3.3-single-bits", "--format", "json"]);
    let listed: Value = serde_json::from_str(&stdout(&bits)).expect("JSON");
    let campaign = &listed["campaigns"][0];
    assert_eq!(
        (&campaign["bus"], &campaign["telegrams"]),
        (&"nordac".into(), &36.into())
    );
    assert_eq!(campaign["cases"].as_array().map(Vec::len), Some(8124));
}

/// The pairs of a campaign for tools, and every campaign that has none is refused with what to do.
#[test]
fn pairs_of_faults_for_tools() {
    let singles = file("pairs", "");
    let text = std::fs::read_to_string(&singles).expect("a file");
    std::fs::write(&singles, text.replace("pairs = \"byte\"", "")).expect("a file");
    let singles = singles.to_str().expect("plain");
    let output = drivebench(&["campaign", singles, "--pairs", "--format", "json"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let pairs = &json["pairs"][0];
    assert_eq!(
        (&pairs["faults"], &pairs["pairs"], &pairs["played"]),
        (&11.into(), &55.into(), &55.into())
    );
    let byte = &pairs["counts"][0];
    assert_eq!(byte["apart"], "one byte");
    assert_eq!(byte["classes"]["silent-corruption"], 36);
    for (arguments, expected) in [
        (&["campaign", "--pairs"][..], "<CAMPAIGN>..."),
        (
            &["campaign", "9.6-two-bits-a-byte", "--pairs"],
            "name a campaign of all single faults",
        ),
        (
            &["campaign", "9.8-driver-single-bits", "--pairs"],
            "see --sample",
        ),
        (
            &["campaign", "unitek/5.3-read-back", "--pairs"],
            "has no ring",
        ),
        (
            &["campaign", "9.6-single-bits", "--sample", "10"],
            "--pairs",
        ),
        (
            &["campaign", "9.6-single-bits", "--pairs", "--sample", "0"],
            "1..=1000000",
        ),
    ] {
        let output = drivebench(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert_eq!(stdout(&output), "", "{arguments:?}");
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
    let sample = [
        "campaign",
        "9.8-driver-single-bits",
        "--pairs",
        "--sample",
        "5",
    ];
    let output = drivebench(&sample);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("5 of 31011750 pairs, seed 0"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn names_that_are_not_there() {
    let output = drivebench(&["campaign", "9.6-single-bit"]);
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    assert!(said.contains("did you mean `9.6-single-bits`?"), "{said}");
}
