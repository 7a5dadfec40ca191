//! Scenarios on simulated UNITEK rigs whose drives are not those of the scenarios: nothing is played past the limits, no correct drive is
//! accused, and the record bears every verdict out.

use crate::edits;
use crate::program::{Desk, ended, said};
use std::process::{Command, Output};

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
const NATIVE: &str = "title Native\nsource unitek App 7\nbus unitek\ndrive 1 property map-reply = native\nread 1 40\n";

fn with(desk: &Desk, name: &str, text: &str) {
    std::fs::write(
        desk.path(name),
        text.replace("\nregister", "\ndrive 1 register"),
    )
    .expect("room");
}

/// What a scenario needs follows from its frames; what the rig does not permit is skipped with its reason, and registers of the header are
/// written through the guard and set back.
#[test]
fn what_a_scenario_needs_follows_from_its_frames() {
    let careful = desk("", "");
    with(&careful, "moves.scn", MOVES);
    with(&careful, "locked.scn", LOCKED);
    with(&careful, "mask.scn", MASK);
    with(&careful, "native.scn", NATIVE);
    ended(&run(&careful, &["locked.scn"]), 0, "1 passed");
    ended(&run(&careful, &["mask.scn"]), 0, "1 passed");
    let skipped = run(&careful, &["moves.scn"]);
    ended(&skipped, 2, "needs `allow_motion`");
    ended(
        &skipped,
        2,
        "more scenarios with: `allow_motion` in [limits]",
    );
    ended(&run(&careful, &["native.scn"]), 5, "drive 1 has short");
    ended(
        &run(&careful, &["native.scn", "moves.scn", "--require-all"]),
        2,
        "2 skipped",
    );
    let free = desk("property map-reply = native", ALL);
    with(&free, "moves.scn", MOVES);
    with(&free, "native.scn", NATIVE);
    ended(&run(&free, &["moves.scn", "native.scn"]), 0, "2 passed");
    // Another bus, and drives that the rig does not have.
    ended(
        &run(&free, &["8.2-exchange-1"]),
        4,
        "left out, for other buses than the rig's: 1 scenario",
    );
    let both = run(&free, &["8.2-exchange-1", "moves.scn"]);
    ended(&both, 0, "1 passed, 0 failed (1 scenario");
    assert!(!said(&both).contains("8.2-exchange-1"), "{}", said(&both));
    ended(
        &run(&free, &["unitek-two-drives"]),
        5,
        "the rig has no drive 2",
    );
}

/// A scenario that only waits says nothing of the drives, also with evidence.
#[test]
fn a_scenario_that_only_waits_judges_nothing() {
    let desk = desk("", ALL);
    with(
        &desk,
        "wait.scn",
        "title Wait\nbus unitek\ndrive 1\nwait 5ms\n",
    );
    ended(&run(&desk, &["wait.scn"]), 5, "nothing was judged");
    let kept = run(&desk, &["wait.scn", "--evidence", "kept"]);
    ended(&kept, 5, "nothing was judged");
    ended(&desk.run(&["verify", "kept"]), 0, "1 attempt judged again");
}

/// Scenarios for rings are left out, whatever the sizes of their rings, and the evidence of it is not refused.
#[test]
fn scenarios_of_other_buses_are_left_out_with_evidence() {
    let folder = tempfile::tempdir().expect("a folder");
    let kept = folder.path().join("kept");
    let program = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_drivebench"));
        command.args(arguments).arg(&kept);
        command.output().expect("the program")
    };
    for rig in ["sim:unitek:1", "sim:nordac:2"] {
        let more = ["unitek-ex-2-lock", "9.2-pause", "--rig", rig, "--evidence"];
        let _played = program(&[&["run"], &more[..]].concat());
        ended(&program(&["verify"]), 0, "0 things wrong");
        std::fs::remove_dir_all(&kept).expect("evidence");
    }
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

/// A profile settles what is not permitted to find out, for the run and for its judge. One of other drives is refused, and so is one that the
/// drive contradicts.
#[test]
fn a_profile_is_known() {
    let profile = |drive: &Desk, line: &str| {
        let text = format!(
            "schema = 1\nrig = \"desk\"\ndate = \"\"\nrings = [1]\n[property.own]\nvalue = \"\"\nsection = \"unitek ex 10\"\nsetup = [\"{line}\"]\n"
        );
        std::fs::write(drive.path("profile.toml"), text).expect("room");
        let path = drive.path("desk.toml");
        let rig = std::fs::read_to_string(&path).expect("the rig");
        let rig = rig.replace(
            "id = \"desk\"\n",
            "id = \"desk\"\nprofile = \"profile.toml\"\n",
        );
        std::fs::write(path, rig).expect("room");
    };
    let needs = NATIVE.replace("map-reply = native", "lock-clears-command = yes");
    let desk = |setup| {
        let desk = desk(setup, "");
        with(&desk, "needs.scn", &needs);
        desk
    };
    let unknown = desk("property lock-clears-command = yes");
    ended(&run(&unknown, &["needs.scn"]), 5, "is not settled");
    let known = desk("");
    profile(&known, "drive 1 property lock-clears-command = yes");
    let kept = ["needs.scn", "--evidence", "kept"];
    ended(&run(&known, &kept), 0, "1 passed");
    ended(&known.run(&["verify", "kept"]), 0, "");
    let other = desk("");
    profile(&other, "drive 2 property lock-clears-command = yes");
    ended(
        &run(&other, &["needs.scn"]),
        2,
        "the profile is not of these drives: the port has no drive 2",
    );
    let contradicted = desk("property map-reply = native");
    profile(&contradicted, "drive 1 property map-reply = short");
    let said = "drive 1 has map-reply = native, and the profile of the rig's file says short";
    ended(&run(&contradicted, &["needs.scn"]), 3, said);
}

/// A move releases a locked drive, and bounds its speed as the rig's file says. Without --move nothing is done.
#[test]
fn a_move_releases_a_locked_drive() {
    let locked = "mode position\", \"drive 1 register 51 = 0004";
    for (limits, more) in [
        ("", ""),
        (
            "max_speed = \"10%\"\n",
            "SPEED_LIMIT (34) set to 3277 of 32767",
        ),
    ] {
        let desk = desk(locked, &format!("allow_motion = true\n{limits}"));
        let refused = ["position", "1", "--to", "1turns", "--rig", "desk.toml"];
        ended(&desk.run(&refused), 2, "add --move to allow it");
        let moves = desk.run(&[&refused[..], &["--move"]].concat());
        ended(&moves, 0, "drive 1: released");
        ended(&moves, 0, "drive 1: arrived at 1.000 turns");
        ended(&moves, 0, more);
    }
    let fixed = desk(locked, "");
    let moves = fixed.run(&[
        "position",
        "1",
        "--to",
        "1turns",
        "--move",
        "--rig",
        "desk.toml",
    ]);
    ended(&moves, 2, "`allow_motion`");
}
