//! The cycle control AS1.0 as a PLC sees it (ND21 13.1.5-13.1.13).

use super::common::Rig;
use harness_proto::nd21::bits::{flags2, ps_status, status};
use harness_proto::nd21::functions::Function;
use harness_proto::nd21::io::{GPO1, Input, OUTPUTS};
use harness_proto::nd21::ram;
use harness_proto::time::Span;
use harness_sim::nd21::{Mode, Nd21Properties, Stimulus};

/// A PLC and its drive: cycle control on, GPIN8 a mode switch, positioning controller initialised at
/// switching on, released.
fn plc() -> Rig {
    let mut rig = Rig::with(Nd21Properties::default(), |eeprom| {
        eeprom[0x20] = 0x4C;
        eeprom[0x21] = 0xFD;
        eeprom[0x23] = 0xFD;
    });
    rig.input(Input::Gpin5, true);
    rig.cycles(2);
    rig
}

fn gpo1(rig: &Rig) -> bool {
    rig.byte(OUTPUTS) & GPO1 != 0
}

/// Selects a function and gives the rising edge (13.1.6 steps 1 and 2).
fn begin(rig: &mut Rig, function: Function) {
    assert!(!gpo1(rig), "ready for {function:?}");
    for (switch, high) in function.levels() {
        rig.input(switch, high);
    }
    rig.input(Input::Gpin3, true);
    rig.cycles(1);
}

/// Takes GPIN3 away; GPO1 goes low (13.1.6 step 5).
fn end(rig: &mut Rig) {
    rig.input(Input::Gpin3, false);
    rig.cycles(1);
    assert!(!gpo1(rig));
}

/// A whole function; how many cycles until GPO1 was high.
fn function(rig: &mut Rig, function: Function) -> u64 {
    begin(rig, function);
    let cycles = rig.until(60_000, gpo1);
    end(rig);
    cycles
}

/// A function that gives a bit at GPO1.
fn read(rig: &mut Rig, function: Function) -> bool {
    begin(rig, function);
    let bit = gpo1(rig);
    end(rig);
    bit
}

fn transmit(rig: &mut Rig, bits: u32, word: u32, [zero, one]: [Function; 2]) {
    for bit in (0..bits).rev() {
        function(rig, if word >> bit & 1 == 0 { zero } else { one });
    }
}

const POSITION: [Function; 2] = [Function::Wr0, Function::Wr1];
const PARAMETER: [Function; 2] = [Function::Wr0Param, Function::Wr1Param];

fn eeprom(rig: &Rig, address: usize) -> u32 {
    let bytes = &rig.drive.program().cells().eeprom()[address..address + 4];
    bytes
        .iter()
        .fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// 13.1.9.1: the marker runs through 0 to 39.
#[test]
fn marker() {
    let mut rig = plc();
    function(&mut rig, Function::DecPz);
    assert_eq!(rig.byte(ram::PZ), 39);
    function(&mut rig, Function::IncPz);
    function(&mut rig, Function::IncPz);
    assert_eq!(rig.byte(ram::PZ), 1);
    function(&mut rig, Function::ClrPz);
    assert_eq!(rig.byte(ram::PZ), 0);
    // Whatever the bus has written, it stays below 40.
    rig.write(ram::PZ, 0xFF);
    function(&mut rig, Function::IncPz);
    assert_eq!(rig.byte(ram::PZ), (255 % 40) + 1);
}

/// 13.1.9.2, 13.1.11: 32 bits, WrEE into the EEPROM, marker on; then RdEEWrPS and StartPS drive there.
#[test]
fn a_position_by_bits_and_a_run() {
    let mut rig = plc();
    transmit(&mut rig, 32, 0x000A_4000, POSITION);
    assert_eq!(rig.byte(ram::BZ), 32);
    let cycles = function(&mut rig, Function::WrEe);
    // Four bytes of 10 ms.
    assert!((93..=95).contains(&cycles), "{cycles}");
    assert_eq!((eeprom(&rig, 0x60), rig.byte(ram::PZ)), (0x000A_4000, 1));
    function(&mut rig, Function::ClrPz);
    function(&mut rig, Function::RdEeWrPs);
    assert_eq!(rig.byte(ram::PZ), 1);
    assert_eq!(rig.byte(ram::PS_STATUS), ps_status::CALCULATED);
    function(&mut rig, Function::StartPs);
    assert_eq!(rig.long(ram::UMDRSOLL), 0x000A_4000);
    // Nothing is loaded any more: StartPS is not carried out (13.1.7.4).
    begin(&mut rig, Function::StartPs);
    rig.run(Span::from_millis(500));
    assert!(!gpo1(&rig));
    end(&mut rig);
}

/// 13.1.13: stopped in mid-run; WrPS reloads the transmitted position, StartPS completes the track.
#[test]
fn remaining_track_of_13_1_13() {
    let mut rig = plc();
    transmit(&mut rig, 32, 0x7FF5_C000, POSITION);
    function(&mut rig, Function::WrPs);
    begin(&mut rig, Function::StartPs);
    rig.run(Span::from_millis(200));
    end(&mut rig);
    rig.run(Span::from_millis(500));
    assert_eq!(rig.signed(ram::NIST), 0);
    let here = rig.long(ram::UMDRIST);
    assert!(here < -65_536 && here > -10 * 65_536);
    function(&mut rig, Function::WrPs);
    function(&mut rig, Function::StartPs);
    assert_eq!(rig.long(ram::UMDRSOLL), -0x000A_4000);
}

/// 13.1.9.2: a transmission must not be interrupted by other commands.
#[test]
fn interrupted_transmission() {
    let mut rig = plc();
    transmit(&mut rig, 16, 0xFFFF, POSITION);
    begin(&mut rig, Function::WrPs);
    rig.run(Span::from_millis(100));
    assert!(!gpo1(&rig), "incomplete");
    end(&mut rig);
    transmit(&mut rig, 32, 0x0001_0000, POSITION);
    function(&mut rig, Function::WrPs);
    assert_eq!(rig.long(ram::PS_POSITION_H), 0x0001_0000);
}

/// 13.1.12, 13.1.9.3: stepping with Vtippen as long as GPIN3 is high, then teach-in of the position.
#[test]
fn stepping_and_teach_in() {
    let mut rig = plc();
    begin(&mut rig, Function::TippenPlus);
    assert!(gpo1(&rig), "it has started");
    rig.run(Span::from_millis(500));
    assert_eq!(rig.signed(ram::NIST), 0x179);
    end(&mut rig);
    rig.run(Span::from_millis(300));
    assert_eq!(rig.signed(ram::NIST), 0);
    begin(&mut rig, Function::TippenMinus);
    rig.run(Span::from_millis(1_500));
    assert_eq!(rig.signed(ram::NIST), -0x179);
    end(&mut rig);
    rig.run(Span::from_millis(300));
    let here = rig.long(ram::UMDRIST);
    assert!(here < 0);
    rig.write(ram::PZ, 7);
    function(&mut rig, Function::TeachIn);
    assert_eq!(eeprom(&rig, 0x7C), here.cast_unsigned() & 0x7FFF_FFFF);
    assert_eq!(rig.byte(ram::PZ), 8);
    // Flags2 does the same over the bus (14.4.3).
    rig.set(ram::FLAGS2, flags2::TEACH_IN);
    rig.run(Span::from_millis(60));
    assert_eq!(rig.byte(ram::FLAGS2) & flags2::TEACH_IN, 0);
    assert_eq!(
        (eeprom(&rig, 0x80), rig.byte(ram::PZ)),
        (eeprom(&rig, 0x7C), 9)
    );
}

/// 13.1.4: with bit 0 of SwVersion2 = 0 the analogue input limits the torque while stepping.
#[test]
fn analogue_torque_limit() {
    let mut rig = plc();
    rig.clear(ram::SW_VERSION2, 0x01);
    rig.drive.stimulate(Stimulus::Analogue(2_500));
    begin(&mut rig, Function::TippenPlus);
    assert_eq!(rig.byte(ram::MMAX), 0x74 / 4);
    end(&mut rig);
    assert_eq!(rig.byte(ram::MMAX), 0x74);
}

/// 13.1.6: the example, referencing by the PLC; cut short by GPIN3 = low it stops.
#[test]
fn referencing_by_the_plc() {
    let mut rig = plc();
    let cam = Stimulus::Cam(Input::Gpin4, 65_536, 2 * 65_536);
    rig.drive.stimulate(cam);
    begin(&mut rig, Function::Referenzfahrt);
    rig.run(Span::from_millis(200));
    end(&mut rig);
    assert_eq!(rig.byte(ram::FLAGS2) & flags2::REFERENCING, 0);
    rig.run(Span::from_millis(500));
    function(&mut rig, Function::Referenzfahrt);
    assert_eq!(rig.byte(ram::PS_STATUS), 0x01);
    assert_eq!(rig.long(ram::UMDRSOLL), 0x8000);
}

/// 13.1.9.5: 32 reads, bit 0 first; or the analogue nominal value with bit 4 of HwVersion2 = 0.
#[test]
fn reading_the_position() {
    let mut rig = plc();
    begin(&mut rig, Function::TippenPlus);
    rig.run(Span::from_millis(1_234));
    end(&mut rig);
    rig.run(Span::from_millis(500));
    let here = rig.long(ram::UMDRIST).cast_unsigned();
    assert!(here > 0x1_0000);
    for _ in 0..2 {
        let word = (0..32).fold(0, |word, bit| {
            word | u32::from(read(&mut rig, Function::RdPos)) << bit
        });
        assert_eq!(word, here);
    }
    rig.clear(ram::HW_VERSION2, 0x10);
    rig.drive.stimulate(Stimulus::Analogue(1_000));
    begin(&mut rig, Function::RdPos);
    rig.run(Span::from_millis(1_000));
    // A tenth of VCOlin x 60, in steps of 10 V / 2048: 298.8 rpm.
    assert!((rig.signed(ram::NIST) - 1_128).abs() <= 1);
    end(&mut rig);
}

/// 13.1.7.4, 13.1.7.5: Leitungstest causes 602, RdError reads its 12 bits, the 13th read confirms it.
#[test]
fn line_test_and_reading_the_error() {
    let mut rig = plc();
    let code = |rig: &mut Rig| {
        (0..12).fold(0, |code, bit| {
            code | u16::from(read(rig, Function::RdError)) << bit
        })
    };
    assert_eq!(code(&mut rig), 0);
    function(&mut rig, Function::ClrPz);
    begin(&mut rig, Function::Leitungstest);
    rig.cycles(1);
    assert_eq!(rig.drive.shown().mode, Mode::Error);
    assert_eq!(rig.drive.shown().display, Some([6, 0, 2]));
    end(&mut rig);
    assert_eq!(code(&mut rig), 0x602);
    assert_eq!(rig.byte(ram::STATUS) & status::ERROR, status::ERROR);
    function(&mut rig, Function::RdError);
    assert_eq!(rig.byte(ram::STATUS) & status::ERROR, 0);
    assert_eq!(rig.word(ram::ERRORCODE), 0);
}

/// 13.1.7.5: the parameter buffer goes to the cells; 13.1.3.3: WaitPS; InitPS.
#[test]
fn parameters_wait_and_init() {
    let mut rig = plc();
    transmit(&mut rig, 16, 0x1234, PARAMETER);
    function(&mut rig, Function::WrNMax);
    assert_eq!(
        (rig.word(ram::N_MAX), rig.word(ram::PS_V0)),
        (0x1234, 0x1234)
    );
    transmit(&mut rig, 16, 0x0100, PARAMETER);
    function(&mut rig, Function::WrVtippen);
    assert_eq!(rig.word(ram::VTIPPEN), 0x0100);
    transmit(&mut rig, 16, 0x0007, PARAMETER);
    function(&mut rig, Function::WrNRampe);
    assert_eq!(
        (rig.word(ram::N_RAMPE_MINUS), rig.word(ram::N_RAMPE_PLUS)),
        (7, 7)
    );
    transmit(&mut rig, 16, 0x5028, PARAMETER);
    function(&mut rig, Function::WrI);
    assert_eq!((rig.byte(ram::IMAX), rig.byte(ram::I0)), (0x50, 0x28));

    begin(&mut rig, Function::WaitPs);
    rig.run(Span::from_millis(100));
    assert!(!gpo1(&rig));
    rig.write_word(ram::PS_POSITION_H, 1);
    rig.set(ram::FLAGS2, flags2::CALCULATE);
    rig.until(100, gpo1);
    end(&mut rig);
    function(&mut rig, Function::InitPs);
    assert_eq!(rig.byte(ram::PS_STATUS), 0x01);
}

/// 13.1.7.4: if the regulator is blocked, the calculation waits for its release.
#[test]
fn calculation_waits_for_the_release() {
    let mut rig = plc();
    transmit(&mut rig, 32, 0x0001_0000, POSITION);
    rig.input(Input::Gpin5, false);
    begin(&mut rig, Function::WrPs);
    rig.run(Span::from_millis(200));
    assert!(!gpo1(&rig));
    rig.input(Input::Gpin5, true);
    rig.until(100, gpo1);
    end(&mut rig);
}

/// 13.1.8: without bit 3 of HwVersion nothing of this happens; and codes without a function do nothing.
#[test]
fn not_active_and_no_function() {
    let mut rig = plc();
    for switch in [Input::Gpin8, Input::Gpin7] {
        rig.input(switch, true);
    }
    rig.input(Input::Gpin3, true);
    rig.run(Span::from_millis(10));
    assert!(!gpo1(&rig));
    rig.input(Input::Gpin3, false);
    rig.cycles(1);
    rig.clear(ram::HW_VERSION, 0x08);
    for (switch, high) in Function::IncPz.levels() {
        rig.input(switch, high);
    }
    rig.input(Input::Gpin3, true);
    rig.cycles(2);
    assert_eq!((gpo1(&rig), rig.byte(ram::PZ)), (false, 0));
}

/// ND21 14.11.2: power that fails while a position is stored is found by the self-test, until something has
/// been written again.
#[test]
fn power_failure_in_mid_write() {
    let mut rig = plc();
    transmit(&mut rig, 32, 0x000A_4000, POSITION);
    begin(&mut rig, Function::WrEe);
    // Two bytes of 10 ms are written, the third is lost, the fourth is as it was.
    rig.run(Span::from_millis(25));
    harness_sim::novobus::device::Device::power_on(&mut rig.drive, rig.now);
    assert_eq!(
        (rig.word(ram::ERRORCODE), eeprom(&rig, 0x60)),
        (0x0102, 0x000A_FF00)
    );
    harness_sim::novobus::device::Device::power_on(&mut rig.drive, rig.now);
    assert_eq!(rig.word(ram::ERRORCODE), 0x0102);
    rig.write_word(ram::EEPROM_BUFFER, 0x6000);
    rig.write(ram::EEPROM_CONTROL, 0x82);
    rig.run(Span::from_millis(20));
    harness_sim::novobus::device::Device::power_on(&mut rig.drive, rig.now);
    assert_eq!(rig.word(ram::ERRORCODE), 0);
}

/// 13.1.9.2, 13.1.9.4: nothing is loaded, stored or written without a whole transmission, be it interrupted or
/// never begun.
#[test]
fn without_a_whole_transmission() {
    let mut rig = plc();
    for refused in [
        Function::WrPs,
        Function::WrEe,
        Function::WrNMax,
        Function::WrI,
    ] {
        let before = (rig.word(ram::N_MAX), rig.byte(ram::IMAX));
        begin(&mut rig, refused);
        rig.cycles(1_000);
        assert!(!gpo1(&rig), "{refused:?}");
        end(&mut rig);
        assert_eq!((rig.word(ram::N_MAX), rig.byte(ram::IMAX)), before);
    }
    assert_eq!((eeprom(&rig, 0x60), rig.byte(ram::PZ)), (0, 0));
}

/// 13.1.7.4: the 13th read confirms the error whose code has been read, not one that has come since.
#[test]
fn another_error_while_one_is_read() {
    let mut rig = plc();
    function(&mut rig, Function::Leitungstest);
    let mut code = 0_u16;
    for bit in 0..12 {
        code |= u16::from(read(&mut rig, Function::RdError)) << bit;
        if bit == 5 {
            rig.write_word(ram::ERRORCODE, 0x0600);
        }
    }
    assert_eq!(code, 0x0602);
    read(&mut rig, Function::RdError);
    assert_ne!(rig.byte(ram::STATUS) & status::ERROR, 0);
}
