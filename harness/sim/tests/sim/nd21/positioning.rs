//! The positioning controller and the referencing run as the bus sees them (ND21 13.1-13.4).

use super::common::Rig;
use harness_proto::nd21::bits::{flags2, ps_status, status};
use harness_proto::nd21::io::{GPO2, Input, OUTPUTS};
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::Ratio;
use harness_proto::time::Span;
use harness_sim::nd21::{Nd21Properties, Stimulus};

/// A started drive whose positioning controller is initialised (13.2.1.3).
fn initialised() -> Rig {
    let mut rig = Rig::started();
    rig.write(ram::PS_STATUS, 0x01);
    rig.cycles(1);
    rig
}

/// NB_WritePS (13.2.2), then waits for the end of the calculation.
fn write_ps(rig: &mut Rig, position: u32) {
    let [a, b, c, d] = position.to_be_bytes();
    rig.write_word(ram::PS_POSITION_H, u16::from_be_bytes([a, b]));
    rig.write_word(ram::PS_POSITION_L, u16::from_be_bytes([c, d]));
    rig.set(ram::FLAGS2, flags2::CALCULATE);
    rig.until(100, |rig| {
        rig.byte(ram::PS_STATUS) & ps_status::CALCULATED != 0
    });
}

/// NB_StartPS (13.2.3), then to the end; how many cycles it took, and the phases on the way.
fn start_ps(rig: &mut Rig) -> (u64, Vec<u8>) {
    rig.set(ram::PS_STATUS, ps_status::START);
    let mut phases = vec![];
    let cycles = rig.until(100_000, |rig| {
        let phase = rig.byte(ram::PS_STATUS);
        if phases.last() != Some(&phase) {
            phases.push(phase);
        }
        phase == ps_status::FINISHED
    });
    (cycles, phases)
}

/// The worked examples of 13.1.9 one after another: absolute and relative, both directions. Phases as in
/// 13.3.2.3, direction in bit 7, and at the end ps_status = 01, Flags2 bit 3 = 0, in position.
#[test]
fn targets_of_13_1_9() {
    let mut rig = initialised();
    let mut expected = 0_i64;
    for (mode, turns, denominator, word) in [
        (PositionMode::Absolute, 1_025, 100, 0x000A_4000),
        (PositionMode::Absolute, -1_025, 100, 0x7FF5_C000),
        (PositionMode::Relative, 50, 360, 0x8000_238E),
        (PositionMode::Relative, -50, 360, 0xFFFF_DC72),
        (PositionMode::Absolute, 65, 10, 0x0006_8000),
        (PositionMode::Relative, -65, 10, 0xFFF9_8000),
    ] {
        let position = Position::from_turns(mode, Ratio::new(turns, denominator).expect("turns"))
            .expect("fits");
        assert_eq!(position.encode(), word);
        let here = expected;
        expected = match mode {
            PositionMode::Absolute => i64::from(position.increments()),
            PositionMode::Relative => here + i64::from(position.increments()),
        };
        write_ps(&mut rig, word);
        let way = expected - here;
        let direction = if way < 0 { ps_status::NEGATIVE } else { 0 };
        assert_eq!(rig.byte(ram::PS_STATUS), direction | ps_status::CALCULATED);
        assert_eq!(i64::from(rig.long(ram::PS_UMDREHUNG)), way.abs());
        let (cycles, phases) = start_ps(&mut rig);
        let steps = [
            direction | ps_status::CALCULATED | ps_status::START,
            direction | ps_status::CONSTANT,
            direction | ps_status::BRAKING,
            direction | ps_status::TARGET_BRAKING,
            ps_status::FINISHED,
        ];
        assert_eq!(phases, steps);
        assert_eq!(i64::from(rig.long(ram::UMDRSOLL)), expected);
        assert_eq!(rig.byte(ram::FLAGS2) & flags2::CALCULATE, 0);
        // By hand: way / v + v / ramp for the trapezoid, 2 x root of (way / ramp) for the triangle.
        let (speed, ramp) = (11_325.0 / 8.0, 16.0 / 8.0);
        let way = way.abs() as f64;
        let by_hand = if way > speed * speed / ramp {
            way / speed + speed / ramp
        } else {
            2.0 * (way / ramp).sqrt()
        };
        assert!((cycles as f64 - by_hand).abs() <= 4.0, "{cycles} {by_hand}");
        rig.run(Span::from_millis(300));
        assert!((i64::from(rig.long(ram::UMDRIST)) - expected).abs() <= 1);
        assert_eq!(rig.byte(OUTPUTS) & GPO2, GPO2, "in position (13.1.4)");
    }
}

/// 13.1.4: the in-position report comes when the rotor is nearer to the target than 4 x Window.
#[test]
fn in_position_window() {
    let mut rig = initialised();
    write_ps(&mut rig, 0x0001_0000);
    start_ps(&mut rig);
    rig.run(Span::from_millis(300));
    rig.drive.stimulate(Stimulus::Load(3_000));
    for _ in 0..300 {
        rig.cycles(1);
        let away = (rig.long(ram::UMDRIST) - 0x0001_0000).unsigned_abs();
        let reported = rig.byte(OUTPUTS) & GPO2 != 0;
        assert_eq!(
            reported,
            away < 4 * u32::from(rig.byte(ram::WINDOW)),
            "{away}"
        );
    }
}

/// 13.4, 13.2.1: 601 if the controller is not released; 13.3.2.4: a relative way without Flags2.
#[test]
fn not_released_601_and_relative_by_hand() {
    let mut rig = Rig::started();
    rig.set(ram::FLAGS2, flags2::CALCULATE);
    rig.cycles(1);
    assert_eq!(rig.word(ram::ERRORCODE), 0x0601);
    let mut rig = initialised();
    rig.clear(ram::SW_VERSION, 0x40);
    rig.set(ram::FLAGS2, flags2::CALCULATE);
    rig.cycles(1);
    assert_eq!(rig.word(ram::ERRORCODE), 0x0601);

    let mut rig = initialised();
    rig.write_word(ram::PS_UMDREHUNG, 2);
    rig.write_word(ram::PS_IMPULS, 0x1000);
    rig.write(ram::PS_STATUS, ps_status::NEGATIVE | ps_status::CALCULATE);
    rig.until(100, |rig| {
        rig.byte(ram::PS_STATUS) & ps_status::CALCULATED != 0
    });
    start_ps(&mut rig);
    assert_eq!(rig.long(ram::UMDRSOLL), -0x2_1000);
}

/// 13.1, 13.4: a run of more than 26 s is error 600. At 10 rpm (38 bits) a turn takes 5.96 s.
#[test]
fn overflow_600_over_26_s() {
    for (increments, error) in [(0x4_0000_u32, 0), (0x4_6000, 0x0600)] {
        let mut rig = initialised();
        rig.write_word(ram::PS_V0, 38);
        let [a, b, c, d] = increments.to_be_bytes();
        rig.write_word(ram::PS_POSITION_H, u16::from_be_bytes([a, b]));
        rig.write_word(ram::PS_POSITION_L, u16::from_be_bytes([c, d]));
        rig.set(ram::FLAGS2, flags2::CALCULATE);
        rig.run(Span::from_millis(50));
        assert_eq!(rig.word(ram::ERRORCODE), error);
        assert_eq!(rig.byte(ram::FLAGS2) & flags2::CALCULATE != 0, error == 0);
    }
}

/// 13.1.2: started in drive block, the calculation waits for the release; 13.4 "drive blocked".
#[test]
fn calculation_waits_for_release() {
    let mut rig = initialised();
    rig.input(Input::Gpin5, false);
    rig.write_word(ram::PS_POSITION_H, 1);
    rig.set(ram::FLAGS2, flags2::CALCULATE);
    rig.run(Span::from_millis(500));
    assert_eq!(rig.byte(ram::PS_STATUS), 0x01);
    rig.input(Input::Gpin5, true);
    rig.until(100, |rig| rig.byte(ram::PS_STATUS) == ps_status::CALCULATED);
    // The block cancels the result (13.1.2).
    rig.input(Input::Gpin5, false);
    rig.cycles(1);
    assert_eq!(
        (
            rig.byte(ram::PS_STATUS),
            rig.byte(ram::FLAGS2) & flags2::CALCULATE
        ),
        (0, 0)
    );
}

/// 13.1.13: stopped in mid-run, the drive brakes with its ramp; reloaded and started, it completes the
/// remaining track.
#[test]
fn remaining_track() {
    for block in [false, true] {
        let mut rig = initialised();
        write_ps(&mut rig, 0x000A_4000);
        rig.set(ram::PS_STATUS, ps_status::START);
        rig.run(Span::from_millis(200));
        assert_eq!(rig.byte(ram::PS_STATUS), ps_status::CONSTANT);
        let bit = if block { status::BLOCK } else { status::STOP };
        rig.set(ram::STATUS, bit);
        rig.cycles(1);
        assert_eq!(rig.byte(ram::PS_STATUS), 0);
        assert_eq!(rig.byte(ram::FLAGS2) & flags2::CALCULATE, 0);
        rig.run(Span::from_millis(10_000));
        assert_eq!(rig.word(ram::NIST), 0);
        rig.clear(ram::STATUS, bit);
        write_ps(&mut rig, 0x000A_4000);
        start_ps(&mut rig);
        rig.run(Span::from_millis(300));
        assert!((rig.long(ram::UMDRIST) - 0x000A_4000).abs() <= 1);
    }
}

/// 13.2.3, 11.8: a start that is given while the drive is stopped waits.
#[test]
fn start_waits_for_the_drive() {
    let mut rig = initialised();
    write_ps(&mut rig, 0x0001_0000);
    rig.input(Input::Gpin3, false);
    rig.set(ram::PS_STATUS, ps_status::START);
    rig.run(Span::from_millis(100));
    assert_eq!(rig.long(ram::UMDRIST), 0);
    rig.input(Input::Gpin3, true);
    rig.until(5_000, |rig| rig.byte(ram::PS_STATUS) == ps_status::FINISHED);
    assert_eq!(rig.long(ram::UMDRSOLL), 0x0001_0000);
}

/// 13.3.2.3: the start bit without a finished calculation starts nothing, then or later.
#[test]
fn a_start_without_a_result_is_dropped() {
    let mut rig = initialised();
    rig.set(ram::PS_STATUS, ps_status::START);
    rig.cycles(1);
    assert_eq!(rig.byte(ram::PS_STATUS), ps_status::FINISHED);
    write_ps(&mut rig, 0x0001_0000);
    rig.run(Span::from_millis(500));
    assert_eq!(rig.byte(ram::PS_STATUS), ps_status::CALCULATED);
    assert_eq!(rig.long(ram::UMDRIST), 0);
}

/// 13.1.2: it starts from a standstill only.
#[test]
fn a_start_in_motion_waits() {
    let mut rig = initialised();
    write_ps(&mut rig, 0x0004_0000);
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(100));
    rig.set(ram::PS_STATUS, ps_status::START);
    rig.run(Span::from_millis(100));
    assert_eq!(
        rig.byte(ram::PS_STATUS),
        ps_status::CALCULATED | ps_status::START
    );
    // It has moved: the way to the absolute target is another, and is calculated again.
    rig.write_word(ram::NSOLL, 0);
    rig.until(10_000, |rig| {
        rig.byte(ram::PS_STATUS) == ps_status::FINISHED
    });
    assert_eq!(rig.long(ram::UMDRSOLL), 0x0004_0000);
}

/// 13.3.2.3: the direction of a run is that of its start, whatever is written to `ps_status` meanwhile.
#[test]
fn the_direction_is_latched_at_the_start() {
    let mut rig = initialised();
    write_ps(&mut rig, 0x7FF5_C000);
    rig.set(ram::PS_STATUS, ps_status::START);
    rig.run(Span::from_millis(200));
    assert_ne!(rig.byte(ram::PS_STATUS) & ps_status::NEGATIVE, 0);
    rig.clear(ram::PS_STATUS, ps_status::NEGATIVE);
    rig.until(20_000, |rig| {
        rig.byte(ram::PS_STATUS) == ps_status::FINISHED
    });
    assert_eq!(rig.long(ram::UMDRSOLL), -0x000A_4000);
}

/// 13.2.1: with bit 1 of HwVersion2 = 0 the controller is initialised after switching on.
#[test]
fn automatic_initialisation() {
    let rig = Rig::with(Nd21Properties::default(), |eeprom| eeprom[0x21] = 0xFD);
    assert_eq!(rig.byte(ram::PS_STATUS), 0x01);
}

/// 13.2.1.2, the ten steps of NB_IstwertSetzen.
#[test]
fn setting_the_actual_value() {
    let mut rig = initialised();
    write_ps(&mut rig, 0x0001_2345);
    start_ps(&mut rig);
    rig.run(Span::from_millis(300));
    let wanted = -5 * 65_536 + 0x1000_i32;
    rig.set(ram::STATUS, status::BLOCK);
    rig.cycles(2);
    let raw = rig.long(ram::UMDRIST) - i32::from(rig.word(ram::D_LAGE));
    let [_, _, high, low] = (wanted - raw).to_be_bytes();
    rig.write_word(ram::D_LAGE, u16::from_be_bytes([high, low]));
    rig.cycles(4);
    let [high, low, ..] = wanted.to_be_bytes();
    rig.write_word(ram::UMDRIST, u16::from_be_bytes([high, low]));
    rig.cycles(4);
    rig.clear(ram::STATUS, status::BLOCK);
    rig.cycles(10);
    assert_eq!(rig.long(ram::UMDRIST), wanted);
    assert_eq!(rig.byte(ram::STATUS) & status::ERROR, 0);
}

/// 13.1.1: the eight steps, with a cam at GPIN4. The rotor angle at the end is 180 degrees, the position
/// that of RefUmdr0 and RefLage0, and ps_status 01.
#[test]
fn referencing_of_13_1_1() {
    for (cam, shift) in [
        ((3 * 65_536 + 1_000, 3 * 65_536 + 40_000), 0),
        ((0, 30_000), 0x2000),
    ] {
        let mut rig = Rig::started();
        rig.write_word(ram::REF_LAGE, shift);
        rig.write_word(ram::REF_UMDR0, 7);
        rig.write_word(ram::REF_LAGE0, 0x1234);
        rig.drive
            .stimulate(Stimulus::Cam(Input::Gpin4, cam.0, cam.1));
        // 13.2.1.1 steps 3 to 6.
        rig.write(ram::PS_STATUS, 0);
        rig.clear(ram::FLAGS2, flags2::REFERENCING);
        rig.write_word(ram::NSOLL, 0);
        rig.set(ram::FLAGS2, flags2::START_REFERENCING);
        let mut steps = vec![];
        rig.until(50_000, |rig| {
            let step = rig.byte(ram::FLAGS2) >> 5;
            if steps.last() != Some(&step) {
                steps.push(step);
            }
            step == 0
        });
        let expected = [0b100, 0b101, 0b110, 0b111, 0b001, 0b010, 0b011, 0];
        let skipped = if cam.0 == 0 { 2 } else { 1 };
        assert_eq!(steps[1..], expected[skipped..]);
        rig.until(10, |rig| rig.byte(ram::PS_STATUS) == 0x01);
        assert_eq!(rig.long(ram::UMDRSOLL), 0x0007_1234);
        rig.run(Span::from_millis(300));
        assert!((rig.long(ram::UMDRIST) - 0x0007_1234).abs() <= 1);
        // The resolver's angle is what is shown less dLage.
        let angle = rig.word(ram::LAGEIST).wrapping_sub(rig.word(ram::D_LAGE));
        let away = angle.wrapping_sub(0x8000 + shift).cast_signed();
        assert!(away.abs() <= 1, "{away}");
        assert_eq!(rig.word(ram::PS_V0), 189, "13.2.1.1 steps 1 and 9");
    }
}

/// 13.2.1.1 step 7, 13.1.7.4: stop and block end the run, and the controller is not initialised.
#[test]
fn referencing_is_interrupted() {
    for (address, bit) in [(ram::STATUS, status::STOP), (ram::STATUS, status::BLOCK)] {
        let mut rig = Rig::started();
        rig.set(ram::FLAGS2, flags2::START_REFERENCING);
        rig.run(Span::from_millis(200));
        assert!(rig.signed(ram::NIST) > 500);
        rig.set(address, bit);
        rig.cycles(1);
        assert_eq!(rig.byte(ram::FLAGS2) & flags2::REFERENCING, 0);
        assert_eq!(rig.byte(ram::PS_STATUS), 0);
    }
}
