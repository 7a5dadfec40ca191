//! Currents and torque: scales by type of device, and the constant of the back EMF.

use super::{DriveType, Ratio, UnitError, check, encode};

const MOMENTARY_WHAT: (&str, &str) = ("motor current in A", "14.5.1.1");
const EFFECTIVE_WHAT: (&str, &str) = ("current limit in Aeff", "14.5.1.2");
const LIMIT_WHAT: (&str, &str) = ("torque limit in Aeff", "14.5.2");
const TORQUE_WHAT: (&str, &str) = ("torque in Aeff", "14.5.2");
const EMF_WHAT: (&str, &str) = ("voltage of the motor in V per 1000 rpm", "14.6.2");

/// V per 1000 rpm and bit: `emk0` = 0.38636 x voltage.
const EMF: Ratio = Ratio::of(100_000, 38_636);

/// A per bit, momentary value. The print says Aeff; it is the square root of 2 times the factor of
/// 14.5.1.2 (E93).
const fn momentary_scale(device: DriveType) -> Ratio {
    Ratio::of(device.pick([122, 244, 355, 488]) as i64, 1_000)
}

/// Aeff per bit.
const fn effective_scale(device: DriveType) -> Ratio {
    Ratio::of(device.pick([86, 172, 251, 345]) as i64, 1_000)
}

/// Aeff per bit; the print has mAeff.
const fn torque_scale(device: DriveType) -> Ratio {
    Ratio::of(device.pick([336, 671, 980, 1_347]) as i64, 1_000_000)
}

/// `iaist`, `ibist`, `iasoll`, `ibsoll`: the momentary current of a phase in A (ND21 14.5.1.1).
#[must_use]
pub const fn momentary_current_from_raw(raw: i8, device: DriveType) -> Ratio {
    momentary_scale(device).times(raw as i32)
}

/// The raw value of a momentary current in A (ND21 14.5.1.1); the trigger threshold needs it (ND21
/// 14.10.6.3).
///
/// # Errors
/// More than a signed byte holds, about 128 times the scale.
pub fn momentary_current_to_raw(amperes: Ratio, device: DriveType) -> Result<i8, UnitError> {
    let scale = momentary_scale(device);
    encode(MOMENTARY_WHAT, amperes, scale, -0x80, 0x7F)
}

/// The greatest raw value of `imax` and `i0` (ND21 14.5.1.2). H'52 of the 5615 is as printed, though
/// it stands for more than the peak current of 4.2.2; H'50 would fit (E94, open).
#[must_use]
pub const fn limit_maximum_raw(device: DriveType) -> u8 {
    match device {
        DriveType::Nd5605 | DriveType::Nd5610 | DriveType::Nd5620 => 0x74,
        DriveType::Nd5615 => 0x52,
    }
}

/// `imax`, `i0`: the peak and the rated current in Aeff (ND21 14.5.1.2).
///
/// # Errors
/// More than [`limit_maximum_raw`].
pub fn effective_current_from_raw(raw: u8, device: DriveType) -> Result<Ratio, UnitError> {
    let (raw, most) = (i32::from(raw), i32::from(limit_maximum_raw(device)));
    check(EFFECTIVE_WHAT, raw, 0, most)?;
    Ok(effective_scale(device).times(raw))
}

/// The raw value of a current limit in Aeff (ND21 14.5.1.2).
///
/// # Errors
/// Less than 0, or more than [`limit_maximum_raw`] stands for.
pub fn effective_current_to_raw(amperes: Ratio, device: DriveType) -> Result<u8, UnitError> {
    let most = i32::from(limit_maximum_raw(device));
    encode(EFFECTIVE_WHAT, amperes, effective_scale(device), 0, most)
}

/// `mmax`: the limit of the torque as a current in Aeff (ND21 14.5.2; "inertia" means torque, E95).
#[must_use]
pub const fn torque_limit_from_raw(raw: i8, device: DriveType) -> Ratio {
    effective_scale(device).times(raw as i32)
}

/// The raw value of a torque limit in Aeff (ND21 14.5.2).
///
/// # Errors
/// More than a signed byte holds.
pub fn torque_limit_to_raw(amperes: Ratio, device: DriveType) -> Result<i8, UnitError> {
    let scale = effective_scale(device);
    encode(LIMIT_WHAT, amperes, scale, -0x80, 0x7F)
}

/// `msoll`: the nominal torque as a current in Aeff (ND21 14.5.2; "inertia" means torque, E95).
#[must_use]
pub const fn torque_from_raw(raw: i16, device: DriveType) -> Ratio {
    torque_scale(device).times(raw as i32)
}

/// The raw value of a nominal torque in Aeff (ND21 14.5.2).
///
/// # Errors
/// More than a signed word holds.
pub fn torque_to_raw(amperes: Ratio, device: DriveType) -> Result<i16, UnitError> {
    let scale = torque_scale(device);
    encode(TORQUE_WHAT, amperes, scale, -0x8000, 0x7FFF)
}

/// `emk0`: the voltage of the motor in V per 1000 rpm (ND21 14.6.2).
#[must_use]
pub const fn emf_from_raw(raw: u8) -> Ratio {
    EMF.times(raw as i32)
}

/// The raw value of a motor's voltage in V per 1000 rpm (ND21 14.6.2).
///
/// # Errors
/// Less than 0 or more than 660 V.
pub fn emf_to_raw(volts: Ratio) -> Result<u8, UnitError> {
    encode(EMF_WHAT, volts, EMF, 0, 0xFF)
}

#[cfg(test)]
mod tests {
    use super::super::Reason;
    use super::*;

    fn near(exact: f64, printed: f64, half_digit: f64) -> bool {
        (exact - printed).abs() <= half_digit
    }

    /// ND21 14.10.6.1: on a 5610, H'4C is +18,5 A, and H'C8 is -13,7 A (printed without the sign, E105).
    #[test]
    fn examples_of_14_10_6_1() {
        let current = |raw: u8| momentary_current_from_raw(raw.cast_signed(), DriveType::Nd5610);
        assert!(near(current(0x4C).to_f64(), 18.5, 0.05));
        assert!(near(current(0xC8).to_f64(), -13.7, 0.05));
    }

    /// ND21 14.10.6.3: 7 A are 29 bits, H'1D, on a 5610; -7 A are H'E3.
    #[test]
    fn example_of_14_10_6_3() {
        let raw = |amperes| momentary_current_to_raw(Ratio::whole(amperes), DriveType::Nd5610);
        assert_eq!(raw(7), Ok(0x1D));
        assert_eq!(raw(-7).unwrap().cast_unsigned(), 0xE3);
        assert!(raw(32).is_err());
    }

    /// ND21 14.5.1.1: the factors are momentary values, not effective ones (E93).
    #[test]
    fn momentary_scale_is_root_2_times_the_effective_e93() {
        for device in DriveType::ALL {
            let effective = effective_scale(device).to_f64();
            let printed = momentary_scale(device).to_f64();
            // Both factors are rounded to a thousandth.
            let expected = effective * core::f64::consts::SQRT_2;
            assert!(near(expected, printed, 0.0005 + 0.0008), "{device:?}");
            assert!(!near(effective, printed, 0.03), "{device:?}");
        }
    }

    /// ND21 14.5.1.2, 4.2.2: the maximum stands for the peak current, but for H'52 of the 5615 (E94).
    #[test]
    fn maximum_is_the_peak_current_but_for_e94() {
        for device in DriveType::ALL {
            let most = limit_maximum_raw(device);
            let current = effective_current_from_raw(most, device).unwrap().to_f64();
            let peak = f64::from(device.peak_current());
            let misprinted = device == DriveType::Nd5615;
            assert_eq!(near(current, peak, 0.1), !misprinted, "{device:?}");
            let error = effective_current_from_raw(most + 1, device).unwrap_err();
            assert_eq!(error.reason, Reason::Above(Ratio::whole(most.into())));
        }
        let fitting = effective_current_from_raw(0x50, DriveType::Nd5615).unwrap();
        assert!(near(fitting.to_f64(), 20.0, 0.1));
    }

    /// ND21 14.5.2: `mmax` is scaled as `imax`, and a bit of it is 256 bits of `msoll`.
    #[test]
    fn torque_scales_of_14_5_2() {
        for device in DriveType::ALL {
            let limit = torque_limit_from_raw(1, device).to_f64();
            let torque = torque_from_raw(256, device).to_f64();
            // Rounded to 1 mA there, to 0.001 mA here.
            assert!(near(torque, limit, 0.0005 + 0.000_128), "{device:?}");
        }
        assert_eq!(
            torque_from_raw(1_000, DriveType::Nd5620),
            Ratio::of(1_347, 1_000)
        );
    }

    /// ND21 14.6.2: emk0 = 0.38636 x V per 1000 rpm.
    #[test]
    fn emf_of_14_6_2() {
        assert_eq!(emf_to_raw(Ratio::whole(100)), Ok(39));
        assert!(near(emf_from_raw(0xFF).to_f64(), 660.01, 0.005));
        assert!(emf_to_raw(Ratio::whole(662)).is_err());
        assert!(emf_to_raw(Ratio::whole(-2)).is_err());
    }

    #[test]
    fn every_raw_value_comes_back() {
        for device in DriveType::ALL {
            for raw in i8::MIN..=i8::MAX {
                let current = momentary_current_from_raw(raw, device);
                assert_eq!(momentary_current_to_raw(current, device), Ok(raw));
                let limit = torque_limit_from_raw(raw, device);
                assert_eq!(torque_limit_to_raw(limit, device), Ok(raw));
            }
            for raw in 0..=limit_maximum_raw(device) {
                let current = effective_current_from_raw(raw, device).unwrap();
                assert_eq!(effective_current_to_raw(current, device), Ok(raw));
            }
            for raw in i16::MIN..=i16::MAX {
                let torque = torque_from_raw(raw, device);
                assert_eq!(torque_to_raw(torque, device), Ok(raw));
            }
        }
        for raw in 0..=u8::MAX {
            assert_eq!(emf_to_raw(emf_from_raw(raw)), Ok(raw));
        }
    }
}
