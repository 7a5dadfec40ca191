//! Fuzz runs on simulated drives: right ones are never accused, wrong ones are found, shrunk and kept as scenarios.

use crate::BUSES;
use crate::language::Unitek;
use harness_bench::explore::line::trial::EngineTrial;
use harness_bench::rig::find;
use harness_proto::unitek::properties::{Accepts, PROPERTIES};
use harness_sim::unitek::deviation::DEVIATIONS;
use std::path::Path;

fn usual() -> EngineTrial<Unitek> {
    EngineTrial {
        header: vec!["drive 1".to_owned()],
        drive: 1,
        station: (1, 0x201),
    }
}

/// Drives with every value of every open point, and both profiles.
fn right_drives() -> Vec<Vec<String>> {
    let mut all = vec![
        vec!["drive 1 profile ds".to_owned()],
        vec!["drive 1 profile fw472".to_owned()],
    ];
    for property in PROPERTIES {
        let values: Vec<_> = match property.accepts {
            Accepts::Words(words) => words.iter().skip(1).map(ToString::to_string).collect(),
            Accepts::Byte => vec!["A5".to_owned()],
            Accepts::TimeUpTo(_) => ["1ms", "7ms", "137ms"].map(str::to_owned).to_vec(),
        };
        let line = |value: String| vec![format!("drive 1 property {} = {value}", property.name)];
        all.extend(values.into_iter().map(line));
    }
    // Several points at a time.
    for (first, second) in [(0, 3), (5, 9), (10, 16), (7, 15)] {
        let two = [first, second].map(|place| &PROPERTIES[place]);
        let lines = two.iter().filter_map(|property| match property.accepts {
            Accepts::Words(words) => {
                Some(format!("drive 1 property {} = {}", property.name, words[1]))
            }
            _ => None,
        });
        all.push(lines.collect());
    }
    all
}

#[test]
fn no_right_drive_is_accused() {
    for header in right_drives() {
        usual().accuses_nobody(&header, 1, 15);
    }
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn no_right_drive_is_accused_in_more_cases() {
    for header in right_drives() {
        usual().accuses_nobody(&header, 1, 60);
    }
}

/// Judged by what comes alone, in virtual time: one right drive of five, each for a number of seconds.
#[test]
fn no_right_drive_behind_an_adapter_is_accused() {
    behind_an_adapter(right_drives().into_iter().step_by(5), 15);
}

#[test]
#[ignore = "a minute; .ci/nightly runs it"]
fn no_right_drive_behind_an_adapter_is_accused_in_more_cases() {
    behind_an_adapter(right_drives(), 120);
}

fn behind_an_adapter(headers: impl IntoIterator<Item = Vec<String>>, seconds: u64) {
    for header in headers {
        let rig = find("sim:unitek:1", Path::new(""), &BUSES).expect("a rig");
        EngineTrial::<Unitek>::accuses_nobody_behind_a_port(rig, &header, seconds);
    }
}

/// Chance does not bring everything together in ten minutes of bus time.
#[test]
fn wrong_drives_are_found_and_their_findings_are_scenarios() {
    let missed = usual().missed(DEVIATIONS.all().step_by(30).map(|deviation| deviation.name));
    assert!(missed.is_empty(), "{missed:?}");
}

#[test]
#[ignore = "a minute; the nightly run plays it"]
fn nearly_all_wrong_drives_are_found() {
    let missed = usual().missed(DEVIATIONS.all().map(|deviation| deviation.name));
    assert!(missed.len() <= 6, "{missed:?}");
}

#[test]
fn the_same_seed_finds_the_same() {
    let once = || {
        usual()
            .explored(&[], Some("four-cycles"), 7, 60, 2)
            .findings
    };
    assert_eq!(once(), once());
}
