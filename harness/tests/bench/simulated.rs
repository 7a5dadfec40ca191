//! Qualification in virtual time: right drives have no deviations, whatever they may be asked, and what was found of wrong ones can be
//! loaded again.

use super::{ended, said, verify};
use std::path::Path;
use std::process::{Command, Output};

fn rig(drives: u8, reset: bool, more: &str, setup: &str) -> String {
    format!(
        "schema = 1\n[rig]\nid = \"sim\"\n{more}\n[ring.1]\ndrives = {drives}\ntransport = \"sim\"\n[limits]\nallow_motion = true\n\
         allow_eeprom = true\nallow_reset = {reset}\nallow_outputs = true\n[sim]\n\
         setup = [\"drive 0..last input GPIN3 GPIN5 high\"{setup}]\n"
    )
}

fn qualify(folder: &Path, name: &str, text: &str) -> Output {
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, text).expect("room");
    let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
    command.arg("qualify").arg("--rig").arg(path);
    command.arg("--evidence").arg(folder.join(name));
    command.output().expect("the program")
}

/// Each number of drives puts a drive's cycles of 432 us (4.1) elsewhere in the conversations.
#[test]
fn right_drives_have_no_deviations() {
    let folder = tempfile::tempdir().expect("a folder");
    for drives in [1, 2, 5, 7] {
        for reset in [true, false] {
            let name = format!("{drives}-{reset}");
            let output = qualify(folder.path(), &name, &rig(drives, reset, "", ""));
            let code = output.status.code();
            assert!(matches!(code, Some(0 | 5)), "{name}: {}", said(&output));
            let failed = said(&output).lines().any(|line| line.starts_with("failed"));
            assert!(!failed, "{name}: {}", said(&output));
            assert!(
                said(&output).contains("deviations: none"),
                "{name}: {}",
                said(&output)
            );
            ended(&verify(&folder.path().join(&name)), 0, "0 things wrong");
        }
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
    ended(&output, code.unwrap_or(0), "deviations: none");
    let aborted = said(&output)
        .lines()
        .any(|line| line.starts_with("aborted"));
    assert!(!aborted, "{}", said(&output));
}

/// What `qualify` has found is what a rig with that profile does.
#[test]
fn a_profile_is_loaded_again() {
    let folder = tempfile::tempdir().expect("a folder");
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
    let first = qualify(folder.path(), "first", &rig(2, true, "", open));
    let profile = "profile = \"first/profile.toml\"";
    let second = qualify(folder.path(), "second", &rig(2, true, profile, ""));
    for words in found {
        assert!(said(&first).contains(words), "{}", said(&first));
        assert!(said(&second).contains(words), "{}", said(&second));
    }
    // The folder stands for itself.
    std::fs::remove_dir_all(folder.path().join("first")).expect("a folder");
    ended(&verify(&folder.path().join("second")), 0, "0 things wrong");
    let output = qualify(folder.path(), "third", &rig(2, true, profile, ""));
    ended(
        &output,
        2,
        "the path of a profile that `drivebench qualify` has written",
    );
}
