//! Whole ND21s without a model beside them: the witnesses find nothing where nothing is wrong, and most of what is.

use super::{FindingList, about, bounds, repeat, scope, seed};
use crate::explore::{Case, Finding, FuzzRun, OnSim, RingSetup, Spice};
use harness_bench::explore::{Differing as _, FuzzCase as _, Planted};

/// A run on three whole drives; nothing knows of the deviation that is hidden in one of them.
fn explore(hidden: Option<(u8, &str)>, seed: u64, cases: u64) -> (Vec<Finding>, u64) {
    let lines = r#"["drive 0..last model nd21", "drive 0..last input GPIN3 GPIN5 high"]"#;
    let sound = RingSetup {
        header: serde_json::from_str(lines).expect("a header"),
        deviates: Vec::new(),
    };
    let setup = match hidden {
        None => sound,
        Some((drive, name)) => sound.hides(&Planted {
            ring: 0,
            drive,
            name: name.to_owned(),
        }),
    };
    let mut scope = scope(3);
    scope.spices = Spice::NAMES.iter().map(|(_, spice)| *spice).collect();
    let mut campaign = FuzzRun::new(about(&setup, seed), scope);
    let mut heard = FindingList::default();
    let mut target = OnSim::new(setup);
    let end = campaign.run(&mut target, None, &bounds(cases, 1), &mut heard);
    end.expect("a simulated ring");
    (heard.findings, campaign.progress().cases)
}

/// Drives as the manual has them give no finding.
#[test]
fn sound_drives_pass() {
    for seed in [1, 2, 3, seed()] {
        let (found, cases) = explore(None, seed, 400);
        if let Some(finding) = found.first() {
            let text = Case::scenario(finding, "a finding", None, false).expect("a ring");
            let again = repeat("sound_drives_pass");
            panic!("seed {seed}: {:#?}\n{text}\n{again}", finding.difference);
        }
        assert_eq!(cases, 400);
    }
}

/// Every rule of a witness has deviations that it finds, blamed on the drive and with the section (`fuzz power --whole` shows all).
#[test]
fn deviating_drives_are_found() {
    for (hidden, rule) in [
        ("passes-pause-on", "9.1, answer"),
        ("checksum-wrong", "9.1, answer"),
        ("position-one-increment-off", "9.1, answer"),
        ("counts-9-zeros", "9.7, error mode"),
        ("checksum-zero-accepted", "9.7, error mode"),
        ("writes-ignored", "10.2, contents of a cell"),
        ("and-is-or", "10.3, contents of a cell"),
        ("outputs-exchanged", "10.4, contents of a cell"),
        ("process-data-in-swapped", "9.4, contents of a cell"),
        ("reset-keeps-parameters", "10.5, contents of a cell"),
        ("reports-parity-as-framing", "14.11.14, contents of a cell"),
        ("next-drive-is-same-drive", "14.2.1, contents of a cell"),
        ("eeprom-not-written", "14.10.5, EEPROM controller"),
        ("forwards-without-delay", "8.2, answer"),
        ("time-out-after-25ms", "9.9, time-out"),
        ("no-zeros-unasked", "9.9, zeros"),
        ("zeros-5ms-after-a-time-out", "9.9, zeros"),
    ] {
        let (found, _) = explore(Some((2, hidden)), 1, 3_000);
        let finding = found.first();
        let finding = finding.unwrap_or_else(|| panic!("{hidden} is not found"));
        let signature = finding.difference.signature();
        let blamed = signature.starts_with("drive 2: ");
        let expected = format!("(ND21 {rule})");
        assert!(
            blamed && signature.ends_with(&expected),
            "{hidden}: {signature}"
        );
    }
}
