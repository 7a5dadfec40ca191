//! Fuzz runs on simulated slaves: right ones are never accused, wrong ones are found, shrunk and kept as scenarios.

use crate::BUSES;
use crate::language::Nordac;
use harness_bench::explore::line::trial::EngineTrial;
use harness_bench::rig::find;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::properties::{Choices, PROPERTIES};
use harness_sim::nordac::deviation::DEVIATIONS;
use std::path::Path;

fn trial(ppo: PpoType, header: &[&str]) -> EngineTrial<Nordac> {
    EngineTrial {
        header: header.iter().map(|line| (*line).to_owned()).collect(),
        drive: 8,
        station: (8, ppo),
    }
}

/// A slave that the bus controls, with fast ramps, and with every part that PPO2 shows.
fn usual() -> EngineTrial<Nordac> {
    trial(
        PpoType::Two,
        &[
            "slave 8 ppo 2 posicon",
            "slave 8 parameter 1621 = 3",
            "slave 8 parameter 1504 = 1",
            "slave 8 parameter 1517 = 2",
            "slave 8 parameter 1202 = 10",
            "slave 8 parameter 1203 = 8",
        ],
    )
}

/// Every value of every open point but the default, as header lines.
fn open_points() -> Vec<Vec<String>> {
    let mut all = vec![Vec::new()];
    for property in PROPERTIES {
        let values: Vec<_> = match property.accepts {
            Choices::Words(words) => words.iter().skip(1).map(ToString::to_string).collect(),
            Choices::Count {
                least,
                default,
                most,
            } => [least, default - 1, default + 1, most]
                .iter()
                .filter(|count| **count != default && (least..=most).contains(*count))
                .map(u8::to_string)
                .collect(),
        };
        all.extend(
            values
                .iter()
                .map(|value| vec![format!("slave 8 property {} = {value}", property.name)]),
        );
    }
    all
}

/// Explores right slaves with values of open points, each for a number of seconds of bus time.
fn right_slaves(lines: impl IntoIterator<Item = Vec<String>>, seconds: u64) {
    let factory = trial(PpoType::One, &["slave 8", "slave 8 parameter 1621 = 2"]);
    for line in lines {
        usual().accuses_nobody(&line, 1, seconds);
        factory.accuses_nobody(&line, 2, seconds);
    }
}

/// The defaults, and values of the points that change every reply or the course of every motor.
#[test]
fn no_right_slave_is_accused() {
    let some = [
        "pkw-latency",
        "pzd-latency",
        "pzd-invalid",
        "bit4-ramp",
        "task-new-when",
    ];
    let mut lines = open_points();
    lines.retain(|values| {
        values
            .iter()
            .all(|line| some.iter().any(|name| line.contains(name)))
    });
    assert!(lines.len() > some.len());
    right_slaves(lines, 1);
}

#[test]
#[ignore = "every value of every open point, some minutes; .ci/nightly runs it"]
fn no_right_slave_is_accused_whatever_is_open() {
    right_slaves(open_points(), 60);
}

/// Judged by what comes alone, in virtual time.
#[test]
fn no_right_slave_behind_an_adapter_is_accused() {
    for line in open_points() {
        let rig = find("sim:nordac:1", Path::new(""), &BUSES).expect("a rig");
        EngineTrial::<Nordac>::accuses_nobody_behind_a_port(rig, &line, 15);
    }
}

/// One deviation of each kind: of what a slave reads, of what it hears, and of what it sends.
#[test]
fn wrong_slaves_are_found_and_their_findings_are_scenarios() {
    let some = ["ignores-sap-bits", "no-off3", "answers-without-index"];
    let missed = usual().missed(some.into_iter());
    assert!(missed.is_empty(), "{missed:?}");
}

/// Chance does not bring everything together in ten minutes of bus time.
#[test]
#[ignore = "every wrong slave, some minutes; .ci/nightly runs it"]
fn nearly_all_wrong_slaves_are_found() {
    let missed = usual().missed(DEVIATIONS.all().map(|deviation| deviation.name));
    assert!(missed.len() <= 6, "{missed:?}");
}

#[test]
fn the_same_seed_finds_the_same() {
    let once = || {
        usual()
            .explored(&[], Some("set-not-shown"), 7, 60, 1)
            .findings
    };
    assert_eq!(once(), once());
}
