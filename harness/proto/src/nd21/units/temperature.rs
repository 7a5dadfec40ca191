//! The temperature of the cooler and the resistance of the motor's sensor.

use super::{Ratio, Reason, UnitError, check};
use crate::ratio::round_div;

const COOLER_WHAT: (&str, &str) = ("cooler temperature", "14.5.7.1");
const SENSOR_WHAT: (&str, &str) = ("resistance of the motor sensor in ohm", "14.5.7.2");

/// The coldest and the hottest whole degree that a raw value stands for.
const COOLER_RANGE: (i32, i32) = (-52, 415);

/// `TempKK`: the resistance of the cooler's sensor as a part of that at 25 °C, `temp` of ND21
/// 14.5.7.1.
///
/// The signs of the formula are out of place in the print. Its parts make 0,27 x tempKK / (1 - tempKK /
/// 256), with which no raw value lies above 61 °C. Read here as 0,27 x tempKK / (256 - tempKK), a
/// voltage divider with the sensor on the low side, as the formula of the motor's sensor is one (14.5.7.2).
///
/// # Errors
/// Raw 0: no resistance, so no temperature.
pub fn cooler_resistance(raw: u8) -> Result<Ratio, UnitError> {
    check(COOLER_WHAT, i32::from(raw), 1, 0xFF)?;
    let raw = i64::from(raw);
    Ok(Ratio::of(27 * raw, 100 * (256 - raw)))
}

/// `TempKK`, `MaxTempKK`: the temperature of the cooler in °C (ND21 14.5.7.1). The sensor's resistance
/// falls with the temperature, so a smaller raw value is a hotter cooler.
///
/// # Errors
/// Raw 0, see [`cooler_resistance`].
pub fn cooler_from_raw(raw: u8) -> Result<f64, UnitError> {
    let resistance = cooler_resistance(raw)?.to_f64();
    Ok(1.0 / (ln(resistance) / 3_600.0 + 1.0 / 298.0) - 273.0)
}

/// The raw value nearest to a temperature of the cooler in °C (ND21 14.5.7.1).
///
/// # Errors
/// Less than -52 °C or more than 415 °C.
pub fn cooler_to_raw(celsius: Ratio) -> Result<u8, UnitError> {
    let (least, most) = COOLER_RANGE;
    let (least, most) = (Ratio::whole(least), Ratio::whole(most));
    if celsius < least {
        return Err(UnitError::new(COOLER_WHAT, celsius, Reason::Below(least)));
    } else if celsius > most {
        return Err(UnitError::new(COOLER_WHAT, celsius, Reason::Above(most)));
    }
    let wanted = celsius.to_f64();
    let (mut best, mut best_distance) = (1, f64::INFINITY);
    for raw in 1..=u8::MAX {
        let distance = (cooler_from_raw(raw)? - wanted).abs();
        if distance < best_distance {
            (best, best_distance) = (raw, distance);
        }
    }
    Ok(best)
}

/// `TempMot`, `MaxTempMot`: the resistance of the sensor in the motor in ohm (ND21 14.5.7.2). The
/// temperature follows from the characteristic of the sensor.
///
/// # Errors
/// Less than 6, where the formula gives less than 0 ohm, or more than 251, where it passes infinity.
pub fn motor_sensor_from_raw(raw: u8) -> Result<Ratio, UnitError> {
    check(SENSOR_WHAT, i32::from(raw), 6, 251)?;
    let raw = i64::from(raw);
    // Numerator and denominator of the print, doubled: it has 1298,5.
    Ok(Ratio::of(
        2_454_134 * raw - 14_361_600,
        652_800 - 2_597 * raw,
    ))
}

/// The raw value of a resistance in ohm (ND21 14.5.7.2).
///
/// # Errors
/// Less than 0 ohm.
pub fn motor_sensor_to_raw(ohm: Ratio) -> Result<u8, UnitError> {
    let below = UnitError::new(SENSOR_WHAT, ohm, Reason::Below(Ratio::ZERO));
    if ohm < Ratio::ZERO {
        return Err(below);
    }
    let (n, d) = (i128::from(ohm.numerator()), i128::from(ohm.denominator()));
    let raw = round_div(652_800 * n + 14_361_600 * d, 2_597 * n + 2_454_134 * d);
    u8::try_from(raw).map_err(|_| below)
}

/// The natural logarithm of a normal positive number, to about 15 digits; `core` has none.
fn ln(x: f64) -> f64 {
    const FRACTION: u64 = (1 << 52) - 1;
    const EXPONENT_OF_1: u64 = 1023;
    // x = fraction x 2^exponent, with the fraction between the root of a half and the root of 2.
    let bits = x.to_bits();
    let mut fraction = f64::from_bits(bits & FRACTION | EXPONENT_OF_1 << 52);
    let mut exponent = f64::from((bits >> 52) as u32) - 1023.0;
    if fraction > core::f64::consts::SQRT_2 {
        fraction /= 2.0;
        exponent += 1.0;
    }
    // ln f = 2 (s + s^3 / 3 + s^5 / 5 + ...), s = (f - 1) / (f + 1), at most 0.172.
    let s = (fraction - 1.0) / (fraction + 1.0);
    let mut sum = 0.0;
    for i in (0..12_u32).rev() {
        sum = sum * s * s + 1.0 / f64::from(2 * i + 1);
    }
    exponent * core::f64::consts::LN_2 + 2.0 * s * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm() {
        for (x, expected) in [
            (1.0, 0.0),
            (core::f64::consts::E, 1.0),
            (10.0, core::f64::consts::LN_10),
            (0.5, -core::f64::consts::LN_2),
            (1e-3, -3.0 * core::f64::consts::LN_10),
            (1e6, 6.0 * core::f64::consts::LN_10),
        ] {
            assert!((ln(x) - expected).abs() < 1e-13, "{x}");
        }
    }

    /// ND21 14.5.7.1: 298 K is the temperature of the full resistance, and the raw values from 25 °C to
    /// the 85 °C of 4.2.2 are spread over the byte.
    #[test]
    fn cooler_of_14_5_7_1() {
        let at = |celsius| cooler_to_raw(Ratio::whole(celsius)).unwrap();
        assert_eq!([at(25), at(45), at(65), at(85)], [202, 162, 120, 84]);
        for raw in 2..=u8::MAX {
            assert!(cooler_from_raw(raw).unwrap() < cooler_from_raw(raw - 1).unwrap());
        }
        assert!(cooler_from_raw(0).is_err());
        assert!(cooler_to_raw(Ratio::whole(-53)).is_err());
        assert!(cooler_to_raw(Ratio::whole(416)).is_err());
    }

    /// ND21 14.5.7.1 cannot be meant as printed (E114): tempKK / (1 - tempKK / 256) has
    /// no raw value for the 65 °C to 85 °C of 4.2.2, and half of the raw values lie below -50 °C.
    #[test]
    fn cooler_as_printed_has_no_resolution() {
        let printed = |raw: f64| {
            let resistance = raw / (1.0 - raw / 256.0) * 0.27;
            1.0 / (ln(resistance) / 3_600.0 + 1.0 / 298.0) - 273.0
        };
        assert!(printed(1.0) < 65.0);
        assert!(printed(7.0) < 10.0);
        assert!(printed(128.0) < -50.0);
    }

    /// ND21 14.5.7.2: the formula is a divider of 4700 ohm with 22 ohm in the sensor's line; all four
    /// printed constants fit, which confirms the reading.
    #[test]
    fn motor_sensor_of_14_5_7_2_is_a_divider() {
        assert_eq!(7_180_800, 22 * 326_400);
        assert_eq!(1_227_067 * 2, 2 * 255 * 4_700 + 22 * 2_597);
        for raw in 6..=251 {
            let ohm = motor_sensor_from_raw(raw).unwrap().to_f64();
            let t = f64::from(raw);
            let divider = 4_700.0 * 255.0 * t / (255.0 * 1_280.0 - 1_298.5 * t) - 22.0;
            assert!((ohm - divider).abs() < 1e-6 * divider.abs() + 1e-6, "{raw}");
        }
    }

    #[test]
    fn motor_sensor_range() {
        assert!(motor_sensor_from_raw(5).is_err());
        assert!(motor_sensor_from_raw(252).is_err());
        assert!(motor_sensor_to_raw(Ratio::whole(-1)).is_err());
        for raw in 6..=251 {
            let ohm = motor_sensor_from_raw(raw).unwrap();
            assert!(ohm > Ratio::ZERO);
            assert_eq!(motor_sensor_to_raw(ohm), Ok(raw));
        }
        assert_eq!(motor_sensor_to_raw(Ratio::whole(i32::MAX)), Ok(251));
    }

    #[test]
    fn every_cooler_value_comes_back() {
        for raw in 2..255 {
            let celsius = cooler_from_raw(raw).unwrap();
            #[expect(clippy::cast_possible_truncation, reason = "far below 2^63")]
            let celsius = Ratio::decimal((celsius * 1e9) as i64, 9).unwrap();
            assert_eq!(cooler_to_raw(celsius), Ok(raw));
        }
    }
}
