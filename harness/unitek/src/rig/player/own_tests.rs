//! Conversations in which no line waits for a frame are judged by what right drives could have sent, in virtual time too.

use super::worlds::{AttemptFrames, Proof};
use super::{KnownDrives, Player, RigScenario};
use crate::BUSES;
use crate::rig::Axis;
use crate::rig::observed::Exchange;
use crate::rig::qualify::conversations;
use harness_bench::qualify::segment::CONVERSATION;
use harness_bench::rig::playing::RigRun as _;
use harness_bench::rig::playing::observed::LinkTimes;
use harness_bench::rig::playing::run::{PortPlayer as _, PortRun};
use harness_bench::rig::{UseOptions, parse};
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::REGISTERS;
use harness_proto::unitek::guard::Limits;
use std::collections::BTreeSet;

/// Conversations, each with a deviation that shows in it.
const WRONG: [(&str, &str); 23] = [
    ("cycle-and-requests", "interval-in-two-milliseconds"),
    ("cycles-and-contents", "cyclic-frames-never-change"),
    ("cycles-of-functions", "interval-in-two-milliseconds"),
    ("eight-cycles", "four-cycles"),
    ("events-each-edge", "event-sends-masked-bits"),
    ("events-of-errors", "no-time-out"),
    ("events-of-the-high-byte", "event-sends-masked-bits"),
    ("homing", "no-homing"),
    ("homing", "never-calibrated"),
    ("homing-by-other-values", "homing-by-any-value"),
    ("long-cycle", "interval-one-more"),
    ("move-both-ways", "position-of-16-bits"),
    ("other-protocols", "interval-in-two-milliseconds"),
    ("speed-by-torque", "torque-of-150-percent"),
    ("speed-on-ramps", "speed-without-sign"),
    ("state-while-turning", "speed-read-without-sign"),
    ("time-out-and-cycles", "no-time-out"),
    ("time-out-and-lock", "no-time-out"),
    ("time-out-and-other-frames", "answers-remote-frames"),
    ("tolerance-at-rest", "always-in-tolerance"),
    ("wide-cycle", "always-four-bytes"),
    ("write-identifier-and-events", "event-sends-the-mask"),
    ("write-identifier-to-send", "interval-in-two-milliseconds"),
];

const AXIS: Axis = Axis {
    node: 1,
    rx: 0x201,
    tx: 0x181,
};

/// What the names of walks have in them.
const WALK: &str = "walk-";

/// The file of a rig with one simulated drive that is set up by lines.
fn desk(setup: &[&str]) -> Source {
    let text = format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"unitek\"\ndrives = [{{ node = 1 }}]\n\
         [sim]\nbus = \"unitek\"\nsetup = {setup:?}\n\
         [limits]\nallow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\n\
         allow_other_identifiers = true\n"
    );
    Source::new("desk.toml", text)
}

fn bench(setup: &[&str]) -> PortRun<Player> {
    let rig = parse(&desk(setup), &BUSES).expect("a rig's file");
    let options = UseOptions {
        allow_motion: true,
        ill_as_well: true,
        ..UseOptions::default()
    };
    PortRun::open(&rig, &options).expect("a simulated drive")
}

fn outcome(run: &mut PortRun<Player>, conversation: &Source) -> Outcome {
    run.play(conversation, None).expect("a rig").outcome
}

/// The conversations that only what right drives send judges, without what the names begin with.
fn by_frames() -> Vec<(String, Source)> {
    let all = conversations(&[AXIS], &Limits::unlimited()).into_iter();
    let kept = all.filter(|source| !source.name.contains(WALK));
    let ours = kept.filter(|source| RigScenario::read(source).expect("a conversation").by_frames);
    let named = ours.map(|source| {
        let name = source.name.strip_prefix(CONVERSATION);
        (name.unwrap_or_default().to_owned(), source)
    });
    named.collect()
}

#[test]
fn wrong_drives_fail_and_right_ones_pass() {
    let all = by_frames();
    let names: BTreeSet<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, WRONG.iter().map(|row| row.0).collect());
    for (name, source) in &all {
        assert_eq!(
            outcome(&mut bench(&[]), source).verdict,
            Verdict::Passed,
            "{name}"
        );
        let wrong = WRONG.iter().filter(|deviation| deviation.0 == name);
        for (_, deviation) in wrong {
            let line = format!("drive 1 deviates {deviation}");
            let outcome = outcome(&mut bench(&[&line]), source);
            assert_eq!(outcome.verdict, Verdict::Failed, "{name}: {deviation}");
        }
    }
}

/// Values that no kept conversation writes show in a walk.
#[test]
fn a_register_that_does_not_hold_each_value_is_found() {
    let all = conversations(&[AXIS], &Limits::unlimited()).into_iter();
    let highest = |source: &Source| source.text.contains("> 201 2C FF FF");
    let walk = all.filter(|source| source.name.contains(WALK) && highest(source));
    let walk: Vec<_> = walk.collect();
    assert!(!walk.is_empty());
    for source in &walk {
        let of = |setup: &[&str]| outcome(&mut bench(setup), source).verdict;
        assert_eq!(of(&[]), Verdict::Passed);
        assert_eq!(
            of(&["drive 1 deviates holds-at-most-1000"]),
            Verdict::Failed
        );
    }
}

/// A drive that had the error of a time-out before is compared with no right one: that nothing was found is not enough for it to pass.
#[test]
fn what_is_not_compared_has_not_passed() {
    let mut bench = bench(&["drive 1 force errors = 8"]);
    let all = by_frames();
    for (name, source) in &all {
        let outcome = outcome(&mut bench, source);
        assert_eq!(outcome.verdict, Verdict::Inconclusive, "{name}");
        let why = outcome.remarks.first().map_or("", String::as_str);
        assert!(
            why.starts_with("what came was not compared to its end"),
            "{name}: {why}"
        );
    }
}

/// A kept scenario.
fn kept(name: &str) -> Source {
    let folder = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../corpora/scenarios/unitek"
    );
    let text = std::fs::read_to_string(format!("{folder}/{name}.scn")).expect("a scenario");
    Source::new(name, text)
}

/// The firmware of the dump is that of one drive: another one is held against what it reads there itself.
#[test]
fn scenarios_are_for_drives_of_any_firmware() {
    let other = "drive 1 register 1B = 0477";
    for name in [
        "4.3-identifier-bits",
        "5.1-lengths",
        "5.2-another-interval",
        "5.2-stop-one-of-two",
        "app-1-remote-frames",
        "app-2-replies",
        "driver-cycles",
        "ex-1-new-identifier",
    ] {
        let source = kept(&format!("unitek-{name}"));
        let right = outcome(&mut bench(&[other]), &source);
        assert_eq!(right.verdict, Verdict::Passed, "{name}: {right:?}");
    }
    let wrong = [other, "drive 1 deviates answers-twice"];
    let wrong = outcome(&mut bench(&wrong), &kept("unitek-app-2-replies"));
    assert_eq!(wrong.verdict, Verdict::Failed, "{wrong:?}");
}

/// A drive whose currents have another scale than that of the dump (D9, App 7) is qualified with what the dump's drive sends all the same: right
/// drives with its registers are compared. A run behind a port skips it.
#[test]
fn drives_with_other_registers_are_qualified_with_the_scenarios_of_the_dump() {
    let rig = parse(&desk(&["drive 1 register D9 = 0200"]), &BUSES).expect("a rig's file");
    let source = kept("unitek-app-5-torque");
    let scenario = RigScenario::read(&source).expect("a scenario");
    let rehearsed = |qualifies, real| {
        let mut player = Player::new(&rig, true, qualifies);
        let mut known = KnownDrives::new(player.axes[0]);
        let dump = REGISTERS.iter().map(|row| (row.number, row.dump));
        known.cells = dump.collect();
        known.cells.insert(0xD9, 0x0200);
        player.known = Some(vec![known]);
        player.rehearsed(&scenario, real).is_ok()
    };
    assert!(rehearsed(true, true));
    assert!(!rehearsed(true, false) && !rehearsed(false, true));
}

/// Behind a port a line that frames have come too late for fails nothing, if right drives are compared in what it asks for. Any other is
/// played again.
#[test]
fn lines_that_worlds_compare_fail_no_right_drive() {
    let rig = parse(&desk(&[]), &BUSES).expect("a rig's file");
    let player = Player::new(&rig, true, true);
    for (lines, foretold, verdict) in [
        ("read 1 30 = 0CFD", false, Verdict::Passed),
        (
            "read 1 30 = 0CFD\nread 1 EB = 0000",
            false,
            Verdict::Inconclusive,
        ),
        // Not all of STATUS is compared.
        ("read 1 40 = 0101", false, Verdict::Inconclusive),
        ("read 1 40 = 0101", true, Verdict::Passed),
    ] {
        let text = format!("title t\nbus unitek\ndrive 1\n\n{lines}\n");
        let source = Source::new("t", text);
        let scenario = RigScenario::read(&source).expect("a scenario");
        let steps = scenario.plan.steps.iter();
        let unmet: Vec<_> = steps.map(|step| step.span.start).collect();
        let known = if foretold { &unmet[..] } else { &[] };
        let outcome = Outcome {
            verdict: Verdict::Failed,
            unmet: unmet.clone(),
            ..Outcome::rig_error(String::new())
        };
        let judged = |unlike: &[(u8, u8)]| {
            let outcome = outcome.clone();
            let judged = player.judged(&scenario, outcome, unlike, known, Proof::Complete);
            judged.verdict
        };
        assert_eq!(judged(&[]), verdict, "{lines}");
        // What a drive reads differently at rest is not compared.
        assert_eq!(judged(&[(1, 0x30), (1, 0x40)]), Verdict::Inconclusive);
    }
}

/// What a drive sends does not follow from what the bench sent where a fault is put on a frame: the attempt is played on right drives again.
#[test]
fn faults_on_frames_accuse_wrong_drives_alone() {
    for fault in ["doubled", "lost", "corrupt", "late"] {
        let source = kept(&format!("unitek-fault-{fault}"));
        for right in ["reply-delay = 2ms", "map-reply = native"] {
            let right = format!("drive 1 property {right}");
            let outcome = outcome(&mut bench(&[&right]), &source);
            assert_ne!(outcome.verdict, Verdict::Failed, "{fault}: {right}");
        }
        let passed = outcome(&mut bench(&[]), &source).verdict;
        assert_eq!(passed, Verdict::Passed, "{fault}");
        let wrong = outcome(&mut bench(&["drive 1 deviates answers-twice"]), &source);
        assert_eq!(wrong.verdict, Verdict::Failed, "{fault}: {wrong:?}");
    }
}

/// An adapter loses a frame of one register or another; a drive that does not send it is silent each time.
#[test]
fn what_is_lost_each_time_accuses() {
    let rig = parse(&desk(&[]), &BUSES).expect("a rig's file");
    let mut player = Player::new(&rig, true, true);
    let (_, source) = by_frames().swap_remove(0);
    let scenario = RigScenario::read(&source).expect("a conversation");
    let lost = |register| Proof::Lost(Some(register), "it has not come".to_owned());
    let wrong = Proof::Wrong("it has not come".to_owned());
    for (shown, expected) in [
        (lost(0x30), lost(0x30)),
        (lost(0x30), lost(0x30)),
        (lost(0x31), lost(0x31)),
        (lost(0x31), lost(0x31)),
        (Proof::Complete, Proof::Complete),
        (lost(0x31), lost(0x31)),
        (lost(0x31), lost(0x31)),
        (lost(0x31), wrong),
    ] {
        assert_eq!(player.lost_again(&scenario, shown), expected);
    }
}

/// A cycle of which a frame holds something else. Where something stood still meanwhile, it accuses the drive where it comes again and again.
#[test]
fn what_comes_after_a_standstill_accuses_no_drive_at_once() {
    let rig = parse(&desk(&[]), &BUSES).expect("a rig's file");
    let mut player = Player::new(&rig, true, true);
    let mut known = KnownDrives::new(player.axes[0]);
    known.cells = REGISTERS.iter().map(|row| (row.number, row.dump)).collect();
    player.known = Some(vec![known]);
    let at = |millis| Instant::START + Span::from_millis(millis);
    let frame = |text: &str| -> Frame { text.parse().expect("a frame") };
    let shown = |gap: u64| {
        let times = [10, 20, 30, 30 + gap, 40 + gap];
        let came = times.map(|time| (at(time), at(time), frame("181#1BD80100")));
        let mut talk = Exchange::default();
        talk.sent = vec![(at(0), frame("201#3D1B0A"))];
        talk.came = came.to_vec();
        talk.read = at(45 + gap);
        talk.came[3].2 = frame("181#1BD90100");
        player.shown(&AttemptFrames {
            talk,
            way: LinkTimes {
                late: Span::ZERO,
                longest: Span::from_millis(2),
                tolerance: Span::from_millis(90),
            },
            unlike: Vec::new(),
            explained: Vec::new(),
            follows: false,
        })
    };
    assert!(matches!(shown(10), Proof::Wrong(_)), "{:?}", shown(10));
    assert!(matches!(shown(100), Proof::Lost(..)), "{:?}", shown(100));
    assert!(matches!(shown(300), Proof::Unknown(_)), "{:?}", shown(300));
}

/// A walk alone finds wrong drives that no line of it describes; a right one passes.
#[test]
fn a_walk_finds_wrong_drives() {
    let rig = parse(&desk(&[]), &BUSES).expect("a rig's file");
    let all = Player::conversations(&rig).into_iter();
    let walks: Vec<_> = all.filter(|source| source.name.contains(WALK)).collect();
    let verdicts = |setup: &[&str]| {
        let mut bench = bench(setup);
        let verdicts = walks.iter().map(|walk| outcome(&mut bench, walk).verdict);
        verdicts.collect::<Vec<_>>()
    };
    let right = verdicts(&[]);
    assert!(
        right.len() > 3 && right.iter().all(|verdict| *verdict == Verdict::Passed),
        "{right:?}"
    );
    for wrong in [
        "enable-inverted",
        "hears-29-bits",
        "ignores-eight-bytes",
        "lock-ends-cycles",
        "speed-read-without-sign",
        "stop-answers",
    ] {
        let all = verdicts(&[&format!("drive 1 deviates {wrong}")]);
        assert!(all.contains(&Verdict::Failed), "{wrong}: {all:?}");
    }
}
