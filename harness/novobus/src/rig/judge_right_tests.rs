//! Every built-in scenario that a rig of ports can play, on drives that are right and not as the model.

use super::{judged_on, link_of};
use crate::language::read::RingScenario;
use crate::rig::run::Way;
use harness_bench::link::{Capability, LinkEvent, Recording};
use harness_bench::scenario::files::sources;
use harness_bench::scenario::run::lacks;
use harness_bench::scenario::verdict::Verdict::{Inconclusive, Passed};
use std::collections::BTreeSet;

/// Drives that are right and not as the model: other contents, other clocks, other choices; `{k}` is each drive's number.
const RIGHT: [&str; 3] = [
    "\
eeprom 5C = A1 B2 C3 D4
property time-out = 10.2ms
property bus-errors = time-out-only
property self-test-time = 140ms
property eeprom-write-time = 4ms
memory FD8C = 3C*12
memory FDA0 = A5*256
memory FF08 = 01 02
memory FF28 = 33 44
memory FF32 = 74 00 72
memory FF39 = 91 82 73 64 55 46 37 28 19
memory FF44 = 5A*17
memory FF72 = 12 34 56 78
memory FFB7 = 13
",
    // Blocked after a reset, the analogue input sets the speed, the outputs show other things (14.3.1, 14.3.3, 14.3.4).
    "\
eeprom SwVersion = E0
eeprom HwVersion = E8
eeprom HwVersion2 = BF
eeprom EE_pole = 04
property time-out-wait = 10.3ms
property eeprom-read-time = 5ms
memory FE00 = C3*160
memory FF4C = 00 77 00 77
memory FF60 = 00
",
    // Nothing is connected, hot, turned, and errors block.
    "\
property self-test-time = 81ms
eeprom nMax = 2000rpm
eeprom ReversTakt = 77
memory umdrist = 00 05 80 00
memory FE00 = 7E*160
memory FF39 = FF*9
",
];

/// Built-in scenarios that a right drive need not pass, and the sentences of the manual that leave it open.
const OPEN: [(&str, &str); 4] = [
    ("9.1-seven-forms", "14.7.4: GPO1 can be the analogue output"),
    (
        "9.2-address-follows",
        "14.7.4: GPO1 can be the analogue output",
    ),
    ("10.2-read-back", "14.7.4: GPO1 can be the analogue output"),
    (
        "14.10.1-error-mode",
        "11.8: which errors of the bus set bit 5 of Status",
    ),
];

/// Every built-in scenario that a rig of ports can play, on drives that are right and not as the model. It passes, unless the manual leaves
/// open what it asks for, and none fails.
#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn no_right_drive_is_accused() {
    let (played, open) = right_drives(1);
    assert!(played >= 3 * 60, "{played}");
    assert_eq!(
        open.len(),
        OPEN.len(),
        "a row that no drive needs: {open:?}"
    );
}

/// Each scenario on one of these drives.
#[test]
fn no_right_drive_is_accused_in_turn() {
    let (played, _) = right_drives(RIGHT.len());
    assert!(played >= 60, "{played}");
}

/// How many were played, and the rows of [`OPEN`] that were needed. Each scenario is played on one in `share` of the drives.
fn right_drives(share: usize) -> (usize, BTreeSet<&'static str>) {
    let mut other = Vec::new();
    let (mut played, mut open) = (0, BTreeSet::new());
    let sources = sources(&[]).expect("built-in scenarios");
    for (place, source) in sources.into_iter().enumerate() {
        let name = source.name.clone();
        let Ok(RingScenario { plan, .. }) = RingScenario::new(source, None) else {
            continue;
        };
        let [size] = plan.rings[..] else { continue };
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: true,
        };
        let all = RIGHT.iter().enumerate();
        for (number, drives) in all.filter(|(number, _)| (place + number).is_multiple_of(share)) {
            let lines = drives.lines().map(|line| format!("drive 0..last {line}\n"));
            let mut link = link_of(size.drives(), &lines.collect::<String>());
            let mut events: Vec<LinkEvent> = Vec::new();
            let seen = Recording::new(&mut link, &mut events);
            if plan.needs.contains(&Capability::Interposer) || lacks(&plan, &seen).is_some() {
                break;
            }
            played += 1;
            let outcome = judged_on(&mut link, "", (&plan, &way), &|_, _| {});
            let row = OPEN
                .iter()
                .find(|(file, _)| name.ends_with(&format!("/{file}.scn")));
            let is_open = row.is_some() && outcome.verdict == Inconclusive;
            open.extend(row.filter(|_| is_open).map(|(file, _)| *file));
            let right = outcome.verdict == Passed || is_open;
            if !right {
                let message = outcome.finding.map(|found| found.message);
                other.push((
                    name.clone(),
                    number,
                    outcome.verdict,
                    outcome.remarks,
                    message,
                ));
            }
        }
    }
    assert!(other.is_empty(), "{} of {played}: {other:#?}", other.len());
    (played, open)
}
