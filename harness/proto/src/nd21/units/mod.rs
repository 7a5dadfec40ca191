//! From the raw values of the drive's cells to physical values and back (ND21 chapter 14).
//!
//! The functions are pure. Where a scale is an exact rational number, so is the value ([`Ratio`]); only
//! radians and the cooler's temperature are `f64`. Values that a cell cannot hold, and raw values to
//! which the manual gives no meaning, are refused with the reason ([`UnitError`]). A physical value
//! between two raw values goes to the nearer one, a half away from zero.
//!
//! Scales that follow from the cycle of 432 us (ND21 4.1) and the 65536 increments of a turn (ND21
//! 13.1.9) are computed from these; the printed factors are rounded forms of them, and the tests hold
//! one against the other. [`Scale`] says which function belongs to which cell.

mod current;
mod information;
mod motion;
mod scale;
mod scope;
mod temperature;

pub use crate::ratio::Ratio;
pub use current::{
    effective_current_from_raw, effective_current_to_raw, emf_from_raw, emf_to_raw,
    limit_maximum_raw, momentary_current_from_raw, momentary_current_to_raw, torque_from_raw,
    torque_limit_from_raw, torque_limit_to_raw, torque_to_raw,
};
pub use information::{
    Date, current_regulator_i_part, current_regulator_p_part, encoder_impulses, motor_poles,
    operating_hours_from_bytes, operating_hours_to_bytes, serial_number_from_bytes,
    serial_number_to_bytes,
};
pub use motion::{
    CYCLE_US, INCREMENTS_PER_TURN, RAMP_OFF, SLIPPING_OFF, Switched, analogue_speed_from_raw,
    analogue_speed_to_raw, angle_from_raw, angle_to_raw, impulses_from_raw, impulses_to_raw,
    max_speed_from_raw, max_speed_to_raw, ramp_from_raw, ramp_in_radians, ramp_to_raw,
    slipping_error_from_raw, slipping_error_to_raw, speed_from_raw, speed_to_raw,
    tacho_filter_from_raw, tacho_filter_to_raw, turns_from_raw, turns_in_radians, turns_to_raw,
};
pub use scale::{DriveUnits, Scale, Value};
pub use scope::{
    SCOPE_MEASUREMENTS, TriggerDelay, scope_address, scope_period_us, scope_signal, scope_timer0,
    scope_window_us, trigger_delay, trigger_level_from_raw, trigger_level_to_raw,
};
pub use temperature::{
    cooler_from_raw, cooler_resistance, cooler_to_raw, motor_sensor_from_raw, motor_sensor_to_raw,
};

use crate::ratio::round_div;
use core::fmt;

/// The type of the device, on which the scales of the currents depend (ND21 4.2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DriveType {
    /// ND21-5605: 5 A rated, 10 A peak.
    Nd5605,
    /// ND21-5610: 10 A rated, 20 A peak.
    Nd5610,
    /// ND21-5615: 15 A rated, 20 A peak.
    Nd5615,
    /// ND21-5620: 20 A rated, 40 A peak.
    Nd5620,
}

impl DriveType {
    /// All of them, in the order of the manual's columns.
    pub const ALL: [Self; 4] = [Self::Nd5605, Self::Nd5610, Self::Nd5615, Self::Nd5620];

    /// The rated current in Aeff (ND21 4.2.2).
    #[must_use]
    pub const fn rated_current(self) -> i32 {
        self.pick([5, 10, 15, 20])
    }

    /// The peak current in Aeff (ND21 4.2.2).
    #[must_use]
    pub const fn peak_current(self) -> i32 {
        self.pick([10, 20, 20, 40])
    }

    /// The column of this device.
    const fn pick(self, [a, b, c, d]: [i32; 4]) -> i32 {
        match self {
            Self::Nd5605 => a,
            Self::Nd5610 => b,
            Self::Nd5615 => c,
            Self::Nd5620 => d,
        }
    }
}

/// The range of speeds that `SwVersion2` selects (ND21 14.3.2; the print says "torque range", E83).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SpeedRange {
    /// Bit 7 = 1: 0...8000 rpm.
    To8000,
    /// Bit 7 = 0: 0...12000 rpm.
    To12000,
}

impl SpeedRange {
    /// The range that a value of `SwVersion2` selects with its bit 7 (ND21 14.3.2).
    #[must_use]
    pub const fn from_sw_version2(byte: u8) -> Self {
        if byte & 0x80 == 0 {
            Self::To12000
        } else {
            Self::To8000
        }
    }

    /// How many raw units of speed are one increment a cycle (ND21 14.5.3.1).
    #[must_use]
    pub const fn parts(self) -> u8 {
        match self {
            Self::To8000 => 8,
            Self::To12000 => 4,
        }
    }

    /// The greatest speed of the range in rpm (ND21 14.3.2).
    #[must_use]
    pub const fn limit(self) -> i32 {
        match self {
            Self::To8000 => 8_000,
            Self::To12000 => 12_000,
        }
    }
}

/// A value that cannot be converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnitError {
    /// Which quantity.
    pub quantity: &'static str,
    /// The section of the manual with its rule.
    pub section: &'static str,
    /// What was to be converted: a raw value or a physical one.
    pub received: Ratio,
    /// Why it cannot be.
    pub reason: Reason,
}

/// Why a value cannot be converted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It must be at least this.
    Below(Ratio),
    /// It may be at most this.
    Above(Ratio),
    /// Half a byte stands for a decimal digit and is more than 9.
    NotDecimal,
    /// The calendar has no such day.
    NoSuchDate,
    /// It must be even.
    Odd,
}

impl UnitError {
    const fn new(
        (quantity, section): (&'static str, &'static str),
        received: Ratio,
        reason: Reason,
    ) -> Self {
        Self {
            quantity,
            section,
            received,
            reason,
        }
    }
}

impl fmt::Display for UnitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (received, quantity) = (self.received, self.quantity);
        write!(f, "failed to convert {received} for the {quantity}: ")?;
        match self.reason {
            Reason::Below(least) => write!(f, "at least {least} expected")?,
            Reason::Above(most) => write!(f, "at most {most} expected")?,
            Reason::NotDecimal => f.write_str("binary coded decimal digits expected")?,
            Reason::NoSuchDate => f.write_str("a day of the calendar expected")?,
            Reason::Odd => f.write_str("an even number expected")?,
        }
        write!(f, " (ND21 {})", self.section)
    }
}

impl core::error::Error for UnitError {}

/// Refuses a raw value outside `least..=most`.
fn check(
    what: (&'static str, &'static str),
    raw: i32,
    least: i32,
    most: i32,
) -> Result<(), UnitError> {
    let received = Ratio::whole(raw);
    if raw < least {
        Err(UnitError::new(
            what,
            received,
            Reason::Below(Ratio::whole(least)),
        ))
    } else if raw > most {
        Err(UnitError::new(
            what,
            received,
            Reason::Above(Ratio::whole(most)),
        ))
    } else {
        Ok(())
    }
}

impl Ratio {
    /// A raw value times its scale. The scales of this module have numerators below 2^31.
    const fn times(self, raw: i32) -> Self {
        Self::of(
            self.numerator().saturating_mul(raw as i64),
            self.denominator(),
        )
    }

    /// How many steps of `scale` this is, rounded to the nearest. `scale` is positive.
    const fn steps(self, scale: Self) -> i128 {
        round_div(
            self.numerator() as i128 * scale.denominator() as i128,
            self.denominator() as i128 * scale.numerator() as i128,
        )
    }
}

/// The raw value nearest to a physical one; refuses what rounds to a raw value outside
/// `least..=most`. `T` holds all of that range.
fn encode<T: TryFrom<i128>>(
    what: (&'static str, &'static str),
    value: Ratio,
    scale: Ratio,
    least: i32,
    most: i32,
) -> Result<T, UnitError> {
    let raw = value.steps(scale);
    if raw < i128::from(least) {
        return Err(UnitError::new(
            what,
            value,
            Reason::Below(scale.times(least)),
        ));
    }
    let above = UnitError::new(what, value, Reason::Above(scale.times(most)));
    if raw > i128::from(most) {
        return Err(above);
    }
    T::try_from(raw).map_err(|_| above)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn errors_say_what_was_expected() {
        assert_eq!(
            tacho_filter_from_raw(0x80).unwrap_err().to_string(),
            "failed to convert 128 for the tacho filter in us: at most 127 expected (ND21 14.6.3)"
        );
        assert_eq!(
            speed_to_raw(Ratio::whole(-8_001), SpeedRange::To8000)
                .unwrap_err()
                .to_string(),
            "failed to convert -8001 for the spin speed in rpm: at least -8000 expected (ND21 14.5.3.1)"
        );
        assert_eq!(
            Date::from_raw(0xFFFF).unwrap_err().to_string(),
            "failed to convert 65535 for the date: a day of the calendar expected (ND21 14.8.3)"
        );
    }

    /// Numbers at the ends of 64 bits are refused or converted, never a panic.
    #[test]
    fn ends_of_the_numbers() {
        for numerator in [i64::MIN, -1, 0, 1, i64::MAX] {
            for denominator in [1, 3, i64::MAX] {
                let ratio = Ratio::new(numerator, denominator).unwrap();
                for device in DriveType::ALL {
                    let _ = momentary_current_to_raw(ratio, device);
                    let _ = effective_current_to_raw(ratio, device);
                    let _ = torque_limit_to_raw(ratio, device);
                    let _ = torque_to_raw(ratio, device);
                }
                for range in [SpeedRange::To8000, SpeedRange::To12000] {
                    let _ = speed_to_raw(ratio, range);
                    let _ = max_speed_to_raw(ratio, range);
                    let _ = ramp_to_raw(Switched::On(ratio), range);
                }
                let _ = turns_to_raw(ratio);
                let _ = angle_to_raw(ratio);
                let _ = slipping_error_to_raw(Switched::On(ratio));
                let _ = tacho_filter_to_raw(ratio);
                let _ = analogue_speed_to_raw(ratio);
                let _ = impulses_to_raw(ratio);
                let _ = emf_to_raw(ratio);
                let _ = cooler_to_raw(ratio);
                let _ = motor_sensor_to_raw(ratio);
                let _ = (ratio.round(), ratio.to_f64());
            }
        }
    }
}
