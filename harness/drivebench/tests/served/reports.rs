//! Evidence and reports of runs over ports that ended early.

use crate::junit_rules::wrong;
use crate::program::{Desk, ended, said, verify};
use crate::ring::Served;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

/// Waits until the record says so, whatever the machine is busy with.
#[track_caller]
fn until(evidence: &Path, says: impl Fn(&str) -> bool) {
    let end = Instant::now() + Duration::from_secs(60);
    let record = evidence.join("run.jsonl");
    while !std::fs::read_to_string(&record).is_ok_and(|text| says(&text)) {
        assert!(Instant::now() < end, "it does not begin");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Begins a run with its evidence in `kept`.
fn begun(desk: &Desk, more: &[&str]) -> Child {
    let fixed = ["run", "--rig", "desk.toml", "--evidence", "kept"];
    let mut command = desk.command(&[&fixed, more].concat());
    command.spawn().expect("the program")
}

/// A ring that vanishes: the scenario under way is a rig error.
#[test]
fn a_lost_rig() {
    let mut served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = Desk::new(&served.lines(0));
    let long = "title Long\nsource nd21 9.1\nring 2\n> 80*20\nwait 60s\n";
    std::fs::write(desk.path("long.scn"), long).expect("room");
    let child = begun(&desk, &["long.scn"]);
    let evidence = desk.path("kept");
    // The scenario itself sends its twenty SYNCO.
    until(&evidence, |text| text.contains(&"80".repeat(20)));
    served.child.kill().expect("a process");
    let output = child.wait_with_output().expect("its end");
    assert_eq!(output.status.code(), Some(7), "{}", said(&output));
    let xml = std::fs::read_to_string(evidence.join("junit.xml")).expect("verdicts");
    assert_eq!(wrong(&xml), Vec::<String>::new(), "{xml}");
    assert!(xml.contains("type=\"rig-error\""), "{xml}");
    // It ended in order, and the attempt did not.
    ended(&verify(&evidence), 5, "unfinished");
}

/// ND21 9.1: a run over a port that is killed in the middle keeps what it saw.
#[test]
fn a_killed_run_over_a_port() {
    let served = Served::start("nd21", &[2], "pty", true, &[]);
    let desk = Desk::new(&served.lines(0));
    let mut child = begun(&desk, &["--allow-motion"]);
    let evidence = desk.path("kept");
    until(&evidence, |text| {
        let verdicts = text.lines().filter(|line| line.contains("\"verdict\""));
        verdicts.count() >= 2
    });
    child.kill().expect("a process");
    let _killed = child.wait();
    ended(&verify(&evidence), 5, "");
}
