//! Edited evidence of simulated rigs, and signatures.

use crate::edits::{PASSES, check, check_each, fit, kept};
use crate::program::{Desk, ended};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

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
            .find(|(own, other)| own != other);
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

/// A record with other bytes of the same meaning is none that this program writes.
#[test]
fn another_form_of_a_record() {
    let kept = kept(Desk::new(OWN), "run", false);
    let text = kept.text();
    ended(&kept.verified_text(&text), 0, "0 things wrong");
    let words = "this program writes the line in other bytes";
    for (from, to) in [
        ("{\"kind\":\"begin\",", "{\"kind\": \"begin\","),
        (
            "\"kind\":\"verdict\",\"verdict\":\"failed\"",
            "\"verdict\":\"failed\",\"kind\":\"verdict\"",
        ),
        ("\"byte\":\"FF\"", "\"byte\":\"ff\""),
    ] {
        let edited = text.replacen(from, to, 1);
        assert_ne!(edited, text, "{from}");
        ended(&kept.verified_text(&edited), 1, words);
    }
    // The verdict is the last line of its attempt.
    let mut lines = kept.lines();
    let verdict = |line: &Value| line["kind"] == "verdict";
    let at = lines.iter().position(verdict).expect("a verdict");
    lines.swap(at - 1, at);
    let words = "an event behind the verdict of its attempt";
    ended(&kept.verified(&lines), 2, words);
}

/// A failure that is stated as left out by the limits cannot be found where the rig has such limits, and verify says so.
#[test]
fn a_failure_stated_as_left_out() {
    let kept = kept(Desk::limited(OWN, ""), "run", false);
    let mut lines = kept.lines();
    let of = |line: &Value, kind: &str| line["kind"] == kind && line["name"] == "fails";
    let from = lines.iter().position(|line| of(line, "scenario"));
    let to = lines.iter().position(|line| of(line, "case"));
    let (from, to) = (from.expect("an attempt"), to.expect("a case"));
    lines.drain(from..to);
    let case = &mut lines[from];
    case["verdict"] = "skipped".into();
    case["took"] = 0.into();
    let why = "the rig's [limits] do not let it be played to its end: any words";
    case["remarks"] = vec![why].into();
    case.as_object_mut().expect("fields").remove("finding");
    let last = lines.last_mut().expect("lines");
    last["verdicts"][1] = "skipped".into();
    let said = crate::program::said(&kept.verified(&lines));
    assert!(!said.contains("case fails: the record has"), "{said}");
    let words = "unconfirmed  which scenarios the limits left out";
    assert!(said.contains(words), "{said}");
}

/// What nothing in a folder confirms of the rig's file and of skipped scenarios is stated.
#[test]
fn what_is_not_compared_is_stated() {
    let desk = Desk::new(OWN);
    fs::write(desk.path("passes.scn"), PASSES).expect("room");
    let run = [
        "run",
        "--rig",
        "desk.toml",
        "passes.scn",
        "--evidence",
        "one",
    ];
    ended(&desk.run(&run), 0, "1 passed");
    let output = desk.run(&["verify", "one"]);
    ended(
        &output,
        0,
        "unconfirmed  values of the rig's file on which nothing recorded depends",
    );
    let said = crate::program::said(&output);
    assert!(!said.contains("scenarios that were skipped"), "{said}");
    assert!(!said.contains("the limits left out"), "{said}");
    let kept = kept(desk, "run", false);
    let output = kept.verified_text(&kept.text());
    ended(
        &output,
        0,
        "unconfirmed  the texts of scenarios that were skipped",
    );
}

/// A scenario that failed is not made to have passed by changing all that tells of it.
#[test]
fn a_deleted_failure() {
    let kept = kept(Desk::new(OWN), "run", false);
    let lines = kept.lines();
    let failed = |line: &Value| line["kind"] == "case" && line["name"] == "fails";
    let mut without: Vec<Value> = lines.iter().filter(|line| !failed(line)).cloned().collect();
    let last = without.last_mut().expect("lines");
    last["verdicts"].as_array_mut().expect("a list").remove(1);
    assert!(kept.refused(&without));
}

/// A record as of a run without one of the scenarios that were selected, with nothing of it left: the first line knows it.
#[test]
fn a_scenario_left_out_with_all_its_files() {
    let kept = kept(Desk::new(OWN), "run", false);
    let lines = kept.lines();
    for place in 0..=4 {
        let mut more = lines.clone();
        let selected = more[0]["selected"].as_array_mut().expect("a list");
        assert_eq!(selected.len(), 4);
        selected.insert(place, "5".repeat(64).into());
        assert!(kept.refused(&more), "{place}");
    }
}

/// A record of schema 1 has neither the purpose of the run nor the scenarios that were selected, and no sums of the texts of cases. Its
/// attempts are judged again, and verify says that the record does not hold the rest.
#[test]
fn of_a_record_of_schema_1() {
    let kept = kept(Desk::new(OWN), "run", false);
    let mut old = kept.lines();
    old[0]["schema"] = 1.into();
    for line in &mut old {
        let new: &[&str] = match line["kind"].as_str() {
            Some("run") => &["purpose", "selected"],
            Some("case") => &["sha256"],
            _ => &[],
        };
        let line = line.as_object_mut().expect("fields");
        for field in new {
            assert!(line.remove(*field).is_some(), "{field}");
        }
    }
    let output = kept.verified(&old);
    for words in [
        "unconfirmed  this record of schema 1 has no looks at the ports and no texts of skipped scenarios",
        "passed       passes\n",
        "failed       fails\n",
        "3 attempts judged again, 0 things wrong; incomplete",
    ] {
        ended(&output, 5, words);
    }
    let failed = old.iter_mut().find(|line| line["verdict"] == "failed");
    failed.expect("a scenario that fails")["verdict"] = "passed".into();
    let output = kept.verified(&old);
    let words = "fails: the record says passed, its bytes say failed";
    ended(&output, 1, words);
}

/// A signature by the standard tool, checked and broken.
#[test]
fn signatures() {
    if !crate::debian::has("ssh-keygen", "signatures") {
        return;
    }
    let keygen = |folder: &Path| {
        Command::new("ssh-keygen")
            .args(["-q", "-t", "ed25519", "-N", "", "-f", "key"])
            .current_dir(folder)
            .output()
    };
    let desk = Desk::new(OWN);
    let made = keygen(&desk.path("")).expect("ssh-keygen");
    assert!(made.status.success());
    fs::write(desk.path("passes.scn"), PASSES).expect("room");
    let run = |more: &[&str]| {
        let fixed = ["run", "--rig", "desk.toml", "passes.scn", "--evidence"];
        desk.run(&[&fixed[..], more].concat())
    };
    ended(
        &run(&["none", "--sign", "missing"]),
        2,
        "ssh-keygen -t ed25519",
    );
    ended(&run(&["kept", "--sign", "key"]), 0, "1 passed");
    let public = fs::read_to_string(desk.path("key.pub")).expect("a key");
    fs::write(desk.path("signers"), format!("bench@lab {public}")).expect("room");
    let signed = |identity: &str| {
        let by = ["--allowed-signers", "signers", "--identity", identity];
        desk.run(&[&["verify", "kept"], &by[..]].concat())
    };
    ended(&signed("bench@lab"), 0, "signed by    bench@lab");
    ended(
        &signed("someone@else"),
        1,
        "SHA256SUMS.sig is not a signature of someone@else",
    );
    ended(
        &desk.run(&["verify", "kept"]),
        0,
        "unconfirmed  its signature",
    );
    let versions = desk.path("kept/versions.json");
    let text = fs::read_to_string(&versions).expect("a file");
    fs::write(&versions, text.replace("kernel", "kernels")).expect("room");
    fit(&desk.path("kept"));
    ended(
        &signed("bench@lab"),
        1,
        "SHA256SUMS.sig is not a signature of bench@lab",
    );
    fs::remove_file(desk.path("kept/SHA256SUMS.sig")).expect("a file");
    ended(&signed("bench@lab"), 1, "SHA256SUMS.sig: it is missing");
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
    let own = fs::read_to_string(&scenario).expect("a scenario");
    refused(&scenario, &(own + "> 80\n"));
    // Without its attempts it is as one of an earlier version: not confirmed.
    let mut bare = finding.clone();
    bare.as_object_mut().expect("an object").remove("attempts");
    fs::write(&file, bare.to_string()).expect("room");
    fit(&desk.path("kept"));
    ended(&verify(), 5, "unconfirmed  case ");
}

/// The folder of a fuzz run is signed; its findings are played again, and a changed one is refused.
#[test]
fn a_fuzz_run_is_verified() {
    if !crate::debian::has("ssh-keygen", "signatures") {
        return;
    }
    let desk = Desk::new(OWN);
    let made = Command::new("ssh-keygen")
        .args(["-q", "-t", "ed25519", "-N", "", "-f", "key"])
        .current_dir(desk.path(""))
        .output()
        .expect("ssh-keygen");
    assert!(made.status.success());
    let public = fs::read_to_string(desk.path("key.pub")).expect("a key");
    fs::write(desk.path("signers"), format!("bench@lab {public}")).expect("room");
    let fixed = [
        "fuzz",
        "run",
        "--rig",
        "sim:2",
        "--findings",
        "1",
        "--deviates",
    ];
    let run =
        |more: &[&str]| desk.run(&[&fixed[..], &["1=writes-ignored", "--out"], more].concat());
    ended(&run(&["bare"]), 1, "1 found");
    ended(&desk.run(&["verify", "bare"]), 0, "it has no signature");
    ended(&run(&["kept", "--sign", "key"]), 1, "1 found");
    let by = ["--allowed-signers", "signers", "--identity", "bench@lab"];
    let signed = || desk.run(&[&["verify", "kept"], &by[..]].concat());
    ended(&signed(), 0, "signed by    bench@lab");
    ended(&signed(), 0, "1 finding judged again, 0 things wrong");
    let files = fs::read_dir(desk.path("kept")).expect("a folder");
    let mut files = files.map(|file| file.expect("a file").path());
    let finding = files
        .find(|file| file.extension().is_some_and(|own| own == "json"))
        .expect("a finding");
    let text = fs::read_to_string(&finding).expect("a file");
    fs::write(&finding, text.replace("writes-ignored", "and-is-or")).expect("room");
    ended(&desk.run(&["verify", "kept"]), 1, "was changed");
    fit(&desk.path("kept"));
    ended(&desk.run(&["verify", "kept"]), 1, "differs      case");
    ended(
        &signed(),
        1,
        "SHA256SUMS.sig is not a signature of bench@lab",
    );
}
