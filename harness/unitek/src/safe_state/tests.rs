//! Drives in motion, moved, silent or lost: each ends locked and standing, or the report says that it is not known.

use super::*;
use crate::gate::guarded;
use crate::simulate::{Bench, Setup};
use harness_bench::link::stands_still::StandsStill;
use harness_bench::link::{DriveFault, FrameFault, Link, Moment, PlacedFault};
use harness_bench::medium::Out;
use harness_proto::unitek::guard::Limits;
use harness_proto::unitek::properties::{IdChange, RateChange};
use harness_sim::unitek::deviation::DEVIATIONS;

const PATIENCE: Span = Span::from_millis(20);

fn axes() -> Vec<Axis> {
    let axis = |node: u8| Axis {
        node,
        rx: 0x200 + u16::from(node),
        tx: 0x180 + u16::from(node),
    };
    [1, 2].map(axis).to_vec()
}

fn line(limits: Limits) -> Guarded<Bench> {
    let mut setup = Setup::of(2);
    for drive in &mut setup.drives {
        (drive.inputs.run, drive.inputs.rfe) = (true, true);
    }
    of(&setup, limits)
}

fn of(setup: &Setup, limits: Limits) -> Guarded<Bench> {
    let drives: Vec<_> = setup.drives.iter().map(|drive| drive.identifiers).collect();
    guarded(Bench::new(setup), limits, &drives, false)
}

fn send(line: &mut dyn Line, texts: &[&str]) {
    for text in texts {
        let frame: Frame = text.parse().expect("a frame");
        line.send(0, Out::Frames(&[frame]));
        assert_eq!(line.trouble(), None, "{text}");
        let end = line.now() + Span::from_millis(500);
        while line.now() < end {
            line.wait(end);
        }
        while line.receive(0).is_some() {}
    }
}

fn safe(line: &mut Guarded<Bench>) -> Safe {
    safe_state(line, &axes(), PATIENCE, &Standstill::default(), None)
}

fn registers(line: &Guarded<Bench>, node: u8) -> [u32; 4] {
    let drive = line.inner().drive(node).expect("a drive");
    [0x51, 0x31, 0x90, 0x30].map(|register| drive.register(register))
}

/// From a speed, from a torque and from a position: every drive ends locked and standing.
#[test]
fn drives_in_motion_are_stopped_and_locked() {
    for texts in [
        &["201#31FF7F", "202#3133F3"][..],
        &["201#90FF7F", "202#90AAAA"],
        &["201#6E00000040", "202#780100"],
    ] {
        let mut line = line(Limits::unlimited());
        send(&mut line, texts);
        let safe = safe(&mut line);
        assert!(safe.confirmed, "{safe}");
        for node in [1, 2] {
            assert_eq!(registers(&line, node)[..3], [4, 0, 0], "{texts:?}");
            let drive = line.inner().drive(node).expect("a drive");
            assert_eq!(drive.register(0x40) & status::ENABLED, 0);
        }
    }
}

/// A drive that is locked, and whose motor still coasts, is not safe yet.
#[test]
fn a_motor_that_does_not_stand_is_not_confirmed() {
    let mut line = line(Limits::unlimited());
    send(&mut line, &["201#31FF7F"]);
    let standing = Standstill {
        order: vec![StandstillStep::Block],
        within: Span::from_millis(50),
        ..Standstill::default()
    };
    let coasts = safe_state(&mut line, &axes(), PATIENCE, &standing, None);
    let why = "drive 1: NOT confirmed: waited 50.000 ms for it to stand";
    assert!(coasts.words.contains(why), "{coasts}");
    assert!(!coasts.confirmed);
    assert_eq!(registers(&line, 1)[..3], [4, 0, 0]);
    let stands = safe(&mut line);
    assert!(stands.confirmed, "{stands}");
}

/// A computer that stands still, for longer than drives need to stand, is not taken for a drive that does not.
#[test]
fn a_computer_that_stands_still_accuses_no_drive() {
    for (after, coasts) in (1..12).flat_map(|after| [(after, false), (after, true)]) {
        let mut line = line(Limits::unlimited());
        send(&mut line, &["201#31FF7F"]);
        let standing = Standstill {
            order: vec![StandstillStep::Block],
            within: Span::from_millis(if coasts { 50 } else { 5_000 }),
            ..Standstill::default()
        };
        let span = Span::from_millis(if coasts { 60 } else { 6_000 });
        let line = &mut line;
        let stands = StandsStill { line, after, span };
        let mut driver = Driver::new(Box::new(stands), &axes(), PATIENCE);
        let made = make_safe(&mut driver, axes()[0], &[], &standing);
        assert_eq!(made.is_err(), coasts, "frame {after}: {made:?}");
    }
}

/// Without permission for motion the drives, which another master may have released, are locked first.
#[test]
fn drives_that_may_not_be_commanded_are_locked() {
    let mut line = line(Limits::default());
    let safe = safe(&mut line);
    assert!(safe.confirmed, "{safe}");
    assert_eq!(registers(&line, 1)[..3], [4, 0, 0]);
}

#[test]
fn a_silent_drive_is_not_confirmed_and_the_others_are_locked() {
    let mut line = line(Limits::unlimited());
    send(&mut line, &["202#31FF7F"]);
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let safe = safe(&mut line);
    assert!(!safe.confirmed);
    assert!(
        safe.words
            .contains("drive 1: NOT confirmed: drive 1 does not answer"),
        "{safe}"
    );
    assert!(safe.words.contains("drive 2: ready"), "{safe}");
    assert_eq!(registers(&line, 2)[..3], [4, 0, 0]);
}

/// An adapter that stood still for 1.5 s: the other drive is locked first, then the silent one is asked again.
#[test]
fn a_drive_that_answers_late_is_confirmed() {
    let mut line = line(Limits::unlimited());
    send(&mut line, &["202#31FF7F"]);
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let back = Moment::At(line.now() + Span::from_millis(1_500));
    line.inject(0, PlacedFault::Drive(1, DriveFault::On), back);
    let safe = safe(&mut line);
    assert!(safe.confirmed, "{safe}");
    let trace = line.inner().trace(0);
    let frames = trace.channels[0].frames().iter();
    let texts: Vec<_> = frames.map(|frame| frame.frame.to_string()).collect();
    let first = |text| texts.iter().position(|sent| sent == text);
    let last = texts.iter().rposition(|text| text == "201#510400");
    assert!(first("202#510400") < last, "{texts:?}");
}

/// Cycles that were started are stopped, and identifiers are set back.
#[test]
fn cycles_are_stopped_and_identifiers_set_back() {
    let mut line = line(Limits::unlimited());
    send(&mut line, &["201#3D300A", "201#681002", "210#3D201E"]);
    let safe = safe(&mut line);
    assert!(safe.confirmed, "{safe}");
    let drive = line.inner().drive(1).expect("a drive");
    assert_eq!((drive.register(0x68), drive.register(0x69)), (0x201, 0x181));
    let carried = line.inner().carried();
    let end = line.now() + Span::from_millis(200);
    while line.now() < end {
        line.wait(end);
    }
    assert_eq!(line.inner().carried(), carried);
}

fn identifiers(line: &Guarded<Bench>, node: u8) -> (u32, u32) {
    let drive = line.inner().drive(node).expect("a drive");
    (drive.register(0x68), drive.register(0x69))
}

/// Whichever frame is lost on the way, also one of a scenario's own way back: both drives end on the identifiers of the rig's file,
/// locked (UNITEK 3.1).
#[test]
fn two_drives_are_set_back_whichever_frame_is_lost() {
    let moves = [
        "201#31FF7F",
        "201#687E02",
        "27E#690101",
        "202#687D02",
        "27D#3132F3",
        "27E#698101",
        "27E#680102",
    ];
    for lost in 1..60 {
        let mut line = line(Limits::unlimited());
        let fault = PlacedFault::Frame(FrameFault::Lost);
        line.inject(0, fault, Moment::Byte(lost));
        send(&mut line, &moves);
        let safe = safe(&mut line);
        assert!(safe.confirmed, "frame {lost}: {safe}");
        assert_eq!(identifiers(&line, 1), (0x201, 0x181), "frame {lost}");
        assert_eq!(identifiers(&line, 2), (0x202, 0x182), "frame {lost}");
        for node in [1, 2] {
            assert_eq!(registers(&line, node)[..3], [4, 0, 0], "frame {lost}");
        }
        let gate = line.segment().expect("a gate");
        let moved = gate.places().any(|place| place.has_moved());
        assert!(!moved, "frame {lost}");
    }
}

/// A cycle whose stop a drive has not heard is stopped, whether a scenario or the safe state has sent it (5.2).
#[test]
fn a_cycle_is_stopped_although_its_stop_was_lost() {
    let mut met = 0;
    for texts in [&["201#3D1B64", "201#3D1BFF"][..], &["201#3D1B64"]] {
        for lost in 6..40 {
            let mut line = line(Limits::unlimited());
            let fault = PlacedFault::Frame(FrameFault::Lost);
            line.inject(0, fault, Moment::Byte(lost));
            send(&mut line, texts);
            let safe = safe(&mut line);
            let ended = safe.confirmed && !safe.words.contains("still sent");
            assert!(ended, "{texts:?}, frame {lost}: {safe}");
            let drive = line.inner().drive(1).expect("a drive");
            let running = drive.running_cycles().count();
            assert_eq!(running, 0, "{texts:?}, frame {lost}");
            let trace = line.inner().trace(0);
            let frames = trace.channels[0].frames().iter();
            let stops = frames.filter(|frame| frame.frame.to_string() == "201#3D1BFF");
            met += usize::from(stops.count() == 2);
        }
    }
    assert!(met >= 2, "no stop was lost");
}

/// A new identifier that is used from the next power-up on (`id-change`) is set back in the register.
#[test]
fn an_identifier_that_is_not_used_yet_is_set_back() {
    let mut setup = Setup::of(2);
    setup.drives[0].properties.id_change = IdChange::Restart;
    let mut line = of(&setup, Limits::unlimited());
    send(&mut line, &["201#681002", "201#699001"]);
    assert_eq!(identifiers(&line, 1), (0x210, 0x190));
    let safe = safe(&mut line);
    assert!(safe.confirmed, "{safe}");
    assert_eq!(identifiers(&line, 1), (0x201, 0x181));
}

/// A drive that takes what is meant for another one is found where that one was sent. The two cannot be told apart there: nothing is
/// written that both would obey, and the report has the frame that sets each of them back.
#[test]
fn two_drives_on_one_identifier_are_named() {
    let mut setup = Setup::of(2);
    let wrong = DEVIATIONS
        .all()
        .find(|deviation| deviation.name == "hears-its-neighbour");
    setup.drives[0].deviation = wrong;
    let mut line = of(&setup, Limits::unlimited());
    send(&mut line, &["202#687E02"]);
    let safe = safe(&mut line);
    assert!(!safe.confirmed, "{safe}");
    for words in [
        "but not every one is as it was found",
        "drive 1: ready, STATUS 0, no errors; NOT as it was found: it receives on 27E and sends on 181",
        "with no other drive that receives on 27E on the bus, 27E#680102 sets it back",
        "27E#680202 sets it back",
    ] {
        assert!(safe.words.contains(words), "{words}: {safe}");
    }
    for node in [1, 2] {
        assert_eq!(registers(&line, node)[..3], [4, 0, 0]);
    }
}

/// A drive that uses a new bit rate at once is lost; the report says at which rate it may be, and what brings it back (3.1).
#[test]
fn a_drive_at_another_bit_rate_is_named() {
    let mut setup = Setup::of(2);
    setup.drives[0].properties.rate_change = RateChange::Immediate;
    let mut line = of(&setup, Limits::unlimited());
    send(&mut line, &["201#735C40"]);
    let way = Some("a second adapter");
    let safe = safe_state(&mut line, &axes(), PATIENCE, &Standstill::default(), way);
    assert!(!safe.confirmed, "{safe}");
    for words in [
        "drive 1: NOT confirmed: drive 1 does not answer",
        "it may be at 250 kbit/s, since register 73 (CAN_BTR) was set to 405C: there, 201#732540 sets it back (`bit_rate_way_back`: a \
         second adapter)",
        "drive 2: ready",
    ] {
        assert!(safe.words.contains(words), "{words}: {safe}");
    }
}

#[test]
fn last_words_lock_every_drive() {
    let words: Vec<_> = last_words(&axes()).iter().map(Frame::to_string).collect();
    let one = ["201#510400", "201#310000", "201#900000"];
    assert_eq!(words[..3], one);
    assert_eq!(words.len(), 6);
}
