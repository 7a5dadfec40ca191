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

/// Drives that are not reset are elsewhere in their cycles of 432 us (4.1) than the model: a speed that changes is their own.
#[test]
fn a_right_motor_may_accelerate_without_resets() {
    let folder = tempfile::tempdir().expect("a folder");
    let turns = "title x\nring 1\ndelete-error 0\ngo 0\nwrite-word 0 nsoll = 290rpm\n";
    let reads = "read-word 0 nist\nread-word 0 nist\nread-word 0 nist\n";
    let until = "until drive 0 nist > 280rpm within 3s\n";
    for (name, more, code) in [
        ("reads.scn", reads.to_owned(), 0),
        ("until.scn", until.to_owned(), 0),
        ("wrong.scn", format!("{until}read-byte 0 FF08 = 7F\n"), 1),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{turns}{more}")).expect("room");
        let path = path.to_str().expect("a name");
        let output = run(folder.path(), &rig(1, false, "", ""), &[path]);
        ended(&output, code, "");
    }
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

/// A simulated rig obeys its `[limits]` and `[retry]`, and evidence changes neither a verdict nor what is skipped.
#[test]
fn limits_and_attempts_hold_with_and_without_evidence() {
    let folder = tempfile::tempdir().expect("a folder");
    let failing = folder.path().join("failing.scn");
    let text = "title A byte that does not come\nring 3\n> 80\n< 81\n";
    std::fs::write(&failing, text).expect("room");
    let failing = failing.to_str().expect("a name");
    let rig = rig(3, false, "[retry]\nattempts = 2", "");
    for (name, wanted) in [
        ("10.5-reset-forgets", "`allow_reset`"),
        ("9.2-synco", "1 passed"),
        (failing, "2 attempts: failed, failed"),
    ] {
        let plain = run(folder.path(), &rig, &[name]);
        let kept = folder.path().join(format!("kept-{}", wanted.len()));
        let kept = kept.to_str().expect("a name");
        let evidence = run(folder.path(), &rig, &[name, "--evidence", kept]);
        assert!(said(&plain).contains(wanted), "{}", said(&plain));
        assert_eq!(plain.status.code(), evidence.status.code(), "{name}");
        assert_eq!(plain.stdout, evidence.stdout, "{name}");
        ended(&verify(Path::new(kept)), 0, "0 things wrong");
    }
}

/// What a rig's limits do not let be played to its end is not begun, and nothing is wrong with that.
#[test]
fn limits_leave_out_what_they_deny() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = rig(2, false, "", "").replace("= true", "= false");
    let output = qualify(folder.path(), "careful", &text);
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 5)), "{}", said(&output));
    let words = "the rig's [limits] do not let it be played to its end: ring 1: byte ";
    ended(&output, code.unwrap_or(0), words);
    ended(&output, code.unwrap_or(0), "deviations: n");
    let aborted = said(&output)
        .lines()
        .any(|line| line.starts_with("aborted"));
    assert!(!aborted, "{}", said(&output));
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

/// ND21 11.8: a drive that is silent in its self-test cannot be polled. Its time lies between a byte that was lost and one that came back.
#[test]
fn a_silent_self_test_is_timed() {
    let folder = tempfile::tempdir().expect("a folder");
    let open =
        ", \"drive 0 property self-test-bus = silent\", \"drive 0 property self-test-time = 81ms\"";
    let output = ask(folder.path(), "first", &rig(1, true, "", open));
    let text = said(&output);
    assert!(
        text.contains("self-test-bus (nd21 11.8): drive 0: silent"),
        "{text}"
    );
    let words = "self-test-time (nd21 11.8): drive 0: ";
    let (_, span) = text.split_once(words).expect("a time");
    let (low, high) = span
        .lines()
        .next()
        .and_then(|own| own.split_once(" to "))
        .expect("a span");
    let ms = |text: &str| text.trim_end_matches("ms").parse::<f64>().expect("a time");
    assert!(
        ms(low) <= 81.5 && 80.5 <= ms(high) && ms(high) - ms(low) < 3.0,
        "{low} to {high}"
    );
    ended(&verify(&folder.path().join("first")), 0, "0 things wrong");
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

/// The same where each scenario has drives of another bus of its own; and an edited record is found.
#[test]
fn evidence_of_benches_of_other_buses_is_verified() {
    let folder = tempfile::tempdir().expect("a folder");
    for (number, (rig, name)) in [
        ("sim:unitek:1", "unitek-ex-1-not-stored"),
        ("sim:nordac", "nordac-open-zsw11-at-rest-0"),
        ("sim:nordac:1", "nordac-open-zsw11-at-rest-0"),
    ]
    .into_iter()
    .enumerate()
    {
        let kept = folder.path().join(number.to_string());
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(["run", name, "--rig", rig, "--evidence"]);
        ended(
            &command.arg(&kept).output().expect("the program"),
            0,
            "1 passed",
        );
        ended(&verify(&kept), 0, "0 things wrong");
        let record = kept.join("run.jsonl");
        let text = std::fs::read_to_string(&record).expect("a record");
        let changed = text.replacen("\"passed\"", "\"failed\"", 1);
        assert_ne!(changed, text);
        std::fs::write(&record, changed).expect("room");
        ended(&verify(&kept), 1, "");
    }
}

/// The same on a simulated rig with drives of its own, where all scenarios share them; and the table shows the scenario's bytes.
#[test]
fn a_rig_with_drives_of_its_own_fails_alike() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = rig(4, true, "", ", \"drive 0 memory FE20 = 11\"");
    std::fs::write(folder.path().join("own.toml"), text).expect("room");
    std::fs::write(folder.path().join("wrong.scn"), WRONG).expect("room");
    for more in [&[][..], &["--evidence", "kept"]] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(["run", "wrong.scn", "--rig", "own.toml"]);
        let output = command.args(more).current_dir(folder.path()).output();
        let output = output.expect("the program");
        ended(&output, 1, "1 failed");
        ended(&output, 1, "the master received 80 where 81 is expected");
        ended(&output, 1, "→    7      80  80  80   80  [80]");
    }
    ended(&verify(&folder.path().join("kept")), 0, "0 things wrong");
}

fn run(folder: &Path, rig: &str, more: &[&str]) -> Output {
    let path = folder.join("rig.toml");
    std::fs::write(&path, rig).expect("room");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.arg("run").arg("--rig").arg(path).args(more);
    command.output().expect("the program")
}

/// ND21 10.2: a drive that cannot be made to hold what a header says has failed, whether evidence is kept or not. It is never skipped.
#[test]
fn a_drive_that_cannot_be_made_ready_has_failed() {
    let names = ["10.2-write-byte", "10.2-write-word", "10.1-read-long"];
    for (name, words) in [
        ("writes-ignored", "was written, 00 is read"),
        ("read-long-reversed", "ReadLong"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let text = rig(3, true, "", &format!(", \"drive 1 deviates {name}\""));
        let kept = folder.path().join("kept");
        let evidence = ["--evidence", kept.to_str().expect("a name")];
        for more in [&[][..], &evidence] {
            let arguments = [&["--allow-motion"], &names[..], more].concat();
            let output = run(folder.path(), &text, &arguments);
            ended(&output, 1, words);
            assert!(!said(&output).contains("skipped"), "{}", said(&output));
        }
        ended(&verify(&kept), 0, "0 things wrong");
    }
    // The drive writes this cell itself (14.5.5): nothing is known of the drive then.
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.scn");
    let scenario = "title x\nring 3\ndrive 1 memory FF18 = 12 34\n> 80\n< 80\n";
    std::fs::write(&own, scenario).expect("room");
    let text = rig(3, true, "", ", \"drive 0 memory FE97 = 00\"");
    let own = own.to_str().expect("a name");
    let output = run(folder.path(), &text, &["--allow-motion", own]);
    let words =
        "cell FF18 of drive 1: 12 was written, 00 is read (a drive may change this cell by itself";
    ended(&output, 5, words);
    ended(&output, 5, "1 inconclusive");
}

/// Exit code 0 says that something was judged and nothing differed.
#[test]
fn a_run_that_judges_nothing_is_incomplete() {
    let folder = tempfile::tempdir().expect("a folder");
    let kept = folder.path().join("kept");
    let evidence = ["--evidence", kept.to_str().expect("a name")];
    let other = ["9.6-every-write", "8.2-exchange-4"];
    let bare = rig(2, true, "", "");
    let own = rig(2, true, "", ", \"drive 0 memory FE97 = 00\"");
    for text in [bare, own] {
        for more in [&[][..], &evidence] {
            let _none_yet = std::fs::remove_dir_all(&kept);
            let output = run(folder.path(), &text, &[&other[..], more].concat());
            ended(&output, 5, "0 passed, 0 failed, 2 skipped");
            ended(
                &output,
                5,
                "not played: 2 (it is for rings of another size)",
            );
        }
    }
    let quiet = folder.path().join("quiet.scn");
    let lines = "title x\nring 2\ndrive 1 memory FE13 = 88\nwait 5ms\n";
    std::fs::write(&quiet, lines).expect("room");
    let quiet = [quiet.to_str().expect("a name")];
    for text in [
        rig(2, true, "", ""),
        rig(2, true, "", ", \"drive 0 memory FE97 = 00\""),
    ] {
        for more in [&[][..], &evidence] {
            let _none_yet = std::fs::remove_dir_all(&kept);
            let output = run(folder.path(), &text, &[&quiet[..], more].concat());
            ended(&output, 5, "nothing was judged");
        }
        let mut verify = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        verify.arg("verify").arg(&kept);
        ended(&verify.output().expect("the program"), 0, "");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(["qualify", "--filter", "8.2-exchange-4", "--rig"]);
    command.arg(folder.path().join("rig.toml"));
    command
        .arg("--evidence")
        .arg(folder.path().join("qualified"));
    ended(&command.output().expect("the program"), 5, "1 skipped");
}

/// A scenario that the rig's limits do not permit to its end is skipped with the limit named, and nothing of it is sent. Others are played, and
/// where it was named itself, the exit code is 2.
#[test]
fn what_the_limits_deny_is_skipped() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = rig(2, false, "", ", \"drive 0 memory FE13 = 88\"").replace("= true", "= false");
    let write = |name: &str, lines: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("title x\nring 2\n{lines}\n")).expect("room");
        path.to_str().expect("a name").to_owned()
    };
    let after = write(
        "after.scn",
        "> 88 (0-N) C0 13 FE D1\n> 80*4\n< 88 00 C0 13 88 A5",
    );
    for (number, (lines, limit)) in [
        ("> 85 FF 0F A0\n? sent 4 bytes", "allow_motion"),
        ("> 80\n! 1->0: drop", "the fault `drop` is not made"),
        (
            "master write-word 0 nsoll = 100rpm\nwait 1ms",
            "allow_motion",
        ),
        ("write-word 0 nsoll = 100rpm\nwait 1ms", "allow_motion"),
        ("drive 1 memory FF6C = 01 00\nwait 1ms", "allow_motion"),
        ("write-byte 0 FF57 = 04", "allow_monitoring"),
    ]
    .into_iter()
    .enumerate()
    {
        let denied = write("denied.scn", lines);
        let kept = folder.path().join(format!("kept-{number}"));
        let evidence = ["--evidence", kept.to_str().expect("a name")];
        let alone = run(folder.path(), &text, &[denied.as_str()]);
        ended(&alone, 2, "0 passed, 0 failed, 1 skipped");
        ended(&alone, 2, limit);
        let output = run(
            folder.path(),
            &text,
            &[&[denied.as_str(), after.as_str()], &evidence[..]].concat(),
        );
        ended(&output, 2, "skipped denied");
        ended(&output, 2, "passed after");
        let record = std::fs::read_to_string(kept.join("run.jsonl")).expect("a record");
        let case = record.find("\"denied\"").expect("its case");
        assert!(!record[..case].contains("\"sent\""), "{record}");
        ended(&verify(&kept), 0, "0 things wrong");
    }
}

/// A link that a scenario leaves cut is joined behind it, as an interposer joins it: the next scenario finds a ring (ND21 8.5).
#[test]
fn a_cut_link_is_joined_behind_its_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = rig(4, true, "", ", \"drive 0 memory FE13 = 88\"");
    let output = run(folder.path(), &text, &["8.5-addresses", "9.2-synco"]);
    ended(&output, 5, "passed 9.2-synco");
}

/// Where drives are asked about an interlock before each scenario, the ring is brought back first, and the twin follows that.
#[test]
fn an_interlock_disturbs_no_verdict() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, lines: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("title x\nring 2\n{lines}")).expect("room");
        path.to_str().expect("a name").to_owned()
    };
    // One scenario leaves the drives in the error mode, the other one in the middle of a telegram.
    let error = write("error.scn", "> 00 80\n< 00 00\n");
    let middle = write("middle.scn", "> 88 (0-N) C0\n");
    let read = write(
        "read.scn",
        "> 88 (0-N) C0 13 FE D1\n> 80*4\n< 88 00 C0 13 88 A5\n",
    );
    let interlock =
        "[[interlock]]\ndrive = 0\ncell = \"nist\"\nmax = \"300rpm\"\nevery = \"5ms\"\n";
    for (number, more) in ["", "[health]\nbetween = false\n"].into_iter().enumerate() {
        let text = rig(2, false, "", ", \"drive 0 memory FE13 = 88\"") + interlock + more;
        let kept = folder.path().join(number.to_string());
        let names = [&error, &read, &middle, &read, &error, &middle, &read];
        let mut arguments: Vec<_> = names.iter().map(|name| name.as_str()).collect();
        arguments.extend(["--evidence", kept.to_str().expect("a name")]);
        let output = run(folder.path(), &text, &arguments);
        ended(&output, 0, "7 passed, 0 failed");
        assert!(!said(&output).contains("note:"), "{}", said(&output));
        ended(&verify(&kept), 0, "0 things wrong");
    }
}

/// The report on deviations states how much was compared, and is never "none" if a scenario failed.
#[test]
fn a_failed_scenario_leaves_deviations_unsettled() {
    let folder = tempfile::tempdir().expect("a folder");
    // Without resets there are fewer conversations.
    let text = rig(4, false, "", "");
    std::fs::write(folder.path().join("own.toml"), text).expect("room");
    std::fs::write(folder.path().join("wrong.scn"), WRONG).expect("room");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.args(["qualify", "wrong.scn", "--rig", "own.toml"]);
    let output = command
        .current_dir(folder.path())
        .args(["--evidence", "kept"]);
    let output = output.output().expect("the program");
    ended(&output, 1, "deviations: not known");
    ended(
        &output,
        1,
        "wrong: it failed, although every byte is as the model says",
    );
    ended(&output, 1, "scenarios played match the model to their end");
    let text = std::fs::read_to_string(folder.path().join("kept/deviations.txt"));
    let text = text.expect("a file");
    assert!(!text.contains("deviations: none"), "{text}");
}

/// Scenarios of the bus set and read cells that a whole drive leaves alone (ND21 14.2), so that it passes them.
#[test]
fn a_whole_drive_passes_the_scenarios_of_the_bus() {
    let folder = tempfile::tempdir().expect("a folder");
    for (drives, name) in [
        (1, "14.2.1-read-only-cells"),
        (2, "9.1-seven-forms"),
        (3, "9.2-address-follows"),
        (3, "9.2-empty-short-telegram"),
        (3, "9.6-every-write"),
        (3, "9.9-monitored-writes"),
        (3, "10.5-reset-forgets"),
        (3, "12.5-driver-eeprom"),
        (3, "14.10.3-nominal-and-actual-value"),
        (5, "9.3-address-byte"),
    ] {
        let text = rig(drives, true, "", ", \"drive 0..last model nd21\"");
        let output = run(folder.path(), &text, &[name]);
        ended(&output, 0, "1 passed, 0 failed");
    }
}
