//! Positioning with the S-ramp in the running drive (ND21 13.5).

use super::common::Rig;
use harness_proto::nd21::bits::{ps_status, status};
use harness_proto::nd21::ram;
use harness_proto::nd21::s_ramp::{Direction, SRamp, Status};
use harness_proto::nd21::units::SpeedRange;
use harness_proto::time::Span;
use harness_sim::nd21::{Nd21Properties, SRampWire};

/// Ten turns at 1500 rpm with an acceleration time of 200 ms.
fn ten_turns() -> SRamp {
    SRamp::new(10 * 65_536, 5_662, SpeedRange::To8000, 200).expect("a ramp")
}

/// ND21 13.5.3: ready, doing, done; the distance is covered, and again without another transmission; by
/// hand: 10 / 25 s + 200 ms.
#[test]
fn a_run_of_13_5() {
    let mut rig = Rig::started();
    assert!(rig.drive.load_s_ramp(&ten_turns()));
    assert_eq!(rig.drive.s_ramp_status(), Status::Ready);
    for (direction, end) in [(Direction::Positive, 10 * 65_536), (Direction::Negative, 0)] {
        rig.drive.start_s_ramp(direction);
        let cycles = rig.until(3_000, |rig| rig.drive.s_ramp_status() == Status::Done);
        let by_hand = 0.6 / 432e-6;
        assert!((cycles as f64 - by_hand).abs() < 4.0, "{cycles} {by_hand}");
        rig.run(Span::from_millis(300));
        assert!((rig.long(ram::UMDRIST) - end).abs() <= 1);
    }
}

/// ND21 13.5.3: a stop before the start makes it wait; a stop or block in mid-run gives stopped (FF), and
/// "the following distances are done from this position".
#[test]
fn wait_and_stopped() {
    let mut rig = Rig::started();
    rig.drive.load_s_ramp(&ten_turns());
    rig.set(ram::STATUS, status::STOP);
    rig.cycles(1);
    rig.drive.start_s_ramp(Direction::Positive);
    rig.run(Span::from_millis(100));
    assert_eq!(rig.drive.s_ramp_status(), Status::Wait);
    rig.clear(ram::STATUS, status::STOP);
    rig.run(Span::from_millis(300));
    assert_eq!(rig.drive.s_ramp_status(), Status::Doing);
    rig.set(ram::STATUS, status::STOP);
    rig.run(Span::from_millis(1_000));
    assert_eq!(
        (rig.drive.s_ramp_status(), rig.signed(ram::NIST)),
        (Status::Stopped, 0)
    );
    let here = rig.long(ram::UMDRIST);
    assert!(here > 65_536 && here < 9 * 65_536);
    rig.clear(ram::STATUS, status::STOP);
    rig.cycles(1);
    rig.drive.start_s_ramp(Direction::Positive);
    rig.run(Span::from_millis(1_000));
    assert!((rig.long(ram::UMDRIST) - here - 10 * 65_536).abs() <= 1);
}

/// The wire `puffer`, drivebench's own invention: points in `scope_puffer`, start and status in the cells
/// of the positioning controller.
#[test]
fn through_the_puffer() {
    let properties = Nd21Properties {
        s_ramp_wire: SRampWire::Puffer,
        ..Nd21Properties::default()
    };
    let mut rig = Rig::with(properties, |eeprom| eeprom[0x23] = 0xFB);
    rig.input(harness_proto::nd21::io::Input::Gpin3, true);
    rig.input(harness_proto::nd21::io::Input::Gpin5, true);
    let ramp = ten_turns();
    let mut address = ram::SCOPE_PUFFER;
    for point in ramp.points() {
        for byte in point.to_bytes() {
            rig.write(address, byte);
            address += 1;
        }
    }
    rig.write_word(ram::PS_UMDREHUNG, ramp.points().len() as u16);
    rig.set(ram::PS_STATUS, ps_status::CALCULATE);
    rig.cycles(1);
    assert_eq!(rig.byte(ram::PS_STATUS), ps_status::CALCULATED);
    rig.set(ram::PS_STATUS, ps_status::START | ps_status::NEGATIVE);
    rig.cycles(10);
    assert_eq!(rig.word(ram::PS_IMPULS), 2, "doing");
    rig.run(Span::from_millis(1_000));
    assert_eq!(rig.word(ram::PS_IMPULS), 3, "done");
    assert!((rig.long(ram::UMDRIST) + 10 * 65_536).abs() <= 1);
}
