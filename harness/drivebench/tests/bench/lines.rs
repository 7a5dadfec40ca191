//! Simulated rigs with a port whose drives are not those of the scenarios: no right drive is accused, a wrong one is named, and the record bears
//! every verdict out.

use crate::edits;
use crate::program::{Desk, ended, said};
use harness_proto::nordac::properties::{Choices, NordacProperty, PROPERTIES};
use std::process::Output;

/// Drives of a bus behind a port.
struct Line {
    bus: &'static str,
    /// The drive in `[port.1]`, and in the header of a scenario.
    drive: [&'static str; 2],
    /// Every limit of the bus.
    all: &'static str,
    flags: &'static [&'static str],
    /// The scenarios of a qualification.
    qualified: &'static str,
    /// The codes of a qualification that names a wrong drive.
    named: &'static [i32],
}

const UNITEK: Line = Line {
    bus: "unitek",
    drive: ["node = 1", "drive 1"],
    all: "allow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\n",
    flags: &[],
    qualified: "unitek-ex-2",
    named: &[1, 7],
};

const NORDAC: Line = Line {
    bus: "nordac",
    drive: ["address = 8, ppo = 1", "slave 8"],
    all: "allow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\nallow_motor_data = true\n\
          allow_other_stations = true\nallow_unsupervised = true\n",
    flags: &["--allow-motion"],
    qualified: "nordac-en-1-sdn",
    named: &[1],
};

impl Line {
    /// A rig with one simulated drive, set up by lines.
    fn desk(&self, setup: &[&str], limits: &str) -> Desk {
        self.at_port(self.drive[0], setup, limits)
    }

    fn at_port(&self, port: &str, setup: &[&str], limits: &str) -> Desk {
        let bus = self.bus;
        let setup = setup
            .iter()
            .map(|line| format!("\"{} {line}\"", self.drive[1]));
        let setup = setup.collect::<Vec<_>>().join(", ");
        Desk::of_file(&format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"{bus}\"\ndrives = [{{ {port} }}]\n\
             [sim]\nbus = \"{bus}\"\nsetup = [{setup}]\n[limits]\n{limits}"
        ))
    }

    fn play(&self, desk: &Desk, more: &[&str]) -> Output {
        desk.run(&[&["run", "--rig", "desk.toml"], self.flags, more].concat())
    }

    /// Qualifies by few scenarios, and by the conversations. Gives the profile and the deviations.
    fn qualify(&self, desk: &Desk) -> (Output, String, String) {
        let fixed = ["qualify", "--rig", "desk.toml", "--evidence", "kept"];
        let output = desk.run(&[&fixed, self.flags, &["--filter", self.qualified]].concat());
        let kept =
            |file: &str| std::fs::read_to_string(desk.path("kept").join(file)).unwrap_or_default();
        (output, kept("profile.toml"), kept("deviations.txt"))
    }
}

/// Nothing failed.
#[track_caller]
fn right(output: &Output, about: &str) {
    let code = output.status.code();
    assert!(matches!(code, Some(0 | 5)), "{about}: {}", said(output));
}

/// Each value of each property of UNITEK drives that is not the default.
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

/// Registers and parameters that a drive does not share with that of the manual, and some values of points that it leaves open.
#[test]
fn no_right_drive_is_accused() {
    for value in VALUES.iter().step_by(4) {
        not_accused(&UNITEK, "unitek", &format!("property {value}"), 40);
    }
    for register in [
        "C8 = 07D0",
        "34 = 1000",
        "35 = 00000000",
        "DC = 0130",
        "D4 = FFFFFFFE",
    ] {
        not_accused(&UNITEK, "unitek", &format!("register {register}"), 0);
    }
    for line in [
        "property pzd-invalid = stop",
        "property pzd-latency = 3",
        "parameter 1202 = 1s",
    ] {
        not_accused(&NORDAC, "nordac-3.2.1-bit", line, 0);
    }
}

#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn no_right_drive_of_any_kind_is_accused() {
    for value in VALUES {
        not_accused(&UNITEK, "unitek", &format!("property {value}"), 40);
    }
    for line in [
        "property bit4-ramp = at-once",
        "property off1-zsw-while-ramping = 3",
        "property zsw8 = only-when-enabled",
        "property zsw11-at-rest = 0",
        "property initial-zsw-4-5 = 0",
        "parameter 1205 = 50.0Hz",
        "parameter 1625 = 1s",
    ] {
        not_accused(&NORDAC, "nordac-3.2.1-bit", line, 0);
    }
}

fn not_accused(line: &Line, filter: &str, setup: &str, least: usize) {
    let output = line.play(&line.desk(&[setup], line.all), &["--filter", filter]);
    right(&output, setup);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let begin = format!("passed {}-", line.bus);
    let passed = text.lines().filter(|row| row.starts_with(&begin)).count();
    assert!(passed >= least, "{setup}: {passed} passed");
}

/// An edit of any line or file is found: the drives are simulated, so that the run can be played again.
#[test]
fn edited_evidence_is_found() {
    let locked =
        "title Locked\nsource unitek ex 2\nbus unitek\ndrive 1\nread 1 51 = 0004\nread 1 31 = 0\n";
    let moves = "title Moves\nsource unitek ex 3\nbus unitek\ndrive 1\n> 201 31 CD 0C\n> 201 3D 31 00\n< 181 31 CD 0C xx\n";
    let mask = "title Mask\nsource unitek ex 10\nbus unitek\ndrive 1\ndrive 1 register 52 = 00000008\ndrive 1 register 52 = 00000004\n\
                read 1 52 = 4\n";
    let stop =
        "title Stop\nsource unitek 5.2\nbus unitek\ndrive 1\n> 201 3D 1B FE\n> 201 3D 1B FF\n";
    let scenarios = [
        ("stop.scn", stop),
        ("locked.scn", locked),
        ("moves.scn", moves),
        ("mask.scn", mask),
    ];
    let kept = kept(&UNITEK, "deviates stop-answers", "", &scenarios);
    edits::check_each(&kept, 6);
}

#[test]
#[ignore = "plays the run again for each edit, some minutes in all; .ci/nightly runs it"]
fn each_edit_of_evidence_is_found() {
    let off2 = "title Off\nsource nordac 3.2.1\nbus nordac\nslave 8\nstart 8 ppo 1\non 8\nexchange 8 STW=047D\nexchange 8 STW=047D -> ZSW=xx60\n";
    let looks = "title Looks\nsource nordac 2.6\nbus nordac\nslave 8\n> 68 05 05 68 88 82 6C 3C 3E F0 16\n\
                 < 68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16\n";
    let scenarios = [("off2.scn", off2), ("looks.scn", looks)];
    edits::check(&kept(&NORDAC, "deviates no-off2", NORDAC.all, &scenarios));
}

/// The evidence of scenarios of which a drive fails one.
fn kept(line: &Line, setup: &str, limits: &str, scenarios: &[(&str, &str)]) -> edits::Kept {
    let desk = line.desk(&[setup], limits);
    for (name, text) in scenarios {
        std::fs::write(desk.path(name), text).expect("room");
    }
    let names = scenarios.iter().map(|(name, _)| *name);
    let more: Vec<_> = names.chain(["--evidence", "kept"]).collect();
    ended(&line.play(&desk, &more), 1, "1 failed");
    edits::of(desk, false)
}

/// The value of an open point is found, whatever it is, and no right drive is blamed.
#[test]
fn open_points_are_settled() {
    for (line, name, value) in [
        (&UNITEK, "lock-clears-command", "yes"),
        (&UNITEK, "id-change", "restart"),
        (&UNITEK, "id-range", "printed"),
        (&UNITEK, "event-reply", "as-map-reply"),
        (&UNITEK, "homing-time", "700ms"),
        (&UNITEK, "dlc4", "ignore"),
        (&UNITEK, "wide-replies", "zero"),
        (&UNITEK, "interval-accuracy", "one-scan"),
        (&UNITEK, "event-edges", "rising"),
        (&UNITEK, "event-edges", "falling"),
        (&UNITEK, "event-at-set-up", "at-once"),
        (&UNITEK, "second-identifiers", "immediate"),
        (&UNITEK, "time-out-clear", "lock"),
        (&UNITEK, "enable-after-lock", "yes"),
        (&NORDAC, "pzd-invalid", "stop"),
        (&NORDAC, "zsw9", "always"),
    ] {
        let setup = format!("property {name} = {value}");
        let (output, profile, deviations) = line.qualify(&line.desk(&[&setup], line.all));
        right(&output, name);
        let setup = format!("{} {setup}", line.drive[1]);
        assert!(profile.contains(&setup), "{name}: {profile}");
        assert!(deviations.starts_with("deviations: no"), "{deviations}");
    }
}

/// A probe that is not permitted leaves its point open, and the profile says what is missing.
#[test]
fn what_is_not_permitted_stays_open() {
    let settled = [
        "event-edges = both",
        "event-reply = native",
        "interval-accuracy = exact",
    ];
    let missing = [
        ("homing-time", "allow_motion"),
        ("id-change", "allow_bus_settings"),
        ("power-up-mode", "it shows when the drive is switched on"),
        ("wide-replies", "allow_bus_settings"),
        ("second-identifiers", "allow_bus_settings"),
        ("rate-change", "an adapter with another bit rate"),
    ];
    stays_open(&UNITEK, &settled, &missing);
    let missing = [
        ("pzd-invalid", "allow_motion"),
        ("negative-pwe1", "allow_eeprom"),
        ("967-write", "past the guard"),
    ];
    stays_open(&NORDAC, &[], &missing);
}

fn stays_open(line: &Line, settled: &[&str], missing: &[(&str, &str)]) {
    let (output, profile, deviations) = line.qualify(&line.desk(&[], ""));
    right(&output, line.bus);
    assert!(deviations.starts_with("deviations: none;"), "{deviations}");
    for point in settled {
        assert!(profile.contains(point), "{point}: {profile}");
    }
    for (name, why) in missing {
        let begin = format!("{name} =");
        let mut rows = profile.lines().filter(|row| row.starts_with(&begin));
        assert!(rows.any(|row| row.contains(why)), "{name}: {profile}");
    }
}

/// A wrong drive is named by its deviation and by no other, and the folder bears that out.
#[test]
fn wrong_drives_are_named() {
    named(&UNITEK, "no-lock", "", UNITEK.all);
    let desk = named(&NORDAC, "any-ident", "EN 2)", "");
    edited(&desk, "deviations.txt", "any-ident", "no-off3");
}

/// Deviations that change what every parameter reads, where the slave holds something else than was read of it; and those that ignore something
/// beside those that only do not show it.
#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn more_wrong_drives_are_named() {
    for (line, wrong, section) in [
        (&UNITEK, "names-read", ""),
        (&UNITEK, "ramps-swapped", ""),
        (&UNITEK, "stop-answers", ""),
        (&UNITEK, "errors-stay", ""),
        (&NORDAC, "answers-in-pwe1", "3.4.3)"),
        (&NORDAC, "answers-low-byte-first", "3.4.3)"),
        (&NORDAC, "values-of-one-more", "3.4.3)"),
        (&NORDAC, "no-sync", "EN 2)"),
        (&NORDAC, "hides-sync", "EN 2)"),
        (&NORDAC, "one-parameter-set", "3.2.1)"),
        (&NORDAC, "set-not-shown", "3.2.2)"),
    ] {
        named(line, wrong, section, line.all);
    }
}

/// Qualifies a drive with a deviation of a section of its manual.
fn named(line: &Line, wrong: &str, section: &str, limits: &str) -> Desk {
    let desk = line.desk(&[&format!("deviates {wrong}")], limits);
    let (output, _, deviations) = line.qualify(&desk);
    let bus = line.bus.to_uppercase();
    let named = format!("deviation: {}: {wrong} ({bus} {section}", line.drive[1]);
    assert!(deviations.starts_with(&named), "{wrong}: {deviations}");
    assert_eq!(deviations.matches("deviation: ").count(), 1, "{deviations}");
    let code = output.status.code().unwrap_or_default();
    assert!(line.named.contains(&code), "{}", said(&output));
    desk
}

/// The files of a qualification follow from its record.
#[test]
fn an_edited_profile_is_found() {
    let desk = UNITEK.desk(&["property dlc4 = ignore"], UNITEK.all);
    let _exit = UNITEK.qualify(&desk);
    ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
    edited(&desk, "profile.toml", "dlc4 = ignore", "dlc4 = as3");
}

/// An edit of a file of a qualification is found.
fn edited(desk: &Desk, file: &str, from: &str, to: &str) {
    let path = desk.path("kept").join(file);
    let text = std::fs::read_to_string(&path).expect("a file of the folder");
    std::fs::write(path, text.replace(from, to)).expect("room");
    ended(&desk.run(&["verify", "kept"]), 1, file);
}

/// The values of an open point: every word, or the least, the greatest and the neighbours of the default.
fn values(property: &NordacProperty) -> Vec<String> {
    match property.accepts {
        Choices::Words(words) => words.iter().map(|word| (*word).to_owned()).collect(),
        Choices::Count {
            least,
            default,
            most,
        } => {
            let mut all = vec![
                least,
                default.saturating_sub(1),
                default,
                default.saturating_add(1),
                most,
            ];
            all.retain(|count| (least..=most).contains(count));
            all.dedup();
            all.iter().map(u8::to_string).collect()
        }
    }
}

/// Qualifies a right inverter with a value of an open point: that value is found, or the point stays open, and nothing is blamed.
fn is_found_or_left_open(name: &str, value: &str) {
    let setup = format!("property {name} = {value}");
    let (output, profile, deviations) = NORDAC.qualify(&NORDAC.desk(&[&setup], NORDAC.all));
    right(&output, &setup);
    assert!(
        deviations.starts_with("deviations: no"),
        "{setup}: {deviations}"
    );
    let settled = format!("slave 8 property {name} = ");
    let mut rows = profile.split('"').filter(|row| row.starts_with(&settled));
    let found = rows.all(|row| row == format!("{settled}{value}"));
    assert!(found && profile.contains(name), "{setup}: {profile}");
}

#[test]
fn values_of_open_points_are_found_or_left_open() {
    is_found_or_left_open("subindex-bits", "7..15");
}

#[test]
#[ignore = "every value of every open point, some minutes; .ci/nightly runs it"]
fn every_value_of_an_open_point_is_found_or_left_open() {
    for property in PROPERTIES {
        for value in values(property) {
            is_found_or_left_open(property.name, &value);
        }
    }
}

/// Right inverters with values of 2 to 6 open points each, chosen by seeds: `run` and `qualify` blame none of them.
fn none_is_blamed(seeds: std::ops::Range<u64>, filter: &[&str]) {
    for seed in seeds {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut open: Vec<_> = PROPERTIES.iter().collect();
        let mut setup = Vec::new();
        for _ in 0..random.usize(2..=6) {
            let property = open.swap_remove(random.usize(..open.len()));
            let value = random.choice(values(property)).expect("a value");
            setup.push(format!("property {} = {value}", property.name));
        }
        let about = format!("seed {seed}, {}", setup.join(", "));
        let setup: Vec<_> = setup.iter().map(String::as_str).collect();
        let desk = NORDAC.desk(&setup, NORDAC.all);
        right(&NORDAC.play(&desk, filter), &about);
        let (output, _, deviations) = NORDAC.qualify(&desk);
        right(&output, &about);
        assert!(
            deviations.starts_with("deviations: no"),
            "{about}: {deviations}"
        );
    }
}

#[test]
fn right_inverters_that_differ_in_several_points_are_not_blamed() {
    none_is_blamed(0..1, &["--filter", "nordac-3.2.1-bit"]);
}

#[test]
#[ignore = "forty inverters with every scenario, some minutes; .ci/nightly runs it"]
fn no_right_inverter_that_differs_in_several_points_is_blamed() {
    none_is_blamed(1..41, &[]);
}

/// What an inverter without a parameter channel sends follows from parameters that are not known: a right one is not accused.
#[test]
fn an_inverter_that_cannot_be_read_is_not_accused() {
    for ppo in [3, 4] {
        let port = format!("address = 8, ppo = {ppo}");
        let desk = || NORDAC.at_port(&port, &[], NORDAC.all);
        let output = NORDAC.play(&desk(), &[&format!("nordac-3.1-ppo-{ppo}")]);
        let why = "has no parameter channel: its parameters are not known";
        ended(&output, 5, why);
        let (output, _, deviations) = NORDAC.qualify(&desk());
        assert_ne!(output.status.code(), Some(1), "{}", said(&output));
        assert!(deviations.starts_with("deviations: no"), "{deviations}");
    }
}
