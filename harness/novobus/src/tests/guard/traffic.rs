//! Ordinary traffic behind the guard: the driver's functions, and the scenarios of the corpus.

use super::{axis, bus, guarded, link, size};
use crate::driver::{Error, OpenRings, count_drives, recover};
use crate::gate::guard_rings;
use crate::language::read::RingScenario;
use crate::link::BesideTheBus as _;
use crate::link::SimulatedLink;
use crate::simulate::simulated;
use crate::tests::ROOT;
use harness_bench::guard::Guarded;
use harness_bench::link::{
    Capability, Line, Link, LinkFault, Moment, Octets, PlacedFault, Trouble,
};
use harness_bench::scenario::run::run;
use harness_bench::scenario::source::Source;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::ram;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::master::Job;
use harness_proto::novobus::output::{Output, OutputChange};
use harness_proto::time::Span;
use harness_sim::fault::Flips;
use std::path::Path;

const NOTHING: &str = "";

const NO_BYTES: &[u8] = &[];

type Call = fn(&OpenRings<'_>) -> Result<(), Error>;

/// Every function of the driver that writes, and what the denial of it names.
const CALLS: &[(&str, Call, &str)] = &[
    ("state", |bus| bus.state(axis(1)).map(drop), NOTHING),
    ("identity", |bus| bus.identity(axis(1)).map(drop), NOTHING),
    (
        "read_long",
        |bus| bus.read_long(axis(1), ram::N_MAX).map(drop),
        NOTHING,
    ),
    (
        "read_eeprom",
        |bus| bus.read_eeprom(axis(1), 0x20).map(drop),
        NOTHING,
    ),
    ("stop", |bus| bus.stop(axis(1)), NOTHING),
    ("block", |bus| bus.block(axis(1)), NOTHING),
    (
        "nsoll = 0",
        |bus| bus.write_word(axis(1), ram::NSOLL, 0),
        NOTHING,
    ),
    (
        "scope",
        |bus| bus.write_byte(axis(1), ram::SCOPE_STATUS, 0x80),
        NOTHING,
    ),
    ("go", |bus| bus.go(axis(1)), "allow_motion"),
    (
        "nsoll",
        |bus| bus.write_word(axis(1), ram::NSOLL, 1),
        "allow_motion",
    ),
    (
        "delete_error",
        |bus| bus.delete_error(axis(1)),
        "allow_motion",
    ),
    ("reference", |bus| bus.reference(axis(1)), "allow_motion"),
    (
        "set_actual_value",
        |bus| bus.set_actual_value(axis(1), 0),
        "allow_motion",
    ),
    ("init_ps", |bus| bus.init_ps(axis(1)), "allow_motion"),
    (
        "start",
        |bus| bus.or(axis(1), ram::PS_STATUS, 0x10),
        "allow_motion",
    ),
    (
        "teach-in",
        |bus| bus.or(axis(1), ram::FLAGS2, 0x10),
        "allow_eeprom",
    ),
    (
        "write_eeprom",
        |bus| bus.write_eeprom(axis(1), 0x60, 1),
        "allow_eeprom",
    ),
    (
        "ram_to_eeprom",
        |bus| bus.ram_to_eeprom(axis(1)),
        "allow_eeprom",
    ),
    ("reset", |bus| bus.reset(axis(1)), "allow_reset"),
    (
        "write_output",
        |bus| {
            let change = OutputChange {
                output: Output::Gpo1,
                set: true,
            };
            bus.start(axis(1), |drive| Job::new(drive, Command::WriteIo(change)))
                .and_then(|order| bus.result(order))
                .map(|_| ())
        },
        "allow_outputs",
    ),
    (
        "AnOut",
        |bus| bus.write_byte(axis(1), ram::AN_OUT, 8),
        "allow_outputs",
    ),
    (
        "BusAddr",
        |bus| bus.write_byte(axis(1), ram::BUS_ADDR, 0),
        "the manual does not say",
    ),
];

/// With nothing allowed each call either goes through or is denied for the reason that one expects.
#[test]
fn the_driver_s_functions_in_their_classes() {
    for (name, call, needs) in CALLS {
        // Without the error 0504 of a recovery, which some of them would ask for first.
        let mut line = guard_rings(link(2), Limits::default());
        line.assume_fresh();
        let result = {
            let bus = bus(&mut line, 2);
            bus.run(Span::from_millis(300));
            call(&bus)
        };
        match line.trouble() {
            None => {
                assert_eq!(*needs, NOTHING, "{name} was not denied");
                assert_eq!(result, Ok(()), "{name}");
            }
            Some(Trouble::Denied(text)) => {
                assert!(!needs.is_empty() && text.contains(needs), "{name}: {text}");
                assert!(text.contains("drive 1"), "{name}: {text}");
                assert!(result.is_err(), "{name}");
            }
            Some(other) => panic!("{name}: {other}"),
        }
    }
}

/// A drive turns, positions, measures with motion allowed alone.
#[test]
fn motion_alone_is_enough_for_motion() {
    let limits = Limits {
        motion: true,
        max_speed: None,
        ..Limits::default()
    };
    let mut line = guarded(2, limits);
    {
        let bus = bus(&mut line, 2);
        bus.run(Span::from_millis(300));
        let drive = axis(1);
        bus.delete_error(drive).expect("deleted");
        bus.go(drive).expect("gone");
        bus.init_ps(drive).expect("initialised");
        bus.write_ps(
            drive,
            Position::new(PositionMode::Relative, 65_536).expect("a path"),
        )
        .expect("written");
        bus.start_ps(drive).expect("started");
        bus.wait_for_end(drive).expect("there");
        bus.delete_error(drive).expect("deleted");
    }
    assert_eq!(line.trouble(), None);
}

/// The greatest speed holds for whole words, and parts of them do not pass (ND21 14.5.3.1: 0.5298 rpm a bit).
#[test]
fn the_greatest_speed() {
    let limits = Limits {
        motion: true,
        max_speed: Some(1_000),
        ..Limits::default()
    };
    for (bytes, passes) in [
        (&[0x8C, 0xFF, 0x63, 0x5F, 0x07, 0x08, 0xFF, 0xD0][..], true),
        (&[0x8C, 0xFF, 0x63, 0x60, 0x07, 0x08, 0xFF, 0xD1], false),
        (&[0x8C, 0xFF, 0x63, 0xA1, 0xF8, 0x08, 0xFF, 0x03], true),
        (&[0x8C, 0xFF, 0x63, 0xA0, 0xF8, 0x08, 0xFF, 0x02], false),
        (&[0x8A, 0xFF, 0x82, 0x01, 0x09, 0xFF, 0x8B], false),
        (&[0x85, 0xFF, 0x07, 0x5F], true),
        (&[0x85, 0xFF, 0x07, 0x60], false),
    ] {
        let mut line = guarded(1, limits);
        // `DataIn` points at `nsoll`.
        line.send_octets(0, &[0x8A, 0xFF, 0x82, 0x08, 0x32, 0xFF, 0xBB]);
        line.send_octets(0, bytes);
        assert_eq!(
            line.trouble().is_none(),
            passes,
            "{bytes:02X?}: {:?}",
            line.trouble()
        );
    }
}

#[test]
fn counting_and_recovering_pass() {
    let mut line = guarded(3, Limits::default());
    assert_eq!(count_drives(&mut line, 0), Ok(size(3)));
    let flips = Flips {
        data: 1,
        ..Flips::default()
    };
    line.inject(0, PlacedFault::Link(0, LinkFault::Flip(flips)), Moment::Now);
    line.send_octets(
        0,
        &[0x80, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    );
    assert_eq!(recover(&mut line, 0).drives, Some(size(3)));
    assert_eq!(line.trouble(), None);
}

/// Caps of rate and size.
#[test]
fn caps() {
    for (limits, text) in [
        (
            Limits {
                bytes_per_second: Some(60),
                ..Limits::default()
            },
            "within a second",
        ),
        (
            Limits {
                most_bytes: 60,
                ..Limits::default()
            },
            "60 bytes sent; the rig",
        ),
    ] {
        let mut line = guarded(1, limits);
        // 22 bytes were the recovery.
        line.send_octets(0, &[0x80; 38]);
        assert_eq!(line.trouble(), None);
        line.send_octets(0, &[0x80]);
        let trouble = line.trouble().expect("denied").to_string();
        assert!(trouble.contains(text), "{trouble}");
    }
}

/// Nothing passes after a denial but what the recovery is made of.
#[test]
fn after_a_denial() {
    let mut line = guarded(1, Limits::default());
    line.send_octets(0, &[0x88, 0xFF, 0xA4, 0x7E, 0x00, 0x22, 0x80]);
    let text = line.trouble().expect("denied").to_string();
    assert!(
        text.contains("And 7E into FF00 (Status) to drive 0 needs `allow_motion`"),
        "{text}"
    );
    let before = line.carried();
    line.send_octets(0, &[0x80]);
    assert_eq!(line.carried(), before);
    line.reset_after_denial();
    // A SYNCO would stand in the place of the checking byte.
    line.send_octets(0, &[0x80]);
    assert!(line.trouble().is_some());
}

/// ND21 9.9: where time-outs may be monitored, a recovery after a silence waits until 40 ms are over; it may end a telegram that was begun behind
/// the silence too. None is denied.
#[test]
fn a_recovery_behind_a_silence_waits() {
    const TELEGRAM: &[u8] = &[0x88, 0xFF];
    for (monitoring, before, behind, sent_at) in [
        (false, TELEGRAM, NO_BYTES, 15),
        (true, TELEGRAM, NO_BYTES, 40),
        // The wait for the zeros is a silence in the middle of the telegram.
        (true, &[0x80], TELEGRAM, 56),
    ] {
        let limits = Limits {
            monitoring,
            ..Limits::default()
        };
        let mut line = guarded(2, limits);
        let begin = line.send_octets(0, before);
        let silence = begin + Span::from_millis(15);
        while line.now() < silence && line.wait(silence) {}
        line.send_octets(0, behind);
        line.send_octets(0, &CHECK_SEQUENCE);
        let waited = (line.now().since(begin).as_nanos() + 500_000) / 1_000_000;
        line.send_octets(0, &[0x88, 0xFF, 0xC0, 0x17, 0xFE, 0xD5]);
        assert_eq!((waited, line.trouble()), (sent_at, None));
    }
}

/// Faults that change what drives hear need everything.
#[test]
fn faults_that_nobody_can_judge() {
    let even = Flips {
        data: 3,
        ..Flips::default()
    };
    for fault in [
        LinkFault::Replace(0x82),
        LinkFault::Insert(0),
        LinkFault::Drop,
        LinkFault::Duplicate,
        LinkFault::Flip(even),
    ] {
        for at in [0, 1] {
            let mut line = guarded(2, Limits::default());
            line.inject(0, PlacedFault::Link(at, fault), Moment::Now);
            assert!(line.trouble().is_some(), "{fault} on link {at}");
            let mut line = guarded(2, Limits::unlimited());
            line.inject(0, PlacedFault::Link(at, fault), Moment::Now);
            assert_eq!(line.trouble(), None, "{fault} on link {at}");
        }
    }
}

#[test]
fn capabilities_follow_the_limits() {
    let has = |limits| guard_rings(link(1), limits).capabilities().to_vec();
    let denied = [Capability::Motion, Capability::Eeprom, Capability::Reset];
    let none = has(Limits::default());
    assert!(denied.iter().all(|capability| !none.contains(capability)));
    assert_eq!(has(Limits::unlimited()), link(1).capabilities());
    let reset = has(Limits {
        reset: true,
        ..Limits::default()
    });
    assert!(!reset.contains(&Capability::Reset));
}

/// Scenarios that are denied although they need no permission and inject no fault: each deliberately sends bytes
/// whose effect on a machine is not known.
const RUBBISH: &[(&str, &str)] = &[
    (
        "9.2-short-address-first",
        "a short address before any address",
    ),
    (
        "9.2-short-address-kept-sum",
        "a short address before any address",
    ),
    (
        "9.5-every-unknown-command",
        "goes on without a recovery behind bytes that no drive knows",
    ),
    (
        "9.7-first-link-two-errors",
        "goes on without a recovery behind a damaged byte",
    ),
    (
        "9.8-power-cycle",
        "goes on without a recovery behind a drive that was switched on",
    ),
    ("9.8-zero-in-a-sequence", "goes on behind too few zeros"),
    (
        "9.8-zeros-before-the-sequence",
        "goes on behind too few zeros",
    ),
];

/// Every scenario of the corpus that is short enough, behind a guard: its name and what was denied.
fn corpus(limits: Limits) -> Vec<(String, Option<String>)> {
    let folder = Path::new(ROOT).join("corpora/scenarios/novobus");
    let mut found = Vec::new();
    for file in std::fs::read_dir(folder).expect("the corpus") {
        let path = file.expect("readable").path();
        if path.to_string_lossy().contains("-250") {
            continue;
        }
        let source = Source::read(&path).expect("readable");
        let Ok(entry) = RingScenario::new(source, None) else {
            continue;
        };
        let plan = &entry.plan;
        let mut line: Guarded<SimulatedLink> = guard_rings(simulated(plan), limits);
        line.assume_fresh();
        let _verdict = run(plan, &mut line);
        let denied = line.trouble().map(ToString::to_string);
        found.push((entry.short_name().to_owned(), denied));
    }
    found
}

/// With nothing allowed, every denied scenario needs a permission, has a fault that cannot be judged, or is in [`RUBBISH`]; and it ends.
#[test]
fn the_corpus_with_nothing_allowed() {
    let found = corpus(Limits::default());
    let passed = found.iter().filter(|(_, denied)| denied.is_none()).count();
    assert!(passed >= 30, "only {passed} of {} pass", found.len());
    let mut rubbish: Vec<_> = found
        .iter()
        .filter_map(|(name, denied)| denied.as_ref().map(|why| (name.as_str(), why)))
        .filter(|(_, why)| !why.contains("needs `allow_") && !why.contains(": the fault "))
        .collect();
    rubbish.sort_unstable();
    let names: Vec<_> = rubbish.iter().map(|(name, _)| *name).collect();
    let expected: Vec<_> = RUBBISH.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, expected, "{rubbish:#?}");
}

#[test]
fn the_corpus_with_everything_allowed() {
    for (name, denied) in corpus(Limits::unlimited()) {
        assert_eq!(denied, None, "{name}");
    }
}

/// ND21 9.1: a link that was cut is whole again in the next conversation, and drives behind it stand in the middle of a telegram. A part of
/// what is sent to no drive then is a command to one of them.
#[test]
fn a_link_that_was_cut_leaves_drives_in_the_middle_of_a_telegram() {
    let written = |limits| {
        let mut line = guarded(3, limits);
        line.begin();
        let wait = |line: &mut Guarded<_>| {
            let end = line.now() + Span::from_millis(50);
            while line.now() < end && line.wait(end) {}
        };
        line.send_octets(0, &[0x8E, 0x02, 0x80, 0x80, 0x80, 0x80, 0x80]);
        wait(&mut line);
        line.inject(0, PlacedFault::Link(0, LinkFault::Cut), Moment::Now);
        line.send_octets(0, &[0x80, 0x80]);
        wait(&mut line);
        line.begin();
        // WriteByte FE20 = 55 to drive 0, behind the two bytes that its telegram lacks.
        let inside = [0x8E, 0x02, 0x8A, 0xFD, 0x82, 0x55, 0x20, 0xFE, 0xF5];
        line.send_octets(0, &inside);
        wait(&mut line);
        let denied = matches!(line.trouble(), Some(Trouble::Denied(_)));
        (denied, line.peek(0, 0, 0xFE20) == Some(0x55))
    };
    assert_eq!(
        written(Limits::unlimited()),
        (false, true),
        "it is an attack"
    );
    assert_eq!(written(Limits::default()), (true, false));
}
