//! Scenarios on simulated UNITEK rigs whose drives are not those of the scenarios: nothing is played past the limits, no correct drive is
//! accused, and the record bears every verdict out.

use crate::edits;
use crate::program::{Desk, ended, said};
use std::process::Output;

pub(crate) const ALL: &str =
    "allow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\n";

/// A rig with one simulated drive, set up by a line.
pub(crate) fn desk(setup: &str, limits: &str) -> Desk {
    let setup = match setup {
        "" => String::new(),
        line => format!("\"drive 1 {line}\""),
    };
    Desk::of_file(&format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"unitek\"\ndrives = [{{ node = 1 }}]\n\
         [sim]\nbus = \"unitek\"\nsetup = [{setup}]\n[limits]\n{limits}"
    ))
}

fn run(desk: &Desk, more: &[&str]) -> Output {
    let fixed = ["run", "--rig", "desk.toml"];
    desk.run(&[&fixed, more].concat())
}

/// How many scenarios of the built-in ones had each verdict.
fn verdicts(output: &Output, verdict: &str) -> usize {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines = text.lines();
    lines
        .filter(|line| line.starts_with(&format!("{verdict} unitek-")))
        .count()
}

/// Some values of properties, over all built-in scenarios.
#[test]
fn no_correct_drive_is_accused() {
    let values = VALUES.iter().step_by(4);
    not_accused(values.copied());
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn no_correct_drive_of_any_kind_is_accused() {
    not_accused(VALUES.into_iter());
}

/// Each value of each property that is not the default.
const VALUES: [&str; 32] = [
    "map-reply = native",
    "event-reply = as-map-reply",
    "stuff = A5",
    "stuff = FF",
    "dlc4 = ignore",
    "short-write = keep-high",
    "table-full = oldest",
    "cyclic-first = at-once",
    "oneshot-stops = yes",
    "id-change = restart",
    "id-range = printed",
    "event-mask = F811",
    "event-mask = 0030",
    "status-bits = full",
    "unknown-register = silent",
    "can-counters = live",
    "lock-at-power-up = yes",
    "lock-clears-command = yes",
    "power-up-mode = position",
    "reply-delay = 2ms",
    "reply-delay = 15ms",
    "homing-time = 0ms",
    "homing-time = 700ms",
    "homing-time = 3s",
    "wide-replies = zero",
    "interval-accuracy = one-scan",
    "event-edges = rising",
    "event-edges = falling",
    "event-at-set-up = at-once",
    "rate-change = immediate",
    "second-identifiers = immediate",
    "second-identifiers = restart",
];

fn not_accused(values: impl Iterator<Item = &'static str>) {
    for line in values {
        let desk = desk(&format!("property {line}"), ALL);
        let output = run(&desk, &["--filter", "unitek"]);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{line}: {}", said(&output));
        let passed = verdicts(&output, "passed");
        assert!(passed >= 40, "{line}: {passed} passed");
    }
}

/// Registers that a drive does not share with that of the manual.
#[test]
fn a_drive_with_other_parameters_is_not_accused() {
    for line in [
        "register C8 = 07D0",
        "register 34 = 1000",
        "register 35 = 00000000",
        "register DC = 0130",
        "register D4 = FFFFFFFE",
    ] {
        let output = run(&desk(line, ALL), &["--filter", "unitek"]);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{line}: {}", said(&output));
    }
}

#[test]
fn wrong_drives_fail() {
    for wrong in [
        "takes-two-bytes",
        "answers-writes",
        "stop-ends-all-cycles",
        "one-cycle",
        "speed-without-sign",
        "always-four-bytes",
        "cyclic-frames-never-change",
    ] {
        let output = run(
            &desk(&format!("deviates {wrong}"), ALL),
            &["--filter", "unitek"],
        );
        assert_eq!(output.status.code(), Some(1), "{wrong}: {}", said(&output));
    }
}

const LOCKED: &str =
    "title Locked\nsource unitek ex 2\nbus unitek\ndrive 1\nread 1 51 = 0004\nread 1 31 = 0\n";
const MOVES: &str = "title Moves\nsource unitek ex 3\nbus unitek\ndrive 1\n> 201 31 CD 0C\n> 201 3D 31 00\n< 181 31 CD 0C xx\n";
const MASK: &str = "title Mask\nsource unitek ex 10\nbus unitek\ndrive 1\nregister 52 = 00000008\ndrive 1 register 52 = 00000004\n\
                    read 1 52 = 4\n";
const STOP: &str =
    "title Stop\nsource unitek 5.2\nbus unitek\ndrive 1\n> 201 3D 1B FE\n> 201 3D 1B FF\n";
fn with(desk: &Desk, name: &str, text: &str) {
    std::fs::write(
        desk.path(name),
        text.replace("\nregister", "\ndrive 1 register"),
    )
    .expect("room");
}

/// An edit of any line or file is found: the drives are simulated, so that the run can be played again.
#[test]
fn edited_evidence_is_found() {
    let desk = desk("deviates stop-answers", "");
    with(&desk, "stop.scn", STOP);
    with(&desk, "locked.scn", LOCKED);
    with(&desk, "mask.scn", MASK);
    with(&desk, "moves.scn", MOVES);
    let more = [
        "stop.scn",
        "locked.scn",
        "moves.scn",
        "mask.scn",
        "--evidence",
        "kept",
    ];
    ended(&run(&desk, &more), 1, "failed");
    edits::check_each(&edits::of(desk, false), 6);
}
