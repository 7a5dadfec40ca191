//! Wrong drives and wrong masters planted in simulated rigs: `qualify` names them.

use crate::program::{ALL, Desk, ended, said};

/// Few conversations are permitted.
#[test]
fn deviations_are_named() {
    named_on("", &["counts-7-zeros"], &["9.2-synco"]);
}

#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn deviations_of_telegrams_are_named() {
    named(&[
        "checksum-wrong",
        "checksum-not-checked",
        "increments-twice",
        "does-not-increment",
        "forwards-without-delay",
        "writes-ignored",
        "read-long-reversed",
    ]);
}

#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn deviations_of_the_error_mode_are_named() {
    named(&[
        "ignores-parity-errors",
        "counts-7-zeros",
        "sends-16-zeros",
        "sends-18-zeros",
        "time-out-after-25ms",
        "no-zeros-unasked",
        "zeros-20ms-after-a-time-out",
        "read-word-high-first",
    ]);
}

/// Drives that do not answer as a master expects: their safe state is not confirmed.
const NOT_SAFE: [&str; 3] = ["checksum-wrong", "increments-twice", "does-not-increment"];

/// Each of these, planted in the middle drive of three, is among those that `qualify` names.
fn named(names: &[&str]) {
    named_on(ALL, names, &[]);
}

fn named_on(limits: &str, names: &[&str], scenarios: &[&str]) {
    for name in names {
        let ring = format!(
            "drives = 3\ntransport = \"sim\"\n[sim]\nsetup = [\"drive 1 deviates {name}\"]\n"
        );
        let desk = Desk::limited(&ring, limits);
        let fixed = ["qualify", "--rig", "desk.toml", "--evidence", "kept"];
        let output = desk.run(&[&fixed, scenarios].concat());
        let code = if NOT_SAFE.contains(name) { 7 } else { 1 };
        ended(&output, code, &format!("{name} (ND21 "));
        let line = |line: &str| line.starts_with("deviation") && line.contains(&format!("{name} "));
        let text = said(&output);
        let line = text.lines().find(|row| line(row)).expect("its name");
        // A ring that cannot be played on any further may not show which drive it is.
        let one_of = line
            .rsplit_once("not known which drive: one of ")
            .is_some_and(|(_, drives)| drives.split(", ").any(|drive| drive == "1"));
        assert!(line.contains(" drive 1: ") || one_of, "{text}");
        let verified = desk.run(&["verify", "kept"]);
        ended(&verified, 0, "0 things wrong");
    }
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn a_wrong_master_is_named() {
    masters(&[("check-byte-off-by-one", "11.6-driver-jobs")]);
}

#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn wrong_masters_are_named() {
    masters(&[
        ("names-the-link-behind", "9.7-driver-names-the-link"),
        ("never-gives-up", "11.5-driver-gives-up"),
    ]);
}

/// A wrong master of the bench is named, in the evidence too. The bench is to blame, not a drive. `deviations` has all of them.
fn masters(all: &[(&str, &str)]) {
    for &(name, scenario) in all {
        let desk = Desk::new(&format!(
            "drives = 3\ntransport = \"sim\"\n[sim]\nsetup = [\"master deviates {name}\"]\n"
        ));
        let more = [
            "qualify",
            scenario,
            "--allow-motion",
            "--rig",
            "desk.toml",
            "--evidence",
            "kept",
        ];
        let output = desk.run(&more);
        ended(&output, 3, &format!("the master: {name} "));
        let named = std::fs::read_to_string(desk.path("kept/deviations.txt")).expect("a file");
        assert!(named.contains("the bench is wrong, not a drive"), "{named}");
        ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
    }
}
