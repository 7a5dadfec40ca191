//! Evidence of a ring that another process serves, in real time.

use crate::edits::{check, check_each, kept};
use crate::program::{Desk, ended, said};
use crate::ring::Served;
use crate::{drives_on_can, inverters_on_line};
use std::process::Output;

/// The driver's part depends on the time of every look at the port, so the record must hold these.
#[test]
fn untouched_evidence_of_the_driver_verifies() {
    let served = Served::start("nd21", &[3], "tcp", true, &[]);
    let desk = Desk::new(&served.lines(0));
    let played = desk.run(&[
        "run",
        "--rig",
        "desk.toml",
        "--allow-motion",
        "12.2-driver-read-write",
        "11.6-driver-jobs",
        "12.5-driver-eeprom",
        "9.2-synco",
        "9.7-parity-error",
        "--evidence",
        "kept",
    ]);
    assert!(
        matches!(played.status.code(), Some(0 | 5)),
        "{}",
        said(&played)
    );
    ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
}

/// Edits of what was seen at a port.
#[test]
fn of_a_served_ring() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    check_each(&kept(Desk::new(&served.lines(0)), "run", true), 3);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn each_of_a_served_ring() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    check(&kept(Desk::new(&served.lines(0)), "run", true));
}

/// Runs a line of a command on a rig.
type Runs<'a> = &'a dyn Fn(&str) -> Output;

/// The verdicts of a run with wrong drives behind a port are the same with evidence and without, whatever the bus.
#[test]
fn evidence_changes_no_verdict_on_a_port() {
    changes_no_verdict(&[0]);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn evidence_changes_no_verdict_on_other_ports() {
    changes_no_verdict(&[1, 2]);
}

/// On these rigs: a ring, drives on CAN, inverters.
fn changes_no_verdict(rigs: &[usize]) {
    let wrong = ["drive 1 deviates writes-ignored"];
    let served = Served::start_with("nd21", &[2], "tcp", true, &[], &wrong);
    let ring = Desk::new(&served.lines(0));
    let wrong = "drive 1 deviates takes-two-bytes\ndrive 2\n";
    // What it does to a register stays, so the second run has drives of its own.
    let [drives, others] =
        [(); 2].map(|()| drives_on_can::Desk::of("slcan", "allow_motion = true\n", wrong));
    let wrong = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 deviates ignores-fcs\n";
    let inverters = inverters_on_line::Desk::of("tcp", "", wrong);
    let on_ring = |line: &str| ring.run(&line.split(' ').collect::<Vec<_>>());
    let on_line = |line: &str| inverters.run(line);
    let on_can = |line: &str| {
        let drives = if line.contains("kept") {
            &others
        } else {
            &drives
        };
        drives.command(line).output().expect("the program")
    };
    let runs: [(Runs<'_>, &str); 3] = [
        (&on_ring, "10.2-write-byte 9.2-synco"),
        (&on_can, "unitek-5.1-too-short"),
        (&on_line, "nordac-en-1-fcs"),
    ];
    for (run, scenarios) in rigs.iter().map(|rig| runs[*rig]) {
        let line = format!("run {scenarios} --allow-motion --rig desk.toml");
        let without = settled(|_| run(&line));
        let with = settled(|time| run(&format!("{line} --evidence kept{time}")));
        assert_eq!(verdicts(&with), verdicts(&without), "{}", said(&with));
        ended(&without, 1, " failed");
        ended(&with, 1, " failed");
        let verified = run("verify kept0");
        assert!(matches!(verified.status.code(), Some(0 | 5)));
        ended(
            &verified,
            verified.status.code().unwrap_or(1),
            "0 things wrong",
        );
    }
}

/// A computer that stands still makes an attempt inconclusive: the scenarios are then played again, five times at most.
fn settled(run: impl Fn(usize) -> Output) -> Output {
    let runs = (0..5).map(&run);
    let mut left = runs.skip_while(|output| {
        verdicts(output)
            .iter()
            .any(|verdict| verdict.starts_with("inconclusive"))
    });
    left.next().unwrap_or_else(|| run(5))
}

/// The verdict of each scenario, with its name.
fn verdicts(output: &Output) -> Vec<String> {
    let text = String::from_utf8_lossy(&output.stdout);
    let verdicts = ["passed", "failed", "marginal", "inconclusive", "skipped"];
    let of = |line: &str| {
        let mut words = line.split_whitespace();
        let (verdict, name) = (words.next()?, words.next()?);
        verdicts
            .contains(&verdict)
            .then(|| format!("{verdict} {name}"))
    };
    text.lines().filter_map(of).collect()
}
