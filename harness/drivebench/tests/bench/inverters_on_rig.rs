//! Scenarios on simulated rigs of NORDAC inverters that are not those of the scenarios: nothing is played past the limits, no right inverter
//! is accused, and the record bears every verdict out.

use crate::edits;
use crate::program::{Desk, ended, said};
use harness_proto::nordac::properties::{Accepts, Description, PROPERTIES};
use std::process::Output;

const ALL: &str = "allow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\nallow_motor_data = true\n\
                   allow_other_stations = true\nallow_unsupervised = true\n";

/// One inverter.
const ONE: &str = "drives = [{ address = 8, ppo = 1 }]\n";

/// A rig with one simulated inverter, set up by lines.
fn desk(setup: &str, limits: &str) -> Desk {
    at_port(ONE, setup, limits)
}

/// A rig with simulated inverters at a port.
fn at_port(port: &str, setup: &str, limits: &str) -> Desk {
    let setup: Vec<_> = setup
        .lines()
        .map(|line| format!("\"slave 8 {line}\""))
        .collect();
    let setup = setup.join(", ");
    Desk::of_file(&format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"nordac\"\n{port}\
         [sim]\nbus = \"nordac\"\nsetup = [{setup}]\n[limits]\n{limits}"
    ))
}

fn run(desk: &Desk, more: &[&str]) -> Output {
    let fixed = ["run", "--rig", "desk.toml", "--allow-motion"];
    desk.run(&[&fixed, more].concat())
}

/// Right inverters that differ from the model in a point that the manual leaves open, in the scenarios of the process words.
#[test]
fn no_right_inverter_is_accused() {
    not_accused(&[
        "property pzd-invalid = stop",
        "property pzd-latency = 3",
        "parameter 1202 = 1s",
    ]);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn no_other_right_inverter_is_accused() {
    not_accused(&[
        "property bit4-ramp = at-once",
        "property off1-zsw-while-ramping = 3",
        "property zsw8 = only-when-enabled",
        "property zsw11-at-rest = 0",
        "property initial-zsw-4-5 = 0",
        "parameter 1205 = 50.0Hz",
        "parameter 1625 = 1s",
    ]);
}

fn not_accused(lines: &[&str]) {
    for line in lines {
        let output = run(&desk(line, ALL), &["--filter", "nordac-3.2.1-bit"]);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{line}: {}", said(&output));
    }
}

#[test]
fn wrong_inverters_fail() {
    for wrong in ["no-fdl-status", "status-of-a-master"] {
        let desk = desk(&format!("deviates {wrong}"), ALL);
        let output = run(&desk, &["--filter", "nordac-en-1"]);
        assert_eq!(output.status.code(), Some(1), "{wrong}: {}", said(&output));
    }
    // The reply to a telegram that asks for none looks like the reply to the next one.
    for (wrong, scenario) in [
        ("ignores-framing", "nordac-en-1-framing-1"),
        ("ignores-fcs", "nordac-en-1-fcs"),
        ("ignores-end", "nordac-en-1-end"),
        ("ignores-bit-7-of-fc", "nordac-en-1-fc-bit-7"),
        ("answers-broadcasts", "nordac-en-1-other-address"),
        ("answers-the-next-address", "nordac-en-1-other-address"),
    ] {
        let output = run(&desk(&format!("deviates {wrong}"), ALL), &[scenario]);
        ended(&output, 1, "0 passed, 1 failed");
    }
}

const LOOKS: &str = "title Looks\nsource nordac 2.6\nbus nordac\nslave 8\n> 68 05 05 68 88 82 6C 3C 3E F0 16\n\
                     < 68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16\n";
const MOVES: &str = "title Moves\nsource nordac 3.2.1\nbus nordac\nslave 8\nstart 8 ppo 1\non 8\n";
const WRITES: &str =
    "title Writes\nsource nordac 5.1\nbus nordac\nslave 8\nstart 8 ppo 1\nwrite 8 1202 = 3s\n";
const ENDS: &str = "title Ends\nsource nordac 2.6\nbus nordac\nslave 8\nslave 8 parameter 1625 = 1s\nstart 8 ppo 1 watchdog 1s\nread 8 1625\non 8\n";

fn with(desk: &Desk, name: &str, text: &str) {
    std::fs::write(desk.path(name), text).expect("room");
}

/// What a scenario needs follows from its telegrams; what the rig does not permit is skipped, and the limit that it needs is named.
#[test]
fn a_scenario_that_only_waits_judges_nothing() {
    let desk = desk("", "");
    with(
        &desk,
        "wait.scn",
        "title Wait\nbus nordac\nslave 8\nwait 5ms\n",
    );
    ended(&run(&desk, &["wait.scn"]), 5, "nothing was judged");
}

#[test]
fn what_a_scenario_needs_follows_from_its_telegrams() {
    let careful = desk("", "");
    for (name, text) in [
        ("looks.scn", LOOKS),
        ("moves.scn", MOVES),
        ("writes.scn", WRITES),
    ] {
        with(&careful, name, text);
    }
    ended(&run(&careful, &["looks.scn"]), 0, "1 passed");
    ended(&run(&careful, &["moves.scn"]), 2, "needs `allow_motion`");
    ended(&run(&careful, &["writes.scn"]), 2, "needs `allow_eeprom`");
    let stored = desk("", "allow_eeprom = true\n");
    with(&stored, "writes.scn", WRITES);
    ended(
        &run(&stored, &["writes.scn"]),
        2,
        "needs `allow_motor_data`",
    );
    let watched = desk(
        "",
        "allow_motion = true\nallow_eeprom = true\nallow_motor_data = true\n",
    );
    with(&watched, "moves.scn", MOVES);
    with(&watched, "ends.scn", ENDS);
    ended(&run(&watched, &["moves.scn"]), 2, "bus time-out (1625)");
    ended(&run(&watched, &["ends.scn"]), 0, "1 passed");
    let free = desk("", ALL);
    ended(
        &run(&free, &["nordac-en-2-two-slaves"]),
        5,
        "the rig has no slave",
    );
    ended(
        &run(&free, &["8.2-exchange-1"]),
        4,
        "left out, for other buses than the rig's: 1 scenario",
    );
}

/// An edit of any line or file is found: the inverters are simulated, so that the run can be played again. `on_can` has the same for a few.
#[test]
#[ignore = "plays the run again for each edit, some minutes in all; .ci/nightly runs it"]
fn each_edit_of_evidence_is_found() {
    edits::check(&edits::of(edited(), false));
}

fn edited() -> Desk {
    let desk = desk("deviates no-off2", ALL);
    let off2 = "title Off\nsource nordac 3.2.1\nbus nordac\nslave 8\nstart 8 ppo 1\non 8\nexchange 8 STW=047D\nexchange 8 STW=047D -> ZSW=xx60\n";
    with(&desk, "off2.scn", off2);
    with(&desk, "looks.scn", LOOKS);
    let more = ["off2.scn", "looks.scn", "--evidence", "kept"];
    ended(&run(&desk, &more), 1, "1 failed");
    desk
}

/// A rig that may switch the settings of the bus plays scenarios for other interfaces (1621) and PPO types (1622); one that may not names
/// what is missing.
#[test]
fn settings_of_the_bus_are_switched_for_a_scenario() {
    let names = [
        "nordac-3.1-ppo-3",
        "nordac-3.2.4-interface-2",
        "nordac-3.4.1-ak-1",
    ];
    let free = desk("", ALL);
    ended(
        &free.run(&[&["run", "--rig", "desk.toml", "--allow-motion"][..], &names].concat()),
        0,
        "3 passed",
    );
    let fixed = desk("", &ALL.replace("allow_bus_settings = true\n", ""));
    let output =
        fixed.run(&[&["run", "--rig", "desk.toml", "--allow-motion"][..], &names].concat());
    ended(&output, 5, "3 skipped");
    ended(&output, 5, "`allow_bus_settings`");
}

/// A slave that does not get into the exchange, or replies as no right slave does, has failed, and its safe state is not confirmed, as
/// behind a port: it is no error of the rig.
#[test]
fn wrong_replies_are_no_error_of_the_rig() {
    for wrong in [
        "wrong-fcs",
        "ident-low-byte-first",
        "other-configuration",
        "no-end",
        "low-priority-only",
    ] {
        let desk = desk(&format!("deviates {wrong}"), ALL);
        let output = run(&desk, &["nordac-3.1-ppo-1"]);
        ended(&output, 7, "1 failed");
    }
}

/// Qualifies by few scenarios, and by the conversations. Gives the profile and the deviations.
fn qualified(desk: &Desk) -> (Output, String, String) {
    let line = [
        "qualify",
        "--rig",
        "desk.toml",
        "--allow-motion",
        "--evidence",
        "kept",
    ];
    let output = desk.run(&[&line[..], &["--filter", "nordac-en-1-sdn"]].concat());
    let kept =
        |file: &str| std::fs::read_to_string(desk.path("kept").join(file)).unwrap_or_default();
    (output, kept("profile.toml"), kept("deviations.txt"))
}

/// The value of an open point is found, whatever it is, and no right inverter is blamed.
#[test]
fn open_points_are_settled() {
    for (name, value) in [("pzd-invalid", "stop"), ("zsw9", "always")] {
        let (output, profile, deviations) =
            qualified(&desk(&format!("property {name} = {value}"), ALL));
        assert!(
            matches!(output.status.code(), Some(0 | 5)),
            "{name}: {}",
            said(&output)
        );
        let line = format!("slave 8 property {name} = {value}");
        assert!(profile.contains(&line), "{name}: {profile}");
        assert!(deviations.starts_with("deviations: no"), "{deviations}");
    }
    let (output, profile, deviations) = qualified(&desk("", ""));
    assert!(
        matches!(output.status.code(), Some(0 | 5)),
        "{}",
        said(&output)
    );
    assert!(deviations.starts_with("deviations: none;"), "{deviations}");
    for (name, why) in [
        ("pzd-invalid", "allow_motion"),
        ("negative-pwe1", "allow_eeprom"),
        ("967-write", "past the guard"),
    ] {
        let mut lines = profile
            .lines()
            .filter(|line| line.starts_with(&format!("{name} =")));
        assert!(lines.any(|line| line.contains(why)), "{name}: {profile}");
    }
}

/// The values of an open point: every word, or the least, the greatest and the neighbours of the default.
fn values(property: &Description) -> Vec<String> {
    match property.accepts {
        Accepts::Words(words) => words.iter().map(|own| (*own).to_owned()).collect(),
        Accepts::Count {
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
            all.retain(|own| (least..=most).contains(own));
            all.dedup();
            all.iter().map(u8::to_string).collect()
        }
    }
}

/// Qualifies a right inverter with a value of an open point: that value is found, or the point stays open, and nothing is blamed.
fn is_found_or_left_open(name: &str, value: &str) {
    let (output, profile, deviations) =
        qualified(&desk(&format!("property {name} = {value}"), ALL));
    let code = output.status.code();
    let about = format!("{name} = {value}: {}", said(&output));
    assert!(matches!(code, Some(0 | 5)), "{about}");
    assert!(deviations.starts_with("deviations: no"), "{about}");
    let settled = format!("slave 8 property {name} = ");
    let mut lines = profile.split('"').filter(|own| own.starts_with(&settled));
    assert!(
        lines.all(|own| own == format!("{settled}{value}")),
        "{about}{profile}"
    );
    assert!(profile.contains(name), "{about}{profile}");
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
        let mut lines = Vec::new();
        for _ in 0..random.usize(2..=6) {
            let property = open.swap_remove(random.usize(..open.len()));
            let value = random.choice(values(property)).expect("a value");
            lines.push(format!("property {} = {value}", property.name));
        }
        let desk = desk(&lines.join("\n"), ALL);
        let about = format!("seed {seed}, {}", lines.join(", "));
        let output = run(&desk, filter);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{about}: {}", said(&output));
        let (output, _, deviations) = qualified(&desk);
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 5)), "{about}: {}", said(&output));
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
        let port = format!("drives = [{{ address = 8, ppo = {ppo} }}]\n");
        let scenario = format!("nordac-3.1-ppo-{ppo}");
        let output = run(&at_port(&port, "", ALL), &[&scenario]);
        let why = "has no parameter channel: its parameters are not known";
        assert!(said(&output).contains(why), "{}", said(&output));
        assert_eq!(output.status.code(), Some(5), "{}", said(&output));
        let (output, _, deviations) = qualified(&at_port(&port, "", ALL));
        assert_ne!(output.status.code(), Some(1), "{}", said(&output));
        assert!(deviations.starts_with("deviations: no"), "{deviations}");
    }
}

/// Qualifies an inverter with a deviation: it is named, and no other one.
fn named(wrong: &str, section: &str, limits: &str) -> (Desk, String) {
    let desk = desk(&format!("deviates {wrong}"), limits);
    let (output, _, deviations) = qualified(&desk);
    let named = format!("deviation: slave 8: {wrong} (NORDAC {section})");
    assert!(deviations.starts_with(&named), "{deviations}");
    assert_eq!(deviations.matches("deviation: ").count(), 1, "{deviations}");
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    (desk, deviations)
}

/// Deviations that change what every parameter reads, where the slave holds something else than was read of it; and those that ignore something
/// beside those that only do not show it.
#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn more_wrong_inverters_are_named() {
    for (wrong, section) in [
        ("answers-in-pwe1", "3.4.3"),
        ("answers-low-byte-first", "3.4.3"),
        ("values-of-one-more", "3.4.3"),
        ("no-sync", "EN 2"),
        ("hides-sync", "EN 2"),
        ("one-parameter-set", "3.2.1"),
        ("set-not-shown", "3.2.2"),
    ] {
        named(wrong, section, ALL);
    }
}

/// A wrong inverter is named by its deviation and by no other, and the folder bears that out.
#[test]
fn wrong_inverters_are_named() {
    let (desk, deviations) = named("any-ident", "EN 2", "");
    let path = desk.path("kept").join("deviations.txt");
    std::fs::write(path, deviations.replace("any-ident", "no-off3")).expect("room");
    ended(&desk.run(&["verify", "kept"]), 1, "deviations.txt");
}
