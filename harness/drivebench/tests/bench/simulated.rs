//! Qualification in virtual time: right drives have no deviations, whatever they may be asked, and what was found of wrong ones can be
//! loaded again.

use crate::program::{ended, said, verify};
use std::path::Path;
use std::process::{Command, Output};

fn rig(drives: u8, reset: bool, more: &str, setup: &str) -> String {
    format!(
        "schema = 1\n[rig]\nid = \"sim\"\n{more}\n[ring.1]\ndrives = {drives}\ntransport = \"sim\"\n[limits]\nallow_motion = true\n\
         allow_eeprom = true\nallow_reset = {reset}\nallow_outputs = true\nallow_monitoring = true\n[sim]\n\
         setup = [\"drive 0..last input GPIN3 GPIN5 high\"{setup}]\n"
    )
}

fn qualify(folder: &Path, name: &str, text: &str) -> Output {
    qualify_with(folder, name, text, &[])
}

/// The same with the probes and the qualification's own scenarios, and no other.
fn ask(folder: &Path, name: &str, text: &str) -> Output {
    qualify_with(folder, name, text, &["--filter", "10.1-read-byte"])
}

fn qualify_with(folder: &Path, name: &str, text: &str, more: &[&str]) -> Output {
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).expect("room");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.arg("qualify").arg("--rig").arg(path);
    command.arg("--evidence").arg(folder.join(name));
    command.args(more).output().expect("the program")
}

#[test]
fn right_drives_have_no_deviations() {
    have_none(&[1], &[true]);
}

#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn right_drives_of_any_ring_have_no_deviations() {
    have_none(&[1, 2, 5, 7], &[true, false]);
}

/// Each number of drives puts a drive's cycles of 432 us (4.1) elsewhere in the conversations.
fn have_none(sizes: &[u8], resets: &[bool]) {
    let folder = tempfile::tempdir().expect("a folder");
    for &drives in sizes {
        for &reset in resets {
            let name = format!("{drives}-{reset}");
            let output = qualify(folder.path(), &name, &rig(drives, reset, "", ""));
            let code = output.status.code();
            assert!(matches!(code, Some(0 | 5)), "{name}: {}", said(&output));
            let failed = said(&output).lines().any(|line| line.starts_with("failed"));
            assert!(!failed, "{name}: {}", said(&output));
            let words = match code {
                Some(0) => "deviations: none; every byte is as the model of the manual says",
                _ => "deviations: not known; ",
            };
            assert!(said(&output).contains(words), "{name}: {}", said(&output));
            assert!(!said(&output).contains(": a byte differed"), "{name}");
            let unexplained = said(&output).contains("no value of it gives the bytes");
            assert!(!unexplained, "{name}: {}", said(&output));
            ended(&verify(&folder.path().join(&name)), 0, "0 things wrong");
        }
    }
}

/// ND21 9.2, 10.1: drives that are not reset hold what earlier scenarios have left, and perhaps already what a probe writes.
#[test]
fn probes_settle_the_bus_without_resets() {
    probes_settle("as-printed", "accepted");
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn probes_settle_the_bus_as_by_default() {
    probes_settle("four-data", "error");
}

fn probes_settle(read_long: &str, empty: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let held = ", \"drive 0..last memory FE12 = 12 34 56 78\"";
    let setup = format!(
        "{held}, \"drive 0..last property read-long = {read_long}\", \"drive 0..last property empty-short-telegram = {empty}\""
    );
    let path = folder.path().join("rig.toml");
    std::fs::write(&path, rig(2, false, "", &setup)).expect("room");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(["qualify", "10.2-write-byte", "--allow-motion", "--rig"]);
    command.arg(path);
    let kept = folder.path().join(read_long);
    let output = command.arg("--evidence").arg(&kept).output();
    let said = said(&output.expect("the program"));
    for settled in [
        format!("read-long (nd21 10.1): {read_long}"),
        format!("empty-short-telegram (nd21 9.2): {empty}"),
    ] {
        assert!(said.contains(&settled), "{said}");
    }
    ended(&verify(&kept), 0, "0 things wrong");
}

/// ND21 9.8: one answer to the byte that breaks a check sequence off does not show which of the drives has passed it on. The probe tells the
/// first sixteen behind the master from each other. Of two others none is named.
#[test]
fn the_drive_that_differs_is_named_or_none_is() {
    differs(&[(3, 1, "answered, but drive 1 forwarded")]);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn more_drives_that_differ_are_named_or_none_is() {
    let two = "the bytes received do not tell which: answered, but drive 0 forwarded, or answered, but drive 1 forwarded";
    differs(&[(3, 2, "answered, but drive 2 forwarded"), (18, 0, two)]);
}

fn differs(rings: &[(u8, u8, &str)]) {
    let folder = tempfile::tempdir().expect("a folder");
    for &(drives, drive, words) in rings {
        let setup = format!(", \"drive {drive} property broken-sequence = forwarded\"");
        let name = format!("{drives}-{drive}");
        let output = ask(folder.path(), &name, &rig(drives, false, "", &setup));
        let text = said(&output);
        let settled = format!("broken-sequence (nd21 9.8): {words}\n");
        assert!(text.contains(&settled), "{name}: {text}");
        assert!(!text.contains("deviation: "), "{name}: {text}");
    }
}

/// What `qualify` has found is what a rig with that profile does.
#[test]
fn a_profile_is_loaded_again() {
    let open = ", \"drive 0..last property read-long = as-printed\", \"drive 0..last property time-out = 13ms\"";
    let found = [
        "read-long (nd21 10.1): as-printed",
        "time-out (nd21 9.9): 13ms",
    ];
    is_loaded_again(false, open, &found);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_whole_profile_is_loaded_again() {
    let open = ", \"drive 0..last property read-long = as-printed\", \"drive 0..last property time-out = 13ms\", \
                \"drive 1 property bus-errors = time-out-only\", \"drive 1 property self-test-time = 300ms\", \
                \"drive 1 property i2t-time = 700ms\", \"drive 1 property s-ramp-wire = puffer\"";
    let found = [
        "read-long (nd21 10.1): as-printed",
        "time-out (nd21 9.9): 13ms",
        "time-out-wait (nd21 9.9): 10ms",
        "bus-errors (nd21 11.8): drive 1: time-out-only",
        "self-test-time (nd21 11.8): drive 1: ",
        "eeprom-write-time (nd21 14.10.5.3): drive 0: 10ms to 10ms",
        "i2t-time (nd21 14.4.2): drive 1: 69",
        "s-ramp-wire (nd21 13.5.3): drive 0: none",
        "s-ramp-wire (nd21 13.5.3): drive 1: puffer",
    ];
    is_loaded_again(true, open, &found);
}

fn is_loaded_again(resets: bool, open: &str, found: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let rig = |more: &str, setup: &str| rig(2, resets, more, setup);
    let first = ask(folder.path(), "first", &rig("", open));
    let profile = "profile = \"first/profile.toml\"";
    let second = ask(folder.path(), "second", &rig(profile, ""));
    for &words in found {
        assert!(said(&first).contains(words), "{}", said(&first));
        assert!(said(&second).contains(words), "{}", said(&second));
    }
    // The folder stands for itself.
    std::fs::remove_dir_all(folder.path().join("first")).expect("a folder");
    ended(&verify(&folder.path().join("second")), 0, "0 things wrong");
    let output = ask(folder.path(), "third", &rig(profile, ""));
    ended(
        &output,
        2,
        "the path of a profile that `drivebench qualify` has written",
    );
}

/// A scenario that asks for something else than the manual does, with cells that are set back behind it.
const WRONG: &str = "title wrong\nring 4\ndrive 1 memory FE13 = 88\n> 88 FD C0 13 FE D1\n> 80*6\n< 88 01 C0 13 88 A5\n< 81\n";

#[test]
fn evidence_changes_no_verdict() {
    changes_no_verdict(&[("10.3-", 4)]);
}

#[test]
#[ignore = "plays long chapters four times; .ci/nightly runs it"]
fn evidence_changes_no_verdict_of_long_chapters() {
    changes_no_verdict(&[("9.", 3), ("10.", 4), ("14.", 3)]);
}

/// Keeping evidence changes no verdict, no exit code and no message, and `verify` gives the same verdicts.
/// `chapters` are the filters of what is played, each with the size of its ring; one scenario that fails is played as well.
fn changes_no_verdict(chapters: &[(&str, u8)]) {
    let folder = tempfile::tempdir().expect("a folder");
    let wrong = folder.path().join("wrong.scn");
    std::fs::write(&wrong, WRONG).expect("room");
    let wrong = wrong.to_str().expect("a name");
    let right = chapters.iter().map(|&(chapter, size)| (chapter, size, 0));
    for (number, (what, size, code)) in [(wrong, 4, 1)].into_iter().chain(right).enumerate() {
        let run = |more: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
            match what == wrong {
                true => command.args(["run", wrong]),
                false => command.args(["run", "--filter", what]),
            };
            command.args(["--rig", &format!("sim:{size}")]).args(more);
            command.output().expect("the program")
        };
        let kept = folder.path().join(number.to_string());
        let kept = kept.to_str().expect("a name");
        let (bare, with) = (run(&[]), run(&["--evidence", kept]));
        ended(&bare, code, "");
        ended(&with, code, "");
        let told = said(&with).replace(&format!("evidence in {kept}\n"), "");
        assert_eq!(told, said(&bare));
        ended(&verify(Path::new(kept)), 0, "0 things wrong");
    }
    // The row that differs is that of the scenario, not of what sets the cell back.
    let kept = folder.path().join("0");
    let xml = std::fs::read_to_string(kept.join("junit.xml")).expect("verdicts");
    assert!(xml.contains("failures=\"1\""), "{xml}");
    // Another byte in the record is not what the ring gives.
    let record = kept.join("run.jsonl");
    let text = std::fs::read_to_string(&record).expect("a record");
    let changed = text.replacen("\"byte\":\"A5\"", "\"byte\":\"A6\"", 1);
    std::fs::write(&record, changed).expect("room");
    ended(&verify(&kept), 1, "the simulated rings give");
}
