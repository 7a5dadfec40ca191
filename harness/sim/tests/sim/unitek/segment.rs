//! The segment: arbitration, exact times, faults, error counters (ISO 11898-1).

use super::common::Desk;
use harness_proto::can::{BitRate, CanError, CanEvent, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Properties;
use harness_sim::record::FrameEnd;
use harness_sim::segment::{FrameFault, Host, Placed, Segment};
use harness_sim::unitek::{Drive, Inputs};

fn frame(text: &str) -> Frame {
    text.parse().expect("a frame")
}

fn at(micros: u64) -> Instant {
    Instant::START + Span::from_micros(micros)
}

fn hosts(count: usize) -> Segment<Host> {
    Segment::new(BitRate::K500, vec![Host::default(); count])
}

fn heard(host: &mut Host) -> Vec<String> {
    std::iter::from_fn(|| host.receive())
        .map(|(_, what)| match what {
            CanEvent::Frame(frame) => frame.to_string(),
            CanEvent::Error(error) => error.to_string(),
        })
        .collect()
}

/// The lowest identifier goes first, whichever station was ready first; others follow without a gap.
#[test]
fn arbitration() {
    let mut segment = hosts(4);
    for (place, text) in [(0, "201#3D4000"), (1, "181#40810100"), (2, "181#R")] {
        segment.station_mut(place).send(at(10), frame(text));
    }
    segment.run_until(at(5_000));
    let order: Vec<_> = segment
        .record()
        .iter()
        .map(|f| f.frame.to_string())
        .collect();
    assert_eq!(order, ["181#40810100", "181#R", "201#3D4000"]);
    assert_eq!(heard(segment.station_mut(3)), order);
    let mut start = at(10);
    for line in segment.record() {
        assert_eq!(line.start, start);
        assert_eq!(
            line.at + BitRate::K500.time_of(3),
            start + BitRate::K500.time_of(line.frame.wire_bits())
        );
        start = line.at + BitRate::K500.time_of(3);
    }
}

/// A frame that is ready while another one is on the wire waits for its end; one bit time later it would have been first.
#[test]
fn no_frame_interrupts_another() {
    let mut segment = hosts(3);
    segment.station_mut(0).send(at(0), frame("7FF#00"));
    segment.station_mut(1).send(at(2), frame("000#00"));
    segment.run_until(at(5_000));
    let order: Vec<_> = segment
        .record()
        .iter()
        .map(|f| f.frame.to_string())
        .collect();
    assert_eq!(order, ["7FF#00", "000#00"]);
}

/// Alone on the bus a station repeats its frame, becomes passive and never goes to bus-off.
#[test]
fn without_acknowledge() {
    let mut segment = hosts(1);
    segment.station_mut(0).send(at(0), frame("201#3D4000"));
    segment.run_until(at(50_000));
    let ends: Vec<_> = segment.record().iter().map(|f| f.ended).collect();
    assert!(ends.len() > 200, "{}", ends.len());
    assert!(
        ends.iter()
            .all(|end| *end == FrameEnd::Error(CanError::NoAcknowledge))
    );
    assert!(!segment.is_off(0));
    // 66 bits to the acknowledge slot, 17 of the error frame; passive, 8 more.
    let gap = |n: usize| {
        segment.record()[n + 1]
            .start
            .since(segment.record()[n].start)
    };
    let bits = frame("201#3D4000").bits_to_acknowledge() - 1 + 17;
    assert_eq!(gap(0), BitRate::K500.time_of(bits));
    assert_eq!(gap(100), BitRate::K500.time_of(bits + 8));
    assert_eq!(heard(segment.station_mut(0)), ["no-acknowledge"]);
    // A listener acknowledges nothing either.
    let mut silent = Segment::new(BitRate::K500, vec![Host::default(), Host::listener()]);
    silent.station_mut(0).send(at(0), frame("201#3D4000"));
    silent.run_until(at(1_000));
    assert!(silent.record().len() > 3);
    assert_eq!(heard(silent.station_mut(1)), [""; 0]);
}

/// Two stations with one identifier: equal frames are one frame, different ones destroy each other until both are bus-off.
#[test]
fn equal_identifiers() {
    let mut equal = hosts(3);
    for place in [0, 1] {
        equal.station_mut(place).send(at(0), frame("181#40810100"));
    }
    equal.run_until(at(5_000));
    assert_eq!(equal.record().len(), 1);
    assert_eq!(heard(equal.station_mut(2)), ["181#40810100"]);
    assert_eq!(
        (heard(equal.station_mut(0)), equal.station(0).waiting()),
        (Vec::new(), 0)
    );

    let mut different = hosts(3);
    different.station_mut(0).send(at(0), frame("181#40810100"));
    different.station_mut(1).send(at(0), frame("181#40000100"));
    different.run_until(at(20_000));
    assert_eq!(different.record().len(), 32);
    assert!(different.is_off(0) && different.is_off(1) && !different.is_off(2));
    assert_eq!(heard(different.station_mut(2)), ["error-frame"]);
    assert_eq!(heard(different.station_mut(0)), ["error-frame", "bus-off"]);
    different.restart(0);
    different.run_until(at(30_000));
    assert_eq!(heard(different.station_mut(2)), ["181#40810100"]);
}

/// Every fault, on the second frame of station 0: what the others hear.
#[test]
fn faults() {
    for (fault, expected, frames) in [
        (FrameFault::Lost, &["100#01", "100#03"][..], 3),
        (
            FrameFault::Doubled,
            &["100#01", "100#02", "100#02", "100#03"],
            4,
        ),
        (
            FrameFault::Corrupt,
            &["100#01", "error-frame", "100#02", "100#03"],
            4,
        ),
        (
            FrameFault::NoAcknowledge,
            &["100#01", "100#02", "100#03"],
            4,
        ),
        (FrameFault::BusOff, &["100#01", "error-frame"], 2),
        (
            FrameFault::Late(Span::from_millis(3)),
            &["100#01", "200#00", "100#02", "100#03"],
            4,
        ),
    ] {
        let mut segment = hosts(3);
        for byte in 1..=3 {
            segment
                .station_mut(0)
                .send(at(0), frame(&format!("100#0{byte}")));
        }
        if matches!(fault, FrameFault::Late(_)) {
            segment.station_mut(1).send(at(1_000), frame("200#00"));
        }
        segment.inject(Placed {
            station: Some(0),
            frame: 2,
            fault,
        });
        segment.run_until(at(10_000));
        assert_eq!(heard(segment.station_mut(2)), expected, "{fault:?}");
        assert_eq!(segment.record().len(), frames, "{fault:?}");
        assert!(segment.unused_faults().is_empty());
        assert_eq!(segment.is_off(0), fault == FrameFault::BusOff);
    }
    let mut unused = hosts(2);
    unused.inject(Placed {
        station: Some(0),
        frame: 1,
        fault: FrameFault::Lost,
    });
    unused.run_until(at(1_000));
    assert_eq!(unused.unused_faults().len(), 1);
}

/// An idle drive is skipped over: 100 days cost as much as nothing.
#[test]
fn idle_costs_nothing() {
    let mut desk = Desk::default();
    desk.ask("201#3D4000");
    desk.wait(100 * 24 * 3_600_000);
    assert_eq!(desk.ask("201#3D4000"), ["181#40010100"]);
    // A motor at constant speed as well: 36 rpm for a day is 51840 turns.
    desk.ask("201#314801");
    desk.wait(1_000);
    let before = desk.drive().register(0x6D);
    desk.wait(24 * 3_600_000);
    let turns = (desk.drive().register(0x6D).wrapping_sub(before) as u64) >> 16;
    assert_eq!(turns, 51_840 * 328 * 100 / 32_767);
}

/// Two drives: with different identifiers they never disturb each other; with the same ones both obey, and equal replies are one frame.
#[test]
fn two_drives() {
    use super::common::Member;
    let drive = |setup: &[(u8, u32)]| {
        let drive =
            Drive::new(Properties::default(), Inputs::default(), Instant::START).with_setup(setup);
        Member::Drive(Box::new(drive))
    };
    let play = |second: &[(u8, u32)], frames: &[&str]| {
        let stations = vec![Member::Host(Host::default()), drive(&[]), drive(second)];
        let mut segment = Segment::new(BitRate::K500, stations);
        for (place, text) in frames.iter().enumerate() {
            let Member::Host(host) = segment.station_mut(0) else {
                panic!("the host")
            };
            host.send(at(2_000 * place as u64), frame(text));
        }
        segment.run_until(at(50_000));
        let Member::Host(host) = segment.station_mut(0) else {
            panic!("the host")
        };
        heard(host)
    };
    let apart = play(
        &[(0x68, 0x202), (0x69, 0x182)],
        &["201#31CD0C", "201#3D3100", "202#3D3100"],
    );
    assert_eq!(apart, ["181#31CD0C00", "182#31000000"]);
    let equal = play(&[], &["201#31CD0C", "201#3D3100"]);
    assert_eq!(equal, ["181#31CD0C00"]);
    // Different contents under one identifier: both go to bus-off.
    let clash = play(&[(0x1C, 11)], &["201#3D1C00"]);
    assert_eq!(clash, ["error-frame"]);
}

/// An overfull bus: a waiting cyclic frame is replaced by its successor, so that nothing piles up. 181 beats 201: the host is locked out,
/// even with its stop frame.
#[test]
fn overfull_bus() {
    let mut desk = Desk::default();
    for register in 0xE2..=0xE9 {
        desk.ask(&format!("201#3D{register:02X}01"));
    }
    desk.wait(100);
    let heard = desk.wait(1_000).len();
    // Frames of 4 bytes take 79 to 98 bits, and leave the host no room.
    assert!((5_100..6_350).contains(&heard), "{heard}");
    assert!(desk.host().waiting() > 0);
    assert_eq!(desk.ask("201#3DE2FF").len() / 10, 1);
    assert!(desk.host().waiting() > 1);
    // The frames that wait do not grow: with the drive restarted, the host comes through at once.
    desk.restart();
    desk.wait(5);
    assert_eq!(desk.host().waiting(), 0);
}

/// A fault can be placed by the count over all stations, and `begin` resets that count.
#[test]
fn faults_are_counted_over_the_segment() {
    let mut segment = hosts(3);
    let placed = |frame, fault| Placed {
        station: None,
        frame,
        fault,
    };
    segment.station_mut(0).send(at(0), frame("201#R"));
    segment.run_until(at(500));
    segment.begin();
    segment.inject(placed(2, FrameFault::Lost));
    segment.inject(placed(3, FrameFault::Corrupt));
    for (place, text) in [(0, "203#R"), (1, "202#R"), (2, "201#R")] {
        segment.station_mut(place).send(at(1_000), frame(text));
    }
    segment.run_until(at(5_000));
    let ends: Vec<_> = segment.record().iter().map(|f| (f.from, f.ended)).collect();
    assert_eq!(
        ends,
        [
            (Some(2), FrameEnd::Good),
            (Some(1), FrameEnd::Lost),
            (Some(0), FrameEnd::Error(CanError::ErrorFrame)),
            (Some(0), FrameEnd::Good),
        ]
    );
    assert_eq!((segment.frames(), segment.next_event()), (3, None));
}
