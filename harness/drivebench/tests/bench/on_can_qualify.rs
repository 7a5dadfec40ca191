//! Qualifications of simulated UNITEK drives: a correct drive is not blamed and its open points are settled, a wrong one is named, and the
//! record bears both out.

use crate::on_can::{ALL, desk};
use crate::program::{Desk, ended, said};
use std::process::Output;

/// Qualifies by the scenarios of example 2, and by the conversations.
fn qualify(desk: &Desk) -> Output {
    let fixed = ["qualify", "--rig", "desk.toml", "--evidence", "kept"];
    desk.run(&[&fixed[..], &["--filter", "unitek-ex-2"]].concat())
}

fn kept(desk: &Desk, file: &str) -> String {
    std::fs::read_to_string(desk.path("kept").join(file)).expect("a file of the folder")
}

/// The value of an open point is found, whatever it is, and no deviation is named.
#[test]
fn open_points_are_settled_and_no_correct_drive_is_blamed() {
    for (name, value) in [
        ("lock-clears-command", "yes"),
        ("id-change", "restart"),
        ("id-range", "printed"),
        ("event-reply", "as-map-reply"),
        ("homing-time", "700ms"),
        ("dlc4", "ignore"),
        ("wide-replies", "zero"),
        ("interval-accuracy", "one-scan"),
        ("event-edges", "rising"),
        ("event-edges", "falling"),
        ("event-at-set-up", "at-once"),
        ("second-identifiers", "immediate"),
        ("time-out-clear", "lock"),
        ("enable-after-lock", "yes"),
    ] {
        let desk = desk(&format!("property {name} = {value}"), ALL);
        let output = qualify(&desk);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{name}: {}", said(&output));
        let profile = kept(&desk, "profile.toml");
        let line = format!("drive 1 property {name} = {value}");
        assert!(profile.contains(&line), "{name}: {profile}");
        let deviations = kept(&desk, "deviations.txt");
        assert!(deviations.starts_with("deviations: no"), "{deviations}");
    }
}

/// A probe that is not permitted leaves its point open, and the profile says what is missing.
#[test]
fn what_is_not_permitted_stays_open() {
    let desk = desk("", "");
    let output = qualify(&desk);
    assert!(
        matches!(output.status.code(), Some(0 | 5)),
        "{}",
        said(&output)
    );
    let deviations = kept(&desk, "deviations.txt");
    assert!(deviations.starts_with("deviations: none;"), "{deviations}");
    let profile = kept(&desk, "profile.toml");
    for settled in [
        "event-edges = both",
        "event-reply = native",
        "interval-accuracy = exact",
    ] {
        assert!(profile.contains(settled), "{settled}: {profile}");
    }
    for (name, why) in [
        ("homing-time", "allow_motion"),
        ("id-change", "allow_bus_settings"),
        ("power-up-mode", "it shows when the drive is switched on"),
        ("wide-replies", "allow_bus_settings"),
        ("second-identifiers", "allow_bus_settings"),
        ("rate-change", "an adapter with another bit rate"),
    ] {
        let line = profile
            .lines()
            .find(|line| line.starts_with(&format!("{name} =")));
        assert!(
            line.is_some_and(|line| line.contains(why)),
            "{name}: {profile}"
        );
    }
}

/// A wrong drive is named by its deviation, and by no other.
#[test]
fn wrong_drives_are_named() {
    named(&["no-lock"]);
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn more_wrong_drives_are_named() {
    named(&["names-read", "ramps-swapped", "stop-answers", "errors-stay"]);
}

fn named(names: &[&str]) {
    for wrong in names {
        let desk = desk(&format!("deviates {wrong}"), ALL);
        let output = qualify(&desk);
        let deviations = kept(&desk, "deviations.txt");
        let named = format!("deviation: drive 1: {wrong} (UNITEK ");
        assert!(deviations.starts_with(&named), "{wrong}: {deviations}");
        assert_eq!(deviations.matches("deviation: ").count(), 1, "{deviations}");
        assert!(
            matches!(output.status.code(), Some(1 | 7)),
            "{}",
            said(&output)
        );
    }
}

/// The files of a qualification follow from its record.
#[test]
fn an_edited_profile_is_found() {
    let desk = desk("property dlc4 = ignore", ALL);
    let _exit = qualify(&desk);
    ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
    let path = desk.path("kept").join("profile.toml");
    let text = kept(&desk, "profile.toml").replace("dlc4 = ignore", "dlc4 = as3");
    std::fs::write(path, text).expect("room");
    ended(&desk.run(&["verify", "kept"]), 1, "profile.toml");
}
