//! Rigs of two rings: a case is with one of them, and the other one stays as it is (ND21 12.2).

use super::command::{begin_and_kill, drivebench, names, settled};
use super::findings::empty_checkout;
use super::{Heard, about, bounds, scope_of};
use crate::program::{ended, findings, name};
use harness::buses::novobus::explore::scenario;
use harness::buses::novobus::explore::shrink::{Subject, shrink};
use harness::buses::novobus::explore::{
    Case, Finding, FuzzRun, FuzzSettings, LogLine, OnSim, OtherRing, RingSetup, beside, play,
};
use harness::buses::syntax::Header;
use harness::explore::Planted;
use harness::explore::{Target, by_novelty};
use harness::link::Line as _;
use harness::link::Octets;
use harness_proto::time::Span;
use std::path::Path;

fn planted(ring: usize, drive: u8, name: &str) -> RingSetup {
    RingSetup {
        header: Header::default(),
        deviates: vec![Planted {
            ring,
            drive,
            name: name.to_owned(),
        }],
    }
}

/// A run on rings of two and of three drives.
fn explore(setup: &RingSetup, seed: u64, cases: u64) -> (Vec<Finding>, FuzzRun) {
    let about = FuzzSettings {
        rig: "sim:2,3".to_owned(),
        drives: 2,
        second: Some(3),
        ..about(setup, seed)
    };
    let mut campaign = FuzzRun::new(about, scope_of(2, Some(3)));
    let mut heard = Heard::default();
    let mut target = OnSim::new(setup.clone());
    let end = campaign.run(&mut target, None, &bounds(cases, 1), &mut heard);
    end.expect("simulated rings");
    (heard.findings, campaign)
}

/// Sound rings give no finding, and both are spoken to.
#[test]
fn both_rings_are_explored() {
    let (found, campaign) = explore(&RingSetup::default(), 4, 1_500);
    assert_eq!(found, []);
    let of = |ring: usize| {
        let own = campaign.pool().cases().iter();
        own.filter(|case| case.ring() == ring).count()
    };
    let (first, second) = (of(0), of(1));
    assert!(first > 100 && second > 100, "{first} and {second}");
}

/// A deviation of a drive is found in whichever ring it is, blamed on that ring, and made small without the other one.
#[test]
fn a_deviating_drive_of_either_ring() {
    for (ring, drive, blamed) in [(0, 1, "drive 1: "), (1, 2, "drive 2:2: ")] {
        let setup = planted(ring, drive, "writes-ignored");
        let (found, _) = explore(&setup, 2, 5_000);
        let finding = &found[0];
        assert_eq!(finding.case.ring(), ring);
        assert_eq!(finding.case.sizes(), [2, 3]);
        let signature = finding.difference.signature();
        assert!(signature.starts_with(blamed), "{signature}");
        let mut ask = |subject: &Subject| {
            let mut target = OnSim::new(subject.setup.clone());
            let rehearsal = target.rehearse(&subject.case)?;
            Ok(target.attempt(&subject.case, &rehearsal)?.difference)
        };
        let subject = Subject {
            case: finding.case.clone(),
            setup: finding.setup.clone(),
        };
        let small = shrink(subject, finding.difference.clone(), 300, &mut ask).expect("rings");
        assert_eq!(small.subject.case.sizes(), [1]);
        assert_eq!(
            small.subject.setup.with_deviations().lines(),
            ["drive 0 deviates writes-ignored"]
        );
    }
}

/// The scenario of a finding speaks to its ring, of a bench with both.
#[test]
fn the_scenario_names_its_ring() {
    let (found, _) = explore(&planted(1, 2, "writes-ignored"), 2, 5_000);
    let text = scenario(&found[0], "two rings", &[]).expect("rings");
    assert!(text.contains("\nring    2, 3\n"), "{text}");
    assert!(text.contains("\n2> ") && text.contains("\n2< "), "{text}");
    assert!(!text.contains("\n> ") && !text.contains("\n< "), "{text}");
    assert!(
        text.contains("\n# found on drive 2:2 deviates writes-ignored\n"),
        "{text}"
    );
}

/// A byte on the ring that a case is not with is a finding of that ring (ND21 12.2).
#[test]
fn the_other_ring_stays_silent() {
    let (_, campaign) = explore(&RingSetup::default(), 1, 60);
    let case = campaign.pool().cases()[0].clone();
    let mut link = RingSetup::default().model(&case.sizes()).expect("rings");
    play(&mut link, &case);
    assert_eq!(beside(&case, &link), None);
    let other = 1 - case.ring();
    link.send_octets(other, &[0x80]);
    link.run_until(link.now() + Span::from_millis(1));
    let found = beside(&case, &link).expect("a byte");
    assert_eq!((found.ring, &found.section[..]), (other, "12.2"));
}

/// What one ring has shown is no reason to leave it out of the other.
#[test]
fn each_ring_has_its_own_features() {
    let (_, campaign) = explore(&RingSetup::default(), 1, 60);
    let case = campaign.pool().cases()[0].clone();
    let on = |beside| Case {
        beside: Some(beside),
        ..case.clone()
    };
    let mut target = OnSim::new(RingSetup::default());
    let mut with = |case: Case| {
        let rehearsal = target.rehearse(&case).expect("rings");
        (case, rehearsal.features)
    };
    let cases = vec![
        with(on(OtherRing::First(3))),
        with(on(OtherRing::Second(3))),
    ];
    assert_eq!(by_novelty(cases).len(), 2);
}

/// Numbers of drives that no ring has are no case (ND21 8.4), and what was kept before there were two rings is read.
#[test]
fn forms_of_cases() {
    let read = |text: &str| serde_json::from_str::<Case>(text);
    let old = read("{\"drives\":3,\"acts\":[]}").expect("a case");
    assert_eq!((old.ring(), old.sizes()), (0, vec![3]));
    let second = "{\"drives\":3,\"beside\":{\"first\":5},\"acts\":[]}";
    let case = read(second).expect("a case");
    assert_eq!((case.ring(), case.sizes()), (1, vec![5, 3]));
    assert_eq!(serde_json::to_string(&case).expect("a form"), second);
    let planted: Planted =
        serde_json::from_str("{\"drive\":1,\"name\":\"and-is-or\"}").expect("a deviation");
    assert_eq!((planted.ring, planted.drive), (0, 1));
    let run = "{\"kind\":\"run\",\"schema\":1,\"rig\":\"sim:3\",\"drives\":3,\"ports\":false,\"seed\":1,\"confirm\":2,\"of\":3,\
               \"setup\":{\"header\":[],\"deviates\":[]},\"spices\":[]}";
    let line: LogLine = serde_json::from_str(run).expect("a line");
    assert_eq!(line, LogLine::Run(about(&RingSetup::default(), 1)));
    assert_eq!(serde_json::to_string(&line).expect("a form"), run);
    for drives in [0, 251] {
        let case = Case {
            beside: Some(OtherRing::Second(drives)),
            ..old.clone()
        };
        assert!(old.is_bounded() && !case.is_bounded(), "{drives}");
    }
    assert!(read("{\"drives\":3,\"beside\":{\"third\":5},\"acts\":[]}").is_err());
}

/// From a seed to a scenario that is kept, with a drive of ring 2; the page shows it.
#[test]
fn the_commands_on_two_rings() {
    let folder = tempfile::tempdir().expect("a folder");
    let (out, html) = (folder.path().join("run"), folder.path().join("page.html"));
    let output = drivebench(&[
        "fuzz",
        "run",
        "--rig",
        "sim:3,5",
        "--deviates",
        "2:4=and-is-or",
        "--findings",
        "1",
        "--out",
        name(&out),
        "--html",
        name(&html),
    ]);
    ended(&output, 1, "1 found, 0 flaky");
    let page = std::fs::read_to_string(&html).expect("a page");
    assert!(page.contains("drive 2:4 deviates and-is-or"));
    let found = findings(&out);
    let scenario = found[0].with_extension("scn");
    let run = ["run", name(&scenario), "--rig", "sim:3,5"];
    ended(&drivebench(&run), 0, "1 passed");
    let output = drivebench(&["shrink", name(&found[0])]);
    ended(&output, 0, "nothing more can be taken away");
    // Both are promoted: with its ring beside another, and alone.
    let top = folder.path().join("top");
    empty_checkout(&top);
    let stem = found[0].file_stem().and_then(|stem| stem.to_str());
    let small = format!("{}-small.json", stem.expect("a name"));
    let small = found[0].with_file_name(small);
    for (finding, own) in [(&found[0], "two"), (&small, "one")] {
        let promote = [
            "promote",
            name(finding),
            "--name",
            own,
            "--checkout",
            name(&top),
        ];
        ended(
            &drivebench(&promote),
            0,
            "the drives with the finding fail it",
        );
        let kept = top.join(format!("corpora/scenarios/novobus/{own}.scn"));
        ended(&drivebench(&["run", name(&kept)]), 0, "1 passed");
    }
}

/// What was kept on two rings is tried on one, and the other way round.
#[test]
fn what_was_kept_is_replayed_on_other_rings() {
    let folder = tempfile::tempdir().expect("a folder");
    let kept = |rig: &str| {
        let out = folder.path().join(rig.replace([':', ','], "-"));
        let run = ["fuzz", "run", "--cases", "200", "--rig", rig, "--out"];
        let output = drivebench(&[&run[..], &[name(&out)]].concat());
        ended(&output, 0, "200 cases");
        out
    };
    let (two, one) = (kept("sim:2,3"), kept("sim:3"));
    let replay = |folder: &Path, rig: &str| {
        drivebench(&[
            "fuzz",
            "replay",
            name(folder),
            "--wire-time",
            "2s",
            "--rig",
            rig,
        ])
    };
    ended(&replay(&two, "sim:3"), 0, "0 found");
    ended(&replay(&two, "sim:3,3"), 0, "0 found");
    ended(&replay(&one, "sim:3,4"), 0, "0 found");
    ended(
        &replay(&one, "sim:5,4"),
        4,
        "no case for a ring of 5 or of 4",
    );
    // A run goes on with the rig that it began with.
    let record = two.join(harness::explore::RECORD);
    let text = std::fs::read_to_string(&record).expect("a record");
    let other = text.replacen("\"second\":3", "\"second\":4", 1);
    assert_ne!(other, text);
    std::fs::write(&record, other).expect("room");
    let resume = ["fuzz", "run", "--cases", "300", "--resume", name(&two)];
    ended(&drivebench(&resume), 2, "begin another run");
}

/// Killed between two cases a run on two rings goes on, and comes to what an undisturbed one comes to.
#[test]
fn a_killed_run_on_two_rings_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (killed, whole) = (folder.path().join("killed"), folder.path().join("whole"));
    let run = [
        "fuzz",
        "run",
        "--rig",
        "sim:2,3",
        "--deviates",
        "2:1=process-data-ignored",
        "--seed",
        "5",
        "--findings",
        "99",
        "--cases",
        "2000",
        "--out",
    ];
    let undisturbed = drivebench(&[&run[..], &[name(&whole)]].concat());
    ended(&undisturbed, 1, "2000 cases");
    begin_and_kill(&[&run[..], &[name(&killed)]].concat(), &killed);
    let resume = ["fuzz", "run", "--cases", "2000", "--findings", "99"];
    let resumed = drivebench(&[&resume[..], &["--resume", name(&killed)]].concat());
    ended(&resumed, 1, "2000 cases");
    assert_eq!(settled(&killed), settled(&whole));
    assert_eq!(names(&killed), names(&whole));
    assert!(!names(&killed).is_empty());
}
