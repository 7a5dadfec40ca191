//! Speeds, ramps, angles, and what else is measured in turns and cycles.

use super::{Ratio, Reason, SpeedRange, UnitError, check, encode};
use crate::ratio::round_div;

/// The cycle of the speed and position regulators in microseconds (ND21 4.1).
pub const CYCLE_US: u32 = 432;
/// The increments of one turn of the rotor (ND21 13.1.9).
pub const INCREMENTS_PER_TURN: u32 = 65_536;
/// The ramp that is no ramp (ND21 14.7.3).
pub const RAMP_OFF: u16 = 0x7FFF;
/// The slipping error that is never reached (ND21 14.5.6).
pub const SLIPPING_OFF: u16 = 0x8000;

/// One increment a cycle, in rpm: 60 s / (432 us x 65536).
const INCREMENT_RPM: Ratio =
    Ratio::of(60 * 1_000_000, CYCLE_US as i64 * INCREMENTS_PER_TURN as i64);
const ANGLE: Ratio = Ratio::of(1, INCREMENTS_PER_TURN as i64);
const SLIPPING: Ratio = Ratio::of(1, 256);
const ANALOGUE: Ratio = Ratio::of(60, 1);

const SPEED_WHAT: (&str, &str) = ("spin speed in rpm", "14.5.3.1");
const MAX_SPEED_WHAT: (&str, &str) = ("maximum speed in rpm", "14.5.3.2");
const RAMP_WHAT: (&str, &str) = ("ramp in rpm/s", "14.5.4");
const ANGLE_WHAT: (&str, &str) = ("rotor angle in turns", "14.6.6");
const TURNS_WHAT: (&str, &str) = ("position in turns", "14.5.5");
const SLIPPING_WHAT: (&str, &str) = ("slipping error in turns", "14.5.6");
const FILTER_WHAT: (&str, &str) = ("tacho filter in us", "14.6.3");
const ANALOGUE_WHAT: (&str, &str) = ("speed at 10 V in rpm", "14.7.2");
const IMPULSES_WHAT: (&str, &str) = ("impulses per rotation", "14.7.3");

/// A limit that one raw value switches off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switched {
    /// There is no limit.
    Off,
    /// The limit.
    On(Ratio),
}

/// rpm per bit: an eighth of an increment a cycle, or a quarter.
const fn speed_scale(range: SpeedRange) -> Ratio {
    Ratio::of(
        INCREMENT_RPM.numerator(),
        INCREMENT_RPM.denominator() * range.parts() as i64,
    )
}

/// rpm/s per bit: one bit of speed a cycle.
const fn ramp_scale(range: SpeedRange) -> Ratio {
    let speed = speed_scale(range);
    Ratio::of(
        speed.numerator() * 1_000_000,
        speed.denominator() * CYCLE_US as i64,
    )
}

/// `nist`, `nsoll`, `nsollrampe`: the speed in rpm (ND21 14.5.3.1), with its sign.
#[must_use]
pub const fn speed_from_raw(raw: i16, range: SpeedRange) -> Ratio {
    speed_scale(range).times(raw as i32)
}

/// The raw value of a speed in rpm (ND21 14.5.3.1).
///
/// # Errors
/// More than the 8000 or 12000 rpm of the range (ND21 14.3.2), in either direction.
pub fn speed_to_raw(rpm: Ratio, range: SpeedRange) -> Result<i16, UnitError> {
    let limit = range.limit();
    within(SPEED_WHAT, rpm, -limit, limit)?;
    let (least, most) = (i32::from(i16::MIN), i32::from(i16::MAX));
    encode(SPEED_WHAT, rpm, speed_scale(range), least, most)
}

/// `nMax`: the maximum speed in rpm (ND21 14.5.3.2).
///
/// # Errors
/// More than H'7FFF: no speed of 14.5.3.1 is greater.
pub fn max_speed_from_raw(raw: u16, range: SpeedRange) -> Result<Ratio, UnitError> {
    let raw = i32::from(raw);
    check(MAX_SPEED_WHAT, raw, 0, 0x7FFF)?;
    Ok(speed_scale(range).times(raw))
}

/// The raw value of a maximum speed in rpm (ND21 14.5.3.2).
///
/// # Errors
/// Less than 0, or more than the 8000 or 12000 rpm of the range (ND21 14.3.2).
pub fn max_speed_to_raw(rpm: Ratio, range: SpeedRange) -> Result<u16, UnitError> {
    within(MAX_SPEED_WHAT, rpm, 0, range.limit())?;
    encode(MAX_SPEED_WHAT, rpm, speed_scale(range), 0, 0x7FFF)
}

/// `nRampe+`, `nRampe-`: the change of speed in rpm per second (ND21 14.5.4). H'7FFF: no ramp (ND21
/// 14.7.3).
///
/// # Errors
/// More than H'7FFF, to which the manual gives no meaning.
pub fn ramp_from_raw(raw: u16, range: SpeedRange) -> Result<Switched, UnitError> {
    if raw == RAMP_OFF {
        return Ok(Switched::Off);
    }
    let raw = i32::from(raw);
    check(RAMP_WHAT, raw, 0, 0x7FFF)?;
    Ok(Switched::On(ramp_scale(range).times(raw)))
}

/// The raw value of a ramp in rpm per second (ND21 14.5.4).
///
/// # Errors
/// Less than 0, or more than H'7FFE stands for.
pub fn ramp_to_raw(ramp: Switched, range: SpeedRange) -> Result<u16, UnitError> {
    match ramp {
        Switched::Off => Ok(RAMP_OFF),
        Switched::On(ramp) => encode(RAMP_WHAT, ramp, ramp_scale(range), 0, 0x7FFE),
    }
}

/// A ramp in rad/s², the unit of ND21 14.5.4, from rpm per second.
#[must_use]
pub const fn ramp_in_radians(rpm_per_second: Ratio) -> f64 {
    rpm_per_second.to_f64() * (core::f64::consts::TAU / 60.0)
}

/// `umdrist` with `lageist` and `umdrsoll` with `lagesoll`, each pair one double word: the position in
/// turns, 65536 increments each (ND21 14.5.5).
#[must_use]
pub const fn turns_from_raw(raw: i32) -> Ratio {
    ANGLE.times(raw)
}

/// The double word of a position in turns (ND21 14.5.5).
///
/// # Errors
/// Less than -32768 turns, or 32768 turns and more.
pub fn turns_to_raw(turns: Ratio) -> Result<i32, UnitError> {
    encode(TURNS_WHAT, turns, ANGLE, i32::MIN, i32::MAX)
}

/// `dRESOLVER`, `dLage`, `RefLage` and the low words of 14.5.5: the angle in turns, from 0 to less
/// than 1 (ND21 14.6.6).
#[must_use]
pub const fn angle_from_raw(raw: u16) -> Ratio {
    ANGLE.times(raw as i32)
}

/// The word of an angle in turns (ND21 14.6.6).
///
/// # Errors
/// Less than 0 or nearer to 1 than to H'FFFF.
pub fn angle_to_raw(turns: Ratio) -> Result<u16, UnitError> {
    encode(ANGLE_WHAT, turns, ANGLE, 0, 0xFFFF)
}

/// `Slipping error`: the slip in turns at which the end phase is blocked; a bit is 1/256 turn (ND21
/// 14.5.6). H'8000: never.
///
/// # Errors
/// More than H'8000, to which the manual gives no meaning.
pub fn slipping_error_from_raw(raw: u16) -> Result<Switched, UnitError> {
    if raw == SLIPPING_OFF {
        return Ok(Switched::Off);
    }
    let raw = i32::from(raw);
    check(SLIPPING_WHAT, raw, 0, 0x8000)?;
    Ok(Switched::On(SLIPPING.times(raw)))
}

/// The raw value of a slip in turns (ND21 14.5.6).
///
/// # Errors
/// Less than 0, or more than H'7FFF stands for.
pub fn slipping_error_to_raw(slip: Switched) -> Result<u16, UnitError> {
    match slip {
        Switched::Off => Ok(SLIPPING_OFF),
        Switched::On(turns) => encode(SLIPPING_WHAT, turns, SLIPPING, 0, 0x7FFF),
    }
}

/// An angle in rad, the unit of ND21 14.5.6, from turns.
#[must_use]
pub const fn turns_in_radians(turns: Ratio) -> f64 {
    turns.to_f64() * core::f64::consts::TAU
}

/// `nFilter`: the time constant in us of the filter of the actual speed, 432 us / (1 - nFilter / 128)
/// (ND21 14.6.3).
///
/// # Errors
/// More than H'7F.
pub fn tacho_filter_from_raw(raw: u8) -> Result<Ratio, UnitError> {
    check(FILTER_WHAT, i32::from(raw), 0, 0x7F)?;
    Ok(Ratio::of(i64::from(CYCLE_US) * 128, 128 - i64::from(raw)))
}

/// The raw value of a time constant in us (ND21 14.6.3).
///
/// # Errors
/// Less than 432 us, which is no filter, or more than 55296 us.
pub fn tacho_filter_to_raw(us: Ratio) -> Result<u8, UnitError> {
    within(FILTER_WHAT, us, 432, 432 * 128)?;
    let (n, d) = (i128::from(us.numerator()), i128::from(us.denominator()));
    let raw = round_div(128 * n - i128::from(CYCLE_US) * 128 * d, n);
    let most = Ratio::whole(432 * 128);
    u8::try_from(raw).map_err(|_| UnitError::new(FILTER_WHAT, us, Reason::Above(most)))
}

/// `VCOlin` with the analogue input: the speed in rpm at 10 V, "approx." (ND21 14.7.2).
#[must_use]
pub const fn analogue_speed_from_raw(raw: u8) -> Ratio {
    ANALOGUE.times(raw as i32)
}

/// `VCOlin` for a speed in rpm at 10 V (ND21 14.7.2).
///
/// # Errors
/// Less than 0 or more than 15300 rpm.
pub fn analogue_speed_to_raw(rpm: Ratio) -> Result<u8, UnitError> {
    encode(ANALOGUE_WHAT, rpm, ANALOGUE, 0, 0xFF)
}

/// `VCOlin` and `VCOlinL` as one word with the frequency input: the impulses per rotation (ND21
/// 14.7.3).
///
/// # Errors
/// The word 0.
pub fn impulses_from_raw(word: u16) -> Result<Ratio, UnitError> {
    check(IMPULSES_WHAT, i32::from(word), 1, 0xFFFF)?;
    Ok(Ratio::of(0x200_0000, i64::from(word)))
}

/// Returns the word `VCOlin` x 256 + `VCOlinL` for this number of impulses per rotation (ND21 14.7.3).
///
/// # Errors
/// 512 and less, for which a word is too short, or more than 33554432.
pub fn impulses_to_raw(impulses: Ratio) -> Result<u16, UnitError> {
    let least = Ratio::of(0x200_0000, 0xFFFF);
    let most = Ratio::whole(0x200_0000);
    let above = UnitError::new(IMPULSES_WHAT, impulses, Reason::Above(most));
    if impulses < least {
        let reason = Reason::Below(least);
        return Err(UnitError::new(IMPULSES_WHAT, impulses, reason));
    } else if impulses > most {
        return Err(above);
    }
    let (n, d) = (impulses.numerator(), impulses.denominator());
    u16::try_from(round_div(0x200_0000 * i128::from(d), i128::from(n))).map_err(|_| above)
}

/// Refuses a physical value outside `least..=most`.
fn within(
    what: (&'static str, &'static str),
    value: Ratio,
    least: i32,
    most: i32,
) -> Result<(), UnitError> {
    let (least, most) = (Ratio::whole(least), Ratio::whole(most));
    if value < least {
        Err(UnitError::new(what, value, Reason::Below(least)))
    } else if value > most {
        Err(UnitError::new(what, value, Reason::Above(most)))
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::SpeedRange::{To8000, To12000};
    use super::*;

    /// Whether `printed` is `exact` to `relative`.
    fn near(exact: f64, printed: f64, relative: f64) -> bool {
        (exact - printed).abs() <= printed.abs() * relative
    }

    /// ND21 14.5.3.1 prints 0,264909525 and 0,52981905 rpm: 2,1192762 (one increment a cycle, cut off
    /// after seven places) divided by 8 and by 4. The exact factor is 0,26490953...: the whole range
    /// differs by a thousandth of a bit.
    #[test]
    fn speed_scale_of_14_5_3_1() {
        assert_eq!(speed_scale(To8000), Ratio::of(78_125, 294_912));
        assert!(near(speed_scale(To8000).to_f64(), 0.264_909_525, 3e-8));
        assert!(near(speed_scale(To12000).to_f64(), 0.529_819_05, 3e-8));
        assert!(!near(speed_scale(To8000).to_f64(), 0.264_909_525, 2e-8));
        let increment = INCREMENT_RPM.to_f64();
        assert!(increment > 2.119_276_2 && increment < 2.119_276_3);
        assert!(near(2.119_276_2 / 8.0, 0.264_909_525, 1e-12));
        assert!(near(2.119_276_2 / 4.0, 0.529_819_05, 1e-12));
    }

    /// ND21 14.3.2: the ranges of the two scales hold the speeds that the bit promises.
    #[test]
    fn ranges_of_14_3_2() {
        assert_eq!(SpeedRange::from_sw_version2(0x80), To8000);
        assert_eq!(SpeedRange::from_sw_version2(0x7F), To12000);
        for range in [To8000, To12000] {
            let limit = Ratio::whole(range.limit());
            assert!(speed_from_raw(i16::MAX, range) > limit);
            assert!(speed_to_raw(limit, range).is_ok());
            let above = Ratio::of(i64::from(range.limit()) * 10 + 1, 10);
            let error = speed_to_raw(above, range).unwrap_err();
            assert_eq!(error.reason, Reason::Above(limit));
            assert!(max_speed_to_raw(Ratio::of(-1, 10), range).is_err());
        }
        assert!(max_speed_from_raw(0x7FFF, To8000).is_ok());
        assert!(max_speed_from_raw(0x8000, To8000).is_err());
    }

    /// ND21 14.5.4 prints 64,18332625 and 128,3666525 rad/s² (E96): that is with 3.14 for pi.
    #[test]
    fn ramp_scale_of_14_5_4_is_misprinted_e96() {
        let exact = ramp_in_radians(ramp_scale(To8000));
        assert!(near(exact, 64.2159, 1e-6));
        assert!(!near(exact, 64.183_326_25, 4e-4));
        let with_314 = 0.264_909_525 * 2.0 * (314.0 / 100.0) / 60.0 / 432e-6;
        assert!(near(with_314, 64.183_326_25, 1e-5));
        assert!(near(2.0 * 64.183_326_25, 128.366_652_5, 1e-12));
        assert!(near(ramp_in_radians(ramp_scale(To12000)), 128.4318, 1e-6));
    }

    /// ND21 14.7.3: "The ramp must be deactivated ... H'7FFF".
    #[test]
    fn ramp_off_of_14_7_3() {
        assert_eq!(ramp_from_raw(0x7FFF, To8000), Ok(Switched::Off));
        assert_eq!(ramp_to_raw(Switched::Off, To8000), Ok(0x7FFF));
        assert!(ramp_from_raw(0x8000, To8000).is_err());
        let steepest = ramp_scale(To8000).times(0x7FFF);
        assert!(ramp_to_raw(Switched::On(steepest), To8000).is_err());
    }

    /// ND21 14.5.6: 0.024543692 rad per bit is 2 pi / 256, cut off; H'8000 is off.
    #[test]
    fn slipping_error_of_14_5_6() {
        assert!(near(turns_in_radians(SLIPPING), 0.024_543_692, 5e-8));
        assert_eq!(slipping_error_from_raw(0x8000), Ok(Switched::Off));
        assert!(slipping_error_from_raw(0x8001).is_err());
        assert_eq!(SLIPPING.steps(ANGLE), 256);
    }

    /// ND21 14.6.6: one bit is 1/65536 rotation. 13.1.1 has H'8000 for half a turn (E52).
    #[test]
    fn angle_of_14_6_6() {
        assert_eq!(angle_from_raw(0x8000), Ratio::of(1, 2));
        assert_eq!(angle_to_raw(Ratio::of(1, 4)), Ok(0x4000));
        assert!(angle_to_raw(Ratio::whole(1)).is_err());
        assert!(angle_to_raw(Ratio::of(-1, 4)).is_err());
    }

    /// ND21 14.6.3: from 432 us to 128 times as much.
    #[test]
    fn tacho_filter_of_14_6_3() {
        assert_eq!(tacho_filter_from_raw(0), Ok(Ratio::whole(432)));
        assert_eq!(tacho_filter_from_raw(0x40), Ok(Ratio::whole(864)));
        assert_eq!(tacho_filter_from_raw(0x7F), Ok(Ratio::whole(55_296)));
        assert!(tacho_filter_from_raw(0x80).is_err());
        assert!(tacho_filter_to_raw(Ratio::whole(431)).is_err());
        assert!(tacho_filter_to_raw(Ratio::whole(55_297)).is_err());
        for raw in 0..=0x7F {
            let us = tacho_filter_from_raw(raw).unwrap();
            assert_eq!(tacho_filter_to_raw(us), Ok(raw));
        }
    }

    /// ND21 14.7.2 and 14.7.3. 33554432 is 65536 x 512: the word is the increments per impulse, in
    /// 1/512.
    #[test]
    fn nominal_value_scales_of_14_7() {
        assert_eq!(analogue_speed_to_raw(Ratio::whole(3_000)), Ok(50));
        assert_eq!(analogue_speed_from_raw(50), Ratio::whole(3_000));
        assert!(analogue_speed_to_raw(Ratio::whole(15_331)).is_err());
        assert_eq!(impulses_to_raw(Ratio::whole(1_024)), Ok(0x8000));
        assert_eq!(impulses_from_raw(0x8000), Ok(Ratio::whole(1_024)));
        assert_eq!(impulses_to_raw(Ratio::whole(0x200_0000)), Ok(1));
        assert!(impulses_from_raw(0).is_err());
        for refused in [-1, 0, 512, 0x200_0001] {
            assert!(impulses_to_raw(Ratio::whole(refused)).is_err(), "{refused}");
        }
        assert!(impulses_to_raw(Ratio::whole(513)).is_ok());
    }

    #[test]
    fn every_raw_value_comes_back() {
        for raw in 0..=u16::MAX {
            assert_eq!(angle_to_raw(angle_from_raw(raw)), Ok(raw));
            if let Ok(slip) = slipping_error_from_raw(raw) {
                assert_eq!(slipping_error_to_raw(slip), Ok(raw));
            }
            if raw != 0 {
                let impulses = impulses_from_raw(raw).unwrap();
                assert_eq!(impulses_to_raw(impulses), Ok(raw));
            }
            for range in [To8000, To12000] {
                if let Ok(ramp) = ramp_from_raw(raw, range) {
                    assert_eq!(ramp_to_raw(ramp, range), Ok(raw));
                }
                let signed = raw.cast_signed();
                if let Ok(back) = speed_to_raw(speed_from_raw(signed, range), range) {
                    assert_eq!(back, signed);
                }
            }
        }
        for raw in [i32::MIN, -1, 0, 1, 0x000A_4000, i32::MAX] {
            assert_eq!(turns_to_raw(turns_from_raw(raw)), Ok(raw));
        }
        assert!(turns_to_raw(Ratio::whole(32_768)).is_err());
    }
}
