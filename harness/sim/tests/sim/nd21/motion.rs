//! Speed and position at the 432 us cycle (ND21 14.5, 14.6).

use super::common::Rig;
use harness_proto::nd21::bits::{flags, status};
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::time::Span;
use harness_sim::nd21::{Mode, Nd21Properties, Stimulus};

/// 1500 rpm in the range to 8000 rpm: 1500 / 0.2649095.
const RPM_1500: u16 = 5_662;

/// ND21 14.5.3, 14.5.4: with a ramp of 16 a bit of `nsollrampe` goes by 16 a cycle; 1500 rpm are reached
/// after 5662 / 16 cycles, and `nist` is there to the bit.
#[test]
fn ramp_up_and_down_by_hand() {
    let mut rig = Rig::started();
    rig.write_word(ram::NSOLL, RPM_1500);
    rig.cycles(100);
    assert_eq!(rig.signed(ram::NSOLLRAMPE), 1_600);
    assert!((rig.signed(ram::NIST) - 1_600).abs() < 32);
    rig.cycles(254);
    assert_eq!(rig.word(ram::NSOLLRAMPE), RPM_1500);
    rig.run(Span::from_millis(500));
    assert_eq!(rig.word(ram::NIST), RPM_1500);
    // Half the range, twice the bit (14.5.3.1): the nominal value is the double speed now.
    rig.write_word(ram::NSOLL, 0);
    let braking = rig.until(400, |rig| rig.word(ram::NSOLLRAMPE) == 0);
    assert_eq!(braking, 5_662_u64.div_ceil(16));
    rig.run(Span::from_millis(500));
    assert_eq!(rig.word(ram::NIST), 0);
}

/// ND21 14.5.3.1, 13.1.9: at a constant speed of n bits the position grows by n / 8 increments a cycle.
#[test]
fn position_is_the_sum_of_the_speed() {
    let mut rig = Rig::started();
    rig.write_word(ram::NSOLL, RPM_1500);
    rig.run(Span::from_millis(1_500));
    let (nominal, actual) = (rig.long(ram::UMDRSOLL), rig.long(ram::UMDRIST));
    assert!((nominal - actual).abs() <= 1, "{nominal} {actual}");
    rig.cycles(1_000);
    let way = rig.long(ram::UMDRIST) - actual;
    assert!((way - 5_662 * 1_000 / 8).abs() <= 1, "{way}");
}

/// ND21 14.3.2, 14.5.3.1: in the range to 12000 rpm a bit is twice as much.
#[test]
fn range_to_12000() {
    let mut rig = Rig::with(Nd21Properties::default(), |eeprom| eeprom[0x23] = 0x7F);
    rig.input(Input::Gpin3, true);
    rig.input(Input::Gpin5, true);
    rig.write_word(ram::NSOLL, 2_831);
    rig.run(Span::from_millis(1_500));
    assert_eq!(rig.signed(ram::NIST), 2_831);
    let before = rig.long(ram::UMDRIST);
    rig.cycles(1_000);
    let way = rig.long(ram::UMDRIST) - before;
    assert!((way - 2_831 * 1_000 / 4).abs() <= 1, "{way}");
}

/// ND21 14.5.3.2: no more than `nMax`.
#[test]
fn speed_is_limited() {
    let mut rig = Rig::started();
    rig.write_word(ram::N_MAX, 1_000);
    rig.write_word(ram::NSOLL, 0x8000);
    rig.run(Span::from_millis(500));
    assert_eq!(rig.signed(ram::NSOLLRAMPE), -1_000);
    assert_eq!(rig.signed(ram::NIST), -1_000);
}

/// ND21 11.8: block takes the torque away, stop brakes with the ramp; either may come from the bus or from
/// an input, and both must be taken back.
#[test]
fn modes_of_11_8() {
    let mut rig = Rig::with(Nd21Properties::default(), |_| {});
    assert_eq!(rig.drive.shown().mode, Mode::Block);
    rig.input(Input::Gpin5, true);
    rig.cycles(1);
    assert_eq!(rig.drive.shown().mode, Mode::Stop);
    rig.input(Input::Gpin3, true);
    rig.cycles(1);
    assert_eq!(rig.drive.shown().mode, Mode::Go);
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(200));
    rig.set(ram::STATUS, status::STOP);
    rig.cycles(10);
    assert_eq!(rig.drive.shown().mode, Mode::Stop);
    assert_eq!(rig.signed(ram::NSOLLRAMPE), 800 - 160);
    assert_eq!(rig.byte(ram::FLAGS) & flags::STOP, flags::STOP);
    assert_eq!(rig.byte(ram::FLAGS) & flags::HARDWARE_STOP, 0);
    rig.clear(ram::STATUS, status::STOP);
    rig.run(Span::from_millis(200));
    rig.set(ram::STATUS, status::BLOCK);
    rig.cycles(1);
    assert_eq!(rig.drive.shown().mode, Mode::Block);
    assert_eq!((rig.word(ram::MSOLL), rig.word(ram::NSOLLRAMPE)), (0, 0));
    assert!(rig.signed(ram::NIST) > 700, "it coasts");
    assert_eq!(rig.byte(ram::FLAGS) & flags::BLOCK, flags::BLOCK);
    // The hardware block cannot be taken back by the bus.
    rig.input(Input::Gpin5, false);
    rig.clear(ram::STATUS, status::BLOCK);
    rig.cycles(1);
    assert_eq!(rig.drive.shown().mode, Mode::Block);
    rig.run(Span::from_millis(10_000));
    assert_eq!(rig.word(ram::NIST), 0);
}

/// ND21 14.5.6: 1 bit of the limit is 256 increments; a jammed rotor slips, and the regulator is blocked.
#[test]
fn slipping_error_700() {
    let mut rig = Rig::started();
    rig.write_word(ram::SLIPPING_ERROR, 4);
    rig.drive.stimulate(Stimulus::Jammed(true));
    rig.write_word(ram::NSOLL, 800);
    // 16 x (1 + 2 + ... + n) / 8 increments are more than 1024 after 32 cycles.
    let cycles = rig.until(100, |rig| rig.byte(ram::STATUS) & status::ERROR != 0);
    assert_eq!(cycles, 33);
    assert_eq!(rig.word(ram::ERRORCODE), 0x0700);
    assert_eq!(rig.drive.shown().display, Some([7, 0, 0]));
    assert_eq!(rig.drive.shown().mode, Mode::Error);
    // 8000 switches it off.
    let mut rig = Rig::started();
    rig.write_word(ram::SLIPPING_ERROR, 0x8000);
    rig.drive.stimulate(Stimulus::Jammed(true));
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(1_000));
    assert_eq!(rig.byte(ram::STATUS) & status::ERROR, 0);
}

/// ND21 14.4: the current is limited to `imax`, and after `i2t-time` to `i0`.
#[test]
fn torque_is_limited_by_imax_then_by_i0() {
    let mut rig = Rig::started();
    rig.write_word(ram::SLIPPING_ERROR, 0x8000);
    rig.drive.stimulate(Stimulus::Jammed(true));
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(100));
    assert_eq!(rig.byte(ram::MMAX), 0x74);
    assert_eq!(rig.word(ram::MSOLL), 0x7400);
    assert_eq!(
        rig.byte(ram::STATUS) & status::CURRENT_LIMIT,
        status::CURRENT_LIMIT
    );
    assert_eq!(rig.byte(ram::FLAGS) & flags::I2T, 0);
    rig.run(Span::from_millis(1_850));
    assert_eq!(rig.byte(ram::FLAGS) & flags::I2T, 0, "2 s have not gone by");
    rig.run(Span::from_millis(100));
    assert_eq!(rig.byte(ram::FLAGS) & flags::I2T, flags::I2T);
    assert_eq!((rig.byte(ram::MMAX), rig.word(ram::MSOLL)), (0x3A, 0x3A00));
}

/// ND21 14.4.2: where `imax` may last for no time, `i0` is the limit as soon as there is a current.
#[test]
fn no_time_for_imax() {
    let none = Nd21Properties {
        i2t_time: Span::ZERO,
        ..Nd21Properties::default()
    };
    let mut rig = Rig::with(none, |_| {});
    rig.input(Input::Gpin3, true);
    rig.input(Input::Gpin5, true);
    rig.clear(ram::STATUS, status::BLOCK);
    rig.run(Span::from_millis(10));
    assert_eq!(rig.byte(ram::MMAX), 0x74);
    rig.drive.stimulate(Stimulus::Jammed(true));
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(10));
    assert_eq!(rig.byte(ram::MMAX), 0x3A);
    assert_eq!(rig.byte(ram::FLAGS) & flags::I2T, flags::I2T);
}

/// A load is held by the integral part: 5 Aeff are 5 / 0.000671 bits of `msoll` (ND21 14.5.2).
#[test]
fn load_is_held() {
    let mut rig = Rig::started();
    rig.drive.stimulate(Stimulus::Load(5_000));
    rig.run(Span::from_millis(2_000));
    let torque = f64::from(rig.signed(ram::MSOLL)) * 0.000_671;
    // Friction holds 0.143 Aeff of it.
    assert!((torque - 5.0).abs() < 0.15, "{torque}");
    assert!(rig.long(ram::UMDRIST).abs() <= 1);
}

/// ND21 14.6.3: the time constant is 432 us / (1 - nFilter / 128): 3.456 ms with H'70.
#[test]
fn tacho_filter_of_14_6_3() {
    let mut rig = Rig::started();
    rig.write_word(ram::NSOLL, RPM_1500);
    rig.run(Span::from_millis(1_000));
    rig.write(ram::N_FILTER, 0x70);
    rig.cycles(1);
    rig.set(ram::STATUS, status::BLOCK);
    // What the plant does in a cycle is known from a drive without the filter.
    let mut other = Rig::started();
    other.write_word(ram::NSOLL, RPM_1500);
    other.run(Span::from_millis(1_000));
    other.cycles(1);
    other.set(ram::STATUS, status::BLOCK);
    let mut expected = f64::from(other.signed(ram::NIST));
    for _ in 0..200 {
        rig.cycles(1);
        other.cycles(1);
        expected += (f64::from(other.signed(ram::NIST)) - expected) * 16.0 / 128.0;
        assert!((f64::from(rig.signed(ram::NIST)) - expected).abs() <= 1.5);
    }
}

/// ND21 14.7.2: `VCOlin` = speed at 10 V / 60; 14.7.3: `VCOlin` x 256 + `VCOlinL` = 33554432 / impulses.
#[test]
fn analogue_and_frequency_inputs() {
    let drive = |hardware, software| {
        let mut rig = Rig::with(Nd21Properties::default(), |eeprom| {
            eeprom[0x20] = hardware;
            eeprom[0x22] = software;
        });
        rig.input(Input::Gpin3, true);
        rig.input(Input::Gpin5, true);
        rig
    };
    let mut rig = drive(0x80, 0x40);
    rig.drive.stimulate(Stimulus::Analogue(-5_000));
    rig.run(Span::from_millis(1_500));
    // -1500 rpm at -5 V with 3000 rpm at 10 V.
    assert!((rig.signed(ram::NIST) + 5_662).abs() <= 1);
    assert_eq!(rig.signed(ram::NSOLL), rig.signed(ram::NSOLLRAMPE));

    // 1024 impulses a turn: 32768; the ramp must be off (14.7.3). 10240 Hz are 10 turns a second.
    let mut rig = drive(0x00, 0x42);
    rig.write_word(ram::N_RAMPE_PLUS, 0x7FFF);
    rig.write_word(ram::N_RAMPE_MINUS, 0x7FFF);
    rig.write(ram::VCO_LIN, 0x80);
    rig.drive.stimulate(Stimulus::Frequency(10_240));
    rig.run(Span::from_millis(1_000));
    let before = rig.long(ram::UMDRSOLL);
    rig.cycles(10_000);
    // 4.32 s x 10 turns.
    let way = rig.long(ram::UMDRSOLL) - before;
    assert!((way - 432 * 65_536 / 10).abs() <= 1, "{way}");
    rig.input(Input::Gpin8, true);
    rig.run(Span::from_millis(500));
    assert!(rig.signed(ram::NIST) < -2_000);
}

/// ND21 14.3.1: bit 7 of `SwVersion` reverses the motor with the set speed; `ReversTakt` is the cycle.
#[test]
fn reversing_mode() {
    let mut rig = Rig::started();
    rig.write(ram::REVERS_TAKT, 10);
    rig.write_word(ram::NSOLL, 500);
    rig.set(ram::SW_VERSION, 0x80);
    let mut turns = 0;
    let mut before = 0;
    for _ in 0..6_400 {
        rig.cycles(1);
        let speed = rig.signed(ram::NSOLLRAMPE).signum();
        turns += usize::from(before * speed < 0 || before == 0 && speed != 0 && turns > 0);
        before = if speed == 0 { before } else { speed };
    }
    // A half period is 10 x 64 cycles.
    assert_eq!(turns, 9);
}

/// ND21 14.3.1: bit 3 of `SwVersion` turns the direction round.
#[test]
fn direction_bit() {
    let encoder = |software| {
        let mut rig = Rig::with(Nd21Properties::default(), |eeprom| eeprom[0x22] = software);
        rig.input(Input::Gpin3, true);
        rig.input(Input::Gpin5, true);
        rig.write_word(ram::NSOLL, 1_000);
        rig.run(Span::from_millis(1_000));
        assert_eq!(rig.signed(ram::NIST), 1_000);
        assert!(rig.long(ram::UMDRIST) > 0);
        rig.drive.shown().encoder
    };
    let (forwards, backwards) = (encoder(0x43), encoder(0x4B));
    assert!(
        forwards > 0 && (forwards + backwards).abs() <= 1,
        "{forwards} {backwards}"
    );
}

/// ND21 14.3.3: with bit 4 of `HwVersion` 0 an active end switch stops the drive, and it can be driven off
/// the switch; with 1 the regulator is blocked.
#[test]
fn end_switches_stop_or_block() {
    let mut rig = Rig::started();
    rig.write_word(ram::NSOLL, 800);
    rig.run(Span::from_millis(300));
    rig.input(Input::EschP, true);
    rig.run(Span::from_millis(300));
    assert_eq!(
        (rig.signed(ram::NIST), rig.drive.shown().mode),
        (0, Mode::Go)
    );
    assert_eq!(rig.byte(ram::FLAGS) & flags::STOP, flags::STOP);
    rig.write_word(ram::NSOLL, 800_u16.wrapping_neg());
    rig.run(Span::from_millis(300));
    assert_eq!(rig.signed(ram::NIST), -800);
    rig.set(ram::HW_VERSION, 0x10);
    rig.cycles(1);
    assert_eq!(
        (rig.word(ram::ERRORCODE), rig.drive.shown().mode),
        (0x0310, Mode::Error)
    );
}

/// A drive at rest does not run its cycles one by one, and a day of it is soon over.
#[test]
fn an_idle_drive_costs_nothing() {
    let mut rig = Rig::started();
    rig.run(Span::from_millis(24 * 3_600_000));
    // ND21 14.8.2: the low byte first.
    let hours = &rig.drive.program().cells().eeprom()[5..7];
    assert_eq!(hours, [24, 0]);
    rig.write_word(ram::NSOLL, 160);
    rig.cycles(10);
    assert_eq!(rig.signed(ram::NSOLLRAMPE), 160);
}

/// ND21 11.8, 14.5.4: released while the motor still turns, the drive leads it on the ramp from the speed that
/// it has; it does not brake it to 0 at once.
#[test]
fn a_turning_motor_is_taken_over_at_its_speed() {
    let mut rig = Rig::started();
    rig.write_word(ram::NSOLL, RPM_1500);
    rig.run(Span::from_millis(500));
    rig.set(ram::STATUS, status::BLOCK);
    rig.cycles(20);
    let coasting = rig.signed(ram::NIST);
    assert!(coasting > 4_000, "{coasting}");
    rig.clear(ram::STATUS, status::BLOCK);
    rig.cycles(1);
    let taken = rig.signed(ram::NSOLLRAMPE);
    assert!((taken - coasting).abs() <= 32, "{taken} {coasting}");
    rig.cycles(10);
    let led = (taken + 10 * 16).min(5_662);
    assert_eq!(rig.signed(ram::NSOLLRAMPE), led);
}

/// ND21 14.5.1.2: no more current than the device gives, whatever is written to `imax`.
#[test]
fn imax_beyond_the_device() {
    let mut rig = Rig::started();
    let most = rig.byte(ram::IMAX);
    rig.write(ram::IMAX, 0xFF);
    rig.cycles(1);
    let limit = rig.byte(ram::MMAX);
    assert!(limit >= most && limit < 0x80, "{limit}");
}
