//! Rigs of two rings: a case is with one of them, and the other one stays as it is (ND21 12.2).

use super::{FindingList, about, bounds, scope_of};
use crate::explore::shrink::Subject;
use crate::explore::{
    Case, Finding, FuzzRun, FuzzSettings, OnSim, OtherRing, RingSetup, beside, play,
};
use crate::language::syntax::Header;
use harness_bench::explore::smaller::shrink;
use harness_bench::explore::{Differing as _, FuzzCase as _, LogLine, Planted, Target, by_novelty};
use harness_bench::link::Line as _;
use harness_bench::link::Octets;
use harness_proto::time::Span;

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
    let mut heard = FindingList::default();
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
        let cases = campaign.pool().cases().iter();
        cases.filter(|case| case.ring() == ring).count()
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
    let text = Case::scenario(&found[0], "two rings", None, false).expect("rings");
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
    let line: LogLine<Case> = serde_json::from_str(run).expect("a line");
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
