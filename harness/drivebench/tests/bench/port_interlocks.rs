//! Interlocks on simulated rigs with a port: they disturb no verdict, and where they trip is no accident.

use crate::program::{Desk, ended, said};
use std::process::Output;

/// A rig of one simulated drive, with interlocks.
fn desk(bus: &str, drive: &str, interlocks: &str) -> Desk {
    Desk::of_file(&format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"{bus}\"\ndrives = [{{ {drive} }}]\n[sim]\nbus = \"{bus}\"\n\
         [limits]\nallow_motion = true\n{interlocks}"
    ))
}

/// The verdict on each scenario of a filter, with its name.
fn verdicts(output: &Output) -> Vec<String> {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let words = text.lines().map(|line| line.split_whitespace());
    let named = words.filter_map(|mut own| Some(format!("{} {}", own.next()?, own.next()?)));
    named
        .filter(|own| own.contains("tek-") || own.contains("dac-"))
        .collect()
}

const SPEED: &str = "[[interlock]]\ndrive = 1\nregister = \"SPEED_ACTUAL\"\nmax = \"{}\"\nevery = \"5ms\"\n\
                     [[interlock]]\ndrive = 1\nregister = \"LOGIC_READ_BI\"\nbit = \"RFE\"\nlevel = \"high\"\nevery = \"7ms\"\n";

const ACTUAL: &str = "[[interlock]]\ndrive = 8\nparameter = \"HIW\"\nmax = \"{}\"\n\
                      [[interlock]]\ndrive = 8\nparameter = \"Maximum frequ.\"\nmax = \"900Hz\"\n";

#[test]
fn interlocks_that_hold_disturb_no_verdict() {
    for (bus, drive, filter, interlocks, failing) in [
        ("unitek", "node = 1", "unitek-5.2", SPEED, 5),
        ("unitek", "node = 1", "unitek-ex", SPEED, 0),
        ("nordac", "address = 8", "nordac-3.2", ACTUAL, 0),
    ] {
        let arguments = [
            "run",
            "--rig",
            "desk.toml",
            "--allow-motion",
            "--filter",
            filter,
        ];
        let plain = desk(bus, drive, "").run(&arguments);
        let watched = desk(bus, drive, &interlocks.replace("{}", "190%"));
        let output = watched.run(&[&arguments[..], &["--evidence", "kept"]].concat());
        let differing = |own: &Output| {
            let all = verdicts(own);
            let passed = all.iter().filter(|own| own.starts_with("passed ")).count();
            (
                passed,
                all.iter().filter(|own| own.starts_with("failed ")).count(),
            )
        };
        let [(before, _), (passed, failed)] = [&plain, &output].map(differing);
        assert!(
            passed >= before.max(3) && failed == 0,
            "{filter}: {}",
            said(&output)
        );
        assert!(
            [0, failing].contains(&output.status.code().unwrap_or(-1)),
            "{}",
            said(&output)
        );
        ended(&watched.run(&["verify", "kept"]), 0, "0 things wrong");
    }
}

#[test]
fn one_that_trips_does_so_at_the_same_place_again() {
    for (bus, drive, scenario, interlocks, words) in [
        (
            "unitek",
            "node = 1",
            "title x\nsource unitek ex 3\nbus unitek\ndrive 1\n> 201 31 00 40\nwait 500ms\n",
            SPEED,
            "interlock on SPEED_ACTUAL of drive 1: 2",
        ),
        (
            "nordac",
            "address = 8",
            "title x\nsource nordac 3.2.3\nbus nordac\nslave 8\nslave 8 parameter 1621 = 2\nstart 8 ppo 1\non 8\nfor k in 1..40\n\
             exchange 8 STW=047F HSW=60%\nwait 100ms\nend\n",
            ACTUAL,
            "interlock on HIW of drive 8: 2",
        ),
    ] {
        let limits = match bus {
            "nordac" => "allow_unsupervised = true\n",
            _ => "",
        };
        let interlocks = interlocks.replace("{}", "20%");
        let desk = desk(bus, drive, &format!("{limits}{interlocks}"));
        std::fs::write(desk.path("x.scn"), scenario).expect("room");
        let run = |folder: &str| {
            desk.run(&[
                "run",
                "x.scn",
                "--rig",
                "desk.toml",
                "--allow-motion",
                "--evidence",
                folder,
            ])
        };
        let first = run("first");
        ended(&first, 6, words);
        ended(&first, 6, "at most 20% is required");
        let second = said(&run("second")).replace("evidence in second", "evidence in first");
        assert_eq!(said(&first), second);
        ended(&desk.run(&["verify", "first"]), 0, "0 things wrong");
    }
}
