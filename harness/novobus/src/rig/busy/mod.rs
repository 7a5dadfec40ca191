//! Right drives on a computer that stands still between any two actions: whatever it does, no drive is accused (ND21 9.9, 10.5).

pub(super) mod line;
mod qualified;

use super::run::Run;
use super::session::{Session, at_port};
use crate::guard::safe_state::{SafeConfirmation, safe_state};
use crate::language::read::RingScenario;
use crate::rig::parse;
use crate::simulate::bench;
use harness_bench::guard::{OVERDUE, Standstill};
use harness_bench::link::Line as _;
use harness_bench::rig::{Rig, SessionError, UseOptions};
use harness_bench::scenario::files::sources;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::Span;
use line::{BusyLine, Stalls};

pub(super) fn entry(name: &str, text: String) -> RingScenario {
    let source = Source {
        name: name.to_owned(),
        text: text.into(),
    };
    RingScenario::new(source, None).expect("a scenario")
}

/// The rig's file: a ring of three behind a port.
pub(super) fn rig(more: &str) -> Rig {
    let text = format!(
        "schema = 1\n[rig]\nid = \"busy\"\n[ring.1]\ndrives = 3\ntransport = \"tcp\"\nport = \"127.0.0.1:1\"\n\
         marks = \"in-band\"\ntime_tolerance = \"20ms\"\n[limits]\nallow_motion = true\nallow_eeprom = true\nallow_reset = true\n\
         allow_outputs = true\nallow_monitoring = true\n{more}"
    );
    let source = Source {
        name: "busy.toml".to_owned(),
        text: text.into(),
    };
    parse(&source).expect("a rig")
}

/// Three right drives, set up by these header lines, behind a computer that stands still like this.
pub(super) fn line(drives: &str, stalls: Stalls) -> BusyLine {
    let text = format!("title t\nring 3\ndrive 0..last model nd21\n{drives}\n> 80\n");
    let plan = entry("ring.scn", text).plan;
    let mut ring = bench(&plan);
    ring.run_until(ring.now() + Span::from_millis(500));
    BusyLine::new(ring, stalls)
}

/// A rig with such drives.
pub(super) fn session(rig: &Rig, drives: &str, stalls: Stalls) -> Result<Session, SessionError> {
    let options = UseOptions {
        allow_motion: true,
        ill_as_well: true,
        ..UseOptions::default()
    };
    at_port(rig, &options, Box::new(line(drives, stalls)))
}

/// Plays the built-in scenarios with this in their name, and returns those that accuse a drive. A rig error accuses none.
fn accused(drives: &str, (seed, one_in): (u64, u64), name: &str) -> Vec<String> {
    let rig = rig("");
    let mut session =
        session(&rig, drives, Stalls::new(seed, one_in)).expect("a right ring that opens");
    let mut run = Run::new(&mut session).expect("a run");
    run.repeat();
    let mut accused = Vec::new();
    let mut played = 0;
    for source in sources(&[]).expect("the library") {
        let entry = RingScenario::new(source, Some(3)).ok();
        let Some(entry) = entry.filter(|entry| entry.short_name().contains(name)) else {
            continue;
        };
        let plan = &entry.plan;
        let found = match run.play(plan, None) {
            Ok(found) => found,
            // A line that is disturbed each time it is examined.
            Err(_) if one_in > 0 => break,
            Err(error) => panic!("{}: {error}", entry.short_name()),
        };
        played += found.attempts.len();
        let ill = one_in == 0 && found.outcome.verdict == Verdict::RigError;
        if found.outcome.verdict == Verdict::Failed || ill {
            let remarks = found.outcome.remarks.join("; ");
            accused.push(format!("seed {seed}, {}: {remarks}", entry.short_name()));
        }
    }
    assert!(played > 0, "nothing was played");
    accused
}

/// A computer that stands still for up to half a second at one action of `one_in`.
fn check(drives: &str, seeds: std::ops::Range<u64>, one_in: u64, name: &str) {
    let accused = seeds.flat_map(|seed| accused(drives, (seed, one_in), name));
    assert_eq!(accused.collect::<Vec<_>>(), [] as [String; 0]);
}

/// ND21 8.2: bytes that are read late or sent late are no fault of a drive.
#[test]
fn a_computer_that_stands_still_accuses_no_drive() {
    check("", 1..2, 300, "");
}

/// ND21 9.9: drives that monitor time-outs miss their bytes when the computer stands still, wherever it does.
#[test]
fn a_silence_of_the_bench_accuses_no_drive() {
    check("", 1..3, 60, "9.9-");
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn more_silences_of_the_bench_accuse_no_drive() {
    check("", 3..7, 60, "9.9-");
}

const MONITORS: &str = "drive 0..last eeprom 47 = 80";

/// ND21 14.3.6: the same where the drives' EEPROM switches monitoring on, which the rig's file does not say.
#[test]
fn drives_that_monitor_by_their_eeprom_are_not_accused() {
    check(MONITORS, 1..2, 0, "9.");
    check(MONITORS, 1..2, 1_000, "10.");
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn drives_that_monitor_by_their_eeprom_are_not_accused_in_any_scenario() {
    check(MONITORS, 1..2, 0, "");
    check(MONITORS, 2..3, 1_000, "10.");
}

/// ND21 8.2: what must come a byte for a byte does not come for a PAUSE (9.2), and nothing waits for it behind an attempt.
#[test]
fn nothing_is_awaited_for_a_pause() {
    let rig = rig("");
    let mut session = session(&rig, "", Stalls::new(1, 0)).expect("a right ring that opens");
    let mut run = Run::new(&mut session).expect("a run");
    let entry = entry(
        "pause.scn",
        "title t\nring 3\n> 80 81 81 80\n< 80 80\n".to_owned(),
    );
    let played = run.play(&entry.plan, None);
    let played = played.expect("a healthy ring");
    assert_eq!(played.outcome.verdict, Verdict::Passed);
    let took = run.session().link().now().since_start();
    assert!(took < Span::from_millis(100), "{took}");
}

/// ND21 9.8: the longest run may be over while the rings are examined before a scenario. That attempt is aborted, like one in which it ends.
#[test]
fn the_longest_run_ends_at_an_examination() {
    let rig = rig("");
    let line = Box::new(line("", Stalls::new(1, 0)));
    let mut session = at_port(&rig, &UseOptions::default(), line).expect("a right ring");
    session.link().set_deadline(Some(std::time::Instant::now()));
    let mut run = Run::new(&mut session).expect("a run");
    let entry = entry("a.scn", "title t\nring 3\n> 80\n< 80\n".to_owned());
    let played = run.play(&entry.plan, None);
    let played = played.expect("an attempt");
    assert_eq!(played.outcome.verdict, Verdict::RigError);
    let found = played.outcome.finding.map(|found| found.message);
    assert_eq!(found.as_deref(), Some(OVERDUE));
    assert_eq!(played.attempts.len(), 1);
}

/// A computer that stands still for longer than an answer is awaited has not lost the drives: they reach their safe state.
#[test]
fn a_late_computer_confirms_the_safe_state() {
    let size = RingSize::new(3).expect("a size");
    for drives in ["", "drive 0..last eeprom 47 = 80"] {
        for seed in 1..9 {
            let mut stalls = Stalls::new(seed, 1_000);
            stalls.longest_us = 3_000_000;
            let state = safe_state(&mut line(drives, stalls), &[size], &Standstill::default());
            assert_eq!(
                state,
                SafeConfirmation::Confirmed(vec![size]),
                "seed {seed}, {drives}"
            );
        }
    }
}
