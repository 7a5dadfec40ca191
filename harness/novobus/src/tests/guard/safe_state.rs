//! The safe state, confirmed and not (ND21 11.8, 14.10).

use super::{axis, bus, guarded, ring, size};
use crate::driver::OpenRings;
use crate::gate::guard_rings;
use crate::guard::{SafeConfirmation, blind_stop, safe_state};
use crate::link::BesideTheBus as _;
use crate::link::SimulatedLink;
use harness_bench::guard::{Guarded, Standstill};
use harness_bench::link::{DriveFault, Line, Link, LinkFault, Moment, Octets, PlacedFault};
use harness_proto::line::Rate;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::ram;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Span;
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

fn turning(bus: &OpenRings<'_>, drive: u16) {
    bus.write_word(axis(drive), ram::NSOLL, 0x2C3D)
        .expect("written");
    bus.go(axis(drive)).expect("gone");
}

/// A guarded ring of three whose drives 0 and 2 turn at 3000 rpm.
fn in_motion() -> Guarded<SimulatedLink> {
    let mut line = guarded(
        3,
        Limits {
            motion: true,
            ..Limits::default()
        },
    );
    {
        let bus = bus(&mut line, 3);
        bus.run(Span::from_millis(300));
        // The zeros of the recovery are a bad sync byte, error 0504 (ND21 9.7, 14.10.1).
        for drive in 0..3 {
            bus.delete_error(axis(drive)).expect("deleted");
        }
        turning(&bus, 0);
        turning(&bus, 2);
        bus.run(Span::from_millis(2_000));
        let speed = bus.read_word(axis(2), ram::NIST).expect("read");
        assert!(speed > 0x2B00, "nist is {speed:04X}");
        bus.close();
    }
    line
}

fn word(line: &Guarded<SimulatedLink>, drive: u8, address: u16) -> i16 {
    let byte = |address| line.peek(0, drive, address).expect("seen");
    i16::from_be_bytes([byte(address), byte(address + 1)])
}

#[test]
fn turning_motors_stand_and_are_blocked() {
    let mut line = in_motion();
    let state = safe_state(&mut line, &[size(3)], &Standstill::default());
    assert_eq!(state, SafeConfirmation::Confirmed(vec![size(3)]));
    for drive in 0..3 {
        assert!(word(&line, drive, ram::NIST).abs() <= 20);
        assert_eq!(word(&line, drive, ram::NSOLL), 0);
        assert_eq!(line.peek(0, drive, ram::STATUS).expect("seen") & 0x81, 0x81);
    }
}

/// No cap of the bytes that are sent stands in the way of the safe state.
#[test]
fn no_cap_stops_the_safe_state() {
    for (bytes_per_second, most_bytes) in [(Some(60), u64::MAX), (None, 60)] {
        let limits = Limits {
            motion: true,
            bytes_per_second,
            most_bytes,
            ..Limits::default()
        };
        let confirmed = |lifted: bool| {
            let mut line = guarded(1, limits);
            line.send_octets(0, &[0x80; 60]);
            assert!(line.trouble().is_some(), "{limits:?}");
            line.reset_after_denial();
            if lifted {
                line.clear_the_way();
            }
            let state = safe_state(&mut line, &[size(1)], &Standstill::default());
            state == SafeConfirmation::Confirmed(vec![size(1)])
        };
        assert!(confirmed(true), "{limits:?}");
        assert!(!confirmed(false), "{limits:?}");
    }
}

/// What the watchdog sends past the guard is what the guard lets pass, whatever it allows.
#[test]
fn the_last_words_are_allowed() {
    for drives in [1, 3, 250] {
        let mut line = guarded(drives, Limits::default());
        let bytes = blind_stop(size(drives));
        line.send_octets(0, &bytes);
        assert_eq!(line.trouble(), None);
        while line.busy() && line.wait(line.now() + Span::from_millis(1_000)) {}
        let stopped = |drive: u8| {
            line.peek(0, drive, ram::STATUS)
                .is_some_and(|status| status & 0x80 != 0)
        };
        assert!((0..size(drives).drives()).all(stopped), "{drives}");
    }
}

/// Half a telegram and a denied command stand on the line; nothing but stopping is allowed.
#[test]
fn half_a_telegram_does_not_keep_it_away() {
    let limits = Limits::default();
    let mut line = guarded(2, limits);
    let before = line.peek(0, 1, ram::STATUS);
    line.send_octets(0, &[0x8A, 0xFF, 0x82, 0x00, 0x00, 0xFF, 0x81]);
    assert!(line.trouble().is_some());
    assert_eq!(line.peek(0, 1, ram::STATUS), before);
    line.reset_after_denial();
    let state = safe_state(&mut line, &[size(2)], &Standstill::default());
    assert_eq!(state, SafeConfirmation::Confirmed(vec![size(2)]), "{state}");
}

#[test]
fn a_drive_without_power_is_named() {
    let mut line = in_motion();
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let begin = line.now();
    let SafeConfirmation::NotConfirmed(drives) =
        safe_state(&mut line, &[size(3)], &Standstill::default())
    else {
        panic!("confirmed");
    };
    assert_eq!(drives.len(), 3);
    assert!(
        drives.iter().all(|drive| drive.why.contains("ring")),
        "{drives:?}"
    );
    assert!(line.now().since(begin) < Span::from_millis(15_000));
    // Drive 2 stands in front of the dark one and has heard the stop.
    let end = line.now() + Span::from_millis(3_000);
    while line.now() < end && line.wait(end) {}
    assert!(word(&line, 2, ram::NIST).abs() <= 20);
}

#[test]
fn a_cut_ring_is_not_confirmed() {
    let mut line = in_motion();
    line.inject(0, PlacedFault::Link(0, LinkFault::Cut), Moment::Now);
    let begin = line.now();
    let state = safe_state(&mut line, &[size(3)], &Standstill::default());
    assert!(matches!(&state, SafeConfirmation::NotConfirmed(drives) if drives.len() == 3));
    assert!(state.to_string().contains("NOT confirmed"));
    assert!(line.now().since(begin) < Span::from_millis(15_000));
}

/// In the middle of a path of 200 revolutions (ND21 13.2.2).
#[test]
fn a_motion_of_the_positioning_controller_ends() {
    let limits = Limits {
        motion: true,
        ..Limits::default()
    };
    let mut line = guarded(1, limits);
    {
        let bus = bus(&mut line, 1);
        let drive = axis(0);
        bus.run(Span::from_millis(300));
        bus.delete_error(drive).expect("deleted");
        bus.go(drive).expect("gone");
        bus.init_ps(drive).expect("initialised");
        let path = Position::new(PositionMode::Relative, 200 * 65_536).expect("a path");
        bus.write_ps(drive, path).expect("written");
        bus.start_ps(drive).expect("started");
        bus.run(Span::from_millis(1_500));
        bus.close();
    }
    assert!(word(&line, 0, ram::NIST).abs() > 200);
    let state = safe_state(&mut line, &[size(1)], &Standstill::default());
    assert_eq!(state, SafeConfirmation::Confirmed(vec![size(1)]), "{state}");
    let end = line.now() + Span::from_millis(1_000);
    while line.now() < end && line.wait(end) {}
    assert!(word(&line, 0, ram::NIST).abs() <= 20);
}

/// Half a telegram that was not denied, on both rings; nothing was synchronised before.
#[test]
fn two_rings() {
    let bench = Bench::two(ring(1), ring(3));
    let mut line = guard_rings(SimulatedLink::new(bench), Limits::default());
    let rings = [size(1), size(3)];
    line.assume_fresh();
    for ring in 0..2 {
        line.send_octets(ring, &[0x8A, 0xFF, 0x82, 0x00]);
    }
    assert_eq!(line.trouble(), None);
    line.reset_after_denial();
    let state = safe_state(&mut line, &rings, &Standstill::default());
    assert_eq!(
        state,
        SafeConfirmation::Confirmed(rings.to_vec()),
        "{state}"
    );
    line.inject(1, PlacedFault::Drive(2, DriveFault::Off), Moment::Now);
    line.reset_after_denial();
    let SafeConfirmation::NotConfirmed(drives) =
        safe_state(&mut line, &rings, &Standstill::default())
    else {
        panic!("confirmed");
    };
    assert!(drives.iter().all(|drive| drive.axis.ring() == 1));
}

/// Plain drives have a memory and no motor behind it: the safe state is not confirmed without a read-back, and the attempt ends.
#[test]
fn plain_drives_are_not_confirmed() {
    let plain = |_| Drive::Plain(PlainDrive::new(Properties::default(), [0; 256]));
    let bench = Bench::one(Ring::new(size(2), Rate::Baud38400, plain));
    let mut line = guard_rings(SimulatedLink::new(bench), Limits::default());
    let begin = line.now();
    let SafeConfirmation::NotConfirmed(drives) =
        safe_state(&mut line, &[size(2)], &Standstill::default())
    else {
        panic!("confirmed");
    };
    assert_eq!(drives.len(), 2);
    assert!(drives[0].why.contains("Flags are 00"), "{drives:?}");
    assert!(line.now().since(begin) < Span::from_millis(5_000));
}
