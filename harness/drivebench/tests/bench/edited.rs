//! Edited evidence of simulated rigs, and signatures.

use crate::edits::{check, check_each, fit, kept};
use crate::program::{Desk, ended};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What makes the drives of a simulated rig its own, which all scenarios share.
const OWN: &str =
    "drives = 2\ntransport = \"sim\"\n[sim]\nsetup = [\"drive 0 memory FE20 = 00\"]\n";

#[test]
fn of_a_simulated_rig() {
    check_each(&kept(Desk::new(OWN), "run", false), 5);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn each_of_a_simulated_rig() {
    check(&kept(Desk::new(OWN), "run", false));
}

#[test]
fn of_rings_of_their_own() {
    let desk = Desk::new("drives = 2\ntransport = \"sim\"\n");
    check_each(&kept(desk, "run", false), 3);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn each_of_rings_of_their_own() {
    let desk = Desk::new("drives = 2\ntransport = \"sim\"\n");
    check(&kept(desk, "run", false));
}

/// A rig that denies what it can has few conversations, which are played again for each edit.
#[test]
#[ignore = "plays a conversation for each edit, a minute in all; .ci/nightly runs it"]
fn of_a_careful_qualification() {
    check(&kept(Desk::limited(OWN, ""), "qualify", false));
}

#[test]
#[ignore = "plays 40 conversations for each edit; .ci/nightly runs it"]
fn of_a_qualification() {
    check(&kept(Desk::new(OWN), "qualify", false));
}

/// What a qualification has found is made again from its record, and an edited finding is refused with the line that was edited.
#[test]
fn findings_of_a_qualification() {
    findings(&[("profile.toml", "accepted", "refused")]);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn more_findings_of_a_qualification() {
    findings(&[
        ("deviations.txt", "deviations: none", "deviations: some"),
        ("deviations.txt", "were skipped", "were left out"),
        ("profile.toml", "date = \"2", "date = \"3"),
    ]);
}

fn findings(edits: &[(&str, &str, &str)]) {
    let desk = Desk::limited(OWN, "");
    let fixed = ["qualify", "--rig", "desk.toml", "--filter", "9.2-synco"];
    ended(
        &desk.run(&[&fixed[..], &["--evidence", "kept"]].concat()),
        0,
        "deviations: none",
    );
    let verify = || desk.run(&["verify", "kept"]);
    ended(&verify(), 0, "0 things wrong");
    for &(file, from, to) in edits {
        let path = desk.path(&format!("kept/{file}"));
        let text = fs::read_to_string(&path).expect("a file");
        let edited = text.replacen(from, to, 1);
        assert_ne!(text, edited, "{from} is not in {text}");
        fs::write(&path, &edited).expect("room");
        fit(&desk.path("kept"));
        let line = edited
            .lines()
            .zip(text.lines())
            .find(|(stated, other)| stated != other);
        let (stated, made) = line.expect("a line");
        ended(
            &verify(),
            1,
            &format!("the file has \"{stated}\", the record gives \"{made}\""),
        );
        fs::remove_file(&path).expect("a file");
        fit(&desk.path("kept"));
        ended(&verify(), 1, file);
        fs::write(&path, text).expect("room");
        fit(&desk.path("kept"));
    }
    ended(&verify(), 0, "0 things wrong");
}

/// A finding of a ring with ports is judged again from the attempts in its file, and an edited one is refused.
#[test]
fn a_fuzz_run_on_a_ring_with_ports_is_verified() {
    let wrong = OWN.replace("\"]", "\", \"drive 1 deviates writes-ignored\"]");
    let desk = Desk::new(&wrong);
    let fixed = ["fuzz", "run", "--rig", "desk.toml", "--allow-motion"];
    let more = ["--behind-port", "--findings", "1", "--out", "kept"];
    ended(&desk.run(&[&fixed[..], &more].concat()), 1, "1 found");
    let verify = || desk.run(&["verify", "kept"]);
    ended(&verify(), 0, "1 finding judged again, 0 things wrong");
    let file = crate::program::findings(&desk.path("kept")).remove(0);
    let text = fs::read_to_string(&file).expect("a finding");
    let finding: Value = serde_json::from_str(&text).expect("JSON");
    let refused = |file: &Path, edited: &str| {
        let before = fs::read_to_string(file).expect("a file");
        assert_ne!(before, edited);
        fs::write(file, edited).expect("room");
        ended(&verify(), 1, "differs      case ");
        fs::write(file, before).expect("room");
    };
    let change = |path: &str, value: Value| {
        let mut changed = finding.clone();
        *changed.pointer_mut(path).expect("a field") = value;
        refused(&file, &changed.to_string());
    };
    change("/difference/drive", 0.into());
    change("/difference/byte", 3.into());
    change("/difference/about", "another sentence".into());
    change("/seen_again", 1.into());
    change("/confirmed", false.into());
    change("/number", 1_000_000.into());
    change("/case/acts", Value::Array(Vec::new()));
    let attempts = finding["attempts"].as_array().expect("attempts").len();
    assert!(attempts >= 3, "{attempts}");
    for attempt in 0..attempts {
        let path = format!("/attempts/{attempt}/last/received");
        let received = finding.pointer(&path).expect("bytes").as_str();
        let byte = &received.expect("a text")[..2];
        let other = received.expect("a text").replacen(byte, "5B", 1);
        change(&path, other.into());
        let mut fewer = finding.clone();
        fewer["attempts"]
            .as_array_mut()
            .expect("attempts")
            .remove(attempt);
        refused(&file, &fewer.to_string());
    }
    let scenario = file.with_extension("scn");
    let text = fs::read_to_string(&scenario).expect("a scenario");
    refused(&scenario, &(text + "> 80\n"));
    // Without its attempts it is as one of an earlier version: not confirmed.
    let mut bare = finding.clone();
    bare.as_object_mut().expect("an object").remove("attempts");
    fs::write(&file, bare.to_string()).expect("room");
    fit(&desk.path("kept"));
    ended(&verify(), 5, "unconfirmed  case ");
}
