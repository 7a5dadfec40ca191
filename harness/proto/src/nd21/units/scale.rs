//! Which conversion a cell needs.

use super::{
    Date, DriveType, Ratio, Reason, SpeedRange, Switched, UnitError, analogue_speed_from_raw,
    analogue_speed_to_raw, angle_from_raw, angle_to_raw, cooler_from_raw, cooler_to_raw,
    effective_current_from_raw, effective_current_to_raw, emf_from_raw, emf_to_raw,
    encoder_impulses, max_speed_from_raw, max_speed_to_raw, momentary_current_from_raw,
    momentary_current_to_raw, motor_poles, motor_sensor_from_raw, motor_sensor_to_raw,
    operating_hours_from_bytes, operating_hours_to_bytes, ramp_from_raw, ramp_to_raw,
    scope_period_us, scope_timer0, serial_number_from_bytes, serial_number_to_bytes,
    slipping_error_from_raw, slipping_error_to_raw, speed_from_raw, speed_to_raw,
    tacho_filter_from_raw, tacho_filter_to_raw, torque_from_raw, torque_limit_from_raw,
    torque_limit_to_raw, torque_to_raw, turns_from_raw, turns_to_raw,
};

/// What a drive's scales depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DriveUnits {
    /// Its type.
    pub device: DriveType,
    /// Its range of speeds.
    pub range: SpeedRange,
}

/// The scale of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scale {
    /// A momentary current (14.5.1.1).
    MomentaryCurrent,
    /// A current limit (14.5.1.2).
    EffectiveCurrent,
    /// The torque limit (14.5.2).
    TorqueLimit,
    /// The nominal torque (14.5.2).
    Torque,
    /// A speed with its sign (14.5.3.1).
    Speed,
    /// The maximum speed (14.5.3.2).
    MaxSpeed,
    /// A ramp (14.5.4).
    Ramp,
    /// Whole turns, the high word of a position (14.5.5).
    Turns,
    /// A part of a turn, the low word of a position (14.5.5, 14.6.6).
    Angle,
    /// Both words of a position as one double word (14.5.5). No cell of the tables has it: they print the
    /// words apart.
    Position,
    /// The slipping error (14.5.6).
    SlippingError,
    /// A temperature of the cooler (14.5.7.1).
    CoolerTemperature,
    /// The resistance of the motor's sensor (14.5.7.2).
    MotorSensor,
    /// The back EMF of the motor (14.6.2).
    Emf,
    /// The time constant of the tacho filter (14.6.3).
    TachoFilter,
    /// The number of motor poles (14.6.7).
    MotorPoles,
    /// The impulses of the encoder emulation (14.7.1.1).
    EncoderImpulses,
    /// The speed at 10 V; with the analogue input only (14.7.2).
    AnalogueSpeed,
    /// The serial number (14.8.1).
    SerialNumber,
    /// A number of hours; the high byte is the second (14.8.2).
    Hours,
    /// A date (14.8.3).
    Date,
    /// The scan period of the oscilloscope (14.10.6.2).
    ScopePeriod,
}

/// The value of a cell in the unit of its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// An exact number.
    Exact(Ratio),
    /// A number from a formula that is not rational.
    Approximate(f64),
    /// A limit that is switched off.
    Off,
    /// A day.
    Date(Date),
}

impl From<Switched> for Value {
    fn from(switched: Switched) -> Self {
        match switched {
            Switched::Off => Self::Off,
            Switched::On(ratio) => Self::Exact(ratio),
        }
    }
}

impl Scale {
    /// The unit of the values, empty for a number without one.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::MomentaryCurrent => "A",
            Self::EffectiveCurrent | Self::TorqueLimit | Self::Torque => "Aeff",
            Self::Speed | Self::MaxSpeed | Self::AnalogueSpeed => "rpm",
            Self::Ramp => "rpm/s",
            Self::Turns | Self::Angle | Self::Position | Self::SlippingError => "turns",
            Self::CoolerTemperature => "°C",
            Self::MotorSensor => "ohm",
            Self::Emf => "V per 1000 rpm",
            Self::TachoFilter | Self::ScopePeriod => "us",
            Self::EncoderImpulses => "impulses per turn",
            Self::Hours => "h",
            Self::MotorPoles | Self::SerialNumber | Self::Date => "",
        }
    }

    /// How many bytes a value has.
    #[must_use]
    pub const fn size(self) -> u16 {
        match self {
            Self::MomentaryCurrent
            | Self::EffectiveCurrent
            | Self::TorqueLimit
            | Self::CoolerTemperature
            | Self::MotorSensor
            | Self::Emf
            | Self::TachoFilter
            | Self::MotorPoles
            | Self::AnalogueSpeed
            | Self::ScopePeriod => 1,
            Self::Torque
            | Self::Speed
            | Self::MaxSpeed
            | Self::Ramp
            | Self::Turns
            | Self::Angle
            | Self::SlippingError
            | Self::EncoderImpulses
            | Self::Hours
            | Self::Date => 2,
            Self::SerialNumber => 3,
            Self::Position => 4,
        }
    }

    /// The value that these bytes stand for, in the order of their addresses. `None` if they are not
    /// [`Self::size`] many.
    ///
    /// # Errors
    /// The bytes are outside what the manual gives a meaning to; see the functions of the module.
    #[must_use]
    pub fn value(self, bytes: &[u8], drive: DriveUnits) -> Option<Result<Value, UnitError>> {
        match *bytes {
            [byte] => self.value_of_byte(byte, drive),
            [high, low] => self.value_of_word([high, low], drive),
            [a, b, c] if self == Self::SerialNumber => Some(
                serial_number_from_bytes([a, b, c])
                    .map(|number| Value::Exact(Ratio::of(i64::from(number), 1))),
            ),
            [a, b, c, d] if self == Self::Position => {
                let raw = i32::from_be_bytes([a, b, c, d]);
                Some(Ok(Value::Exact(turns_from_raw(raw))))
            }
            _ => None,
        }
    }

    /// The bytes nearest to a value, as one number: the first byte of [`Self::size`] is its highest. `None`
    /// where the scale has no such value, as [`Value::Off`] of a speed.
    ///
    /// # Errors
    /// The cell cannot hold the value; see the functions of the module.
    #[must_use]
    pub fn encode(self, value: Value, drive: DriveUnits) -> Option<Result<u32, UnitError>> {
        let number = match (self, value) {
            (Self::Date, Value::Date(date)) => return Some(Ok(u32::from(date.to_raw()))),
            (Self::Ramp, Value::Off) => {
                return Some(ramp_to_raw(Switched::Off, drive.range).map(u32::from));
            }
            (Self::SlippingError, Value::Off) => {
                return Some(slipping_error_to_raw(Switched::Off).map(u32::from));
            }
            (_, Value::Exact(number)) => number,
            _ => return None,
        };
        let DriveUnits { device, range } = drive;
        let byte = |raw: i8| u32::from(raw.cast_unsigned());
        let word = |raw: i16| u32::from(raw.cast_unsigned());
        Some(match self {
            Self::MomentaryCurrent => momentary_current_to_raw(number, device).map(byte),
            Self::EffectiveCurrent => effective_current_to_raw(number, device).map(u32::from),
            Self::TorqueLimit => torque_limit_to_raw(number, device).map(byte),
            Self::Torque => torque_to_raw(number, device).map(word),
            Self::Speed => speed_to_raw(number, range).map(word),
            Self::MaxSpeed => max_speed_to_raw(number, range).map(u32::from),
            Self::Ramp => ramp_to_raw(Switched::On(number), range).map(u32::from),
            Self::Turns => self
                .whole_number(number, -0x8000, 0x7FFF)
                .map(|raw| raw & 0xFFFF),
            Self::Angle => angle_to_raw(number).map(u32::from),
            Self::Position => turns_to_raw(number).map(i32::cast_unsigned),
            Self::SlippingError => slipping_error_to_raw(Switched::On(number)).map(u32::from),
            Self::CoolerTemperature => cooler_to_raw(number).map(u32::from),
            Self::MotorSensor => motor_sensor_to_raw(number).map(u32::from),
            Self::Emf => emf_to_raw(number).map(u32::from),
            Self::TachoFilter => tacho_filter_to_raw(number).map(u32::from),
            Self::AnalogueSpeed => analogue_speed_to_raw(number).map(u32::from),
            Self::ScopePeriod => self
                .whole_number(number, 0, i32::MAX)
                .and_then(scope_timer0)
                .map(u32::from),
            Self::Hours => self.whole_number(number, 0, 0xFFFF).map(|hours| {
                let [_, _, high, low] = hours.to_be_bytes();
                let bytes = operating_hours_to_bytes(u16::from_be_bytes([high, low]));
                u32::from(u16::from_be_bytes(bytes))
            }),
            Self::SerialNumber => self
                .whole_number(number, 0, 999_999)
                .and_then(serial_number_to_bytes)
                .map(|[a, b, c]| u32::from_be_bytes([0, a, b, c])),
            Self::MotorPoles | Self::EncoderImpulses | Self::Date => return None,
        })
    }

    /// The whole number nearest to `number`, from `least` to `most`, in two's complement.
    fn whole_number(self, number: Ratio, least: i32, most: i32) -> Result<u32, UnitError> {
        let (quantity, section) = match self {
            Self::Turns => ("whole turns", "14.5.5"),
            Self::Hours => ("hours", "14.8.2"),
            Self::SerialNumber => ("serial number", "14.8.1"),
            _ => ("scan period in us", "14.10.6.2"),
        };
        let refused = |reason| UnitError::new((quantity, section), number, reason);
        let raw = number.round();
        if raw < i64::from(least) {
            return Err(refused(Reason::Below(Ratio::whole(least))));
        }
        match i32::try_from(raw) {
            Ok(raw) if raw <= most => Ok(raw.cast_unsigned()),
            _ => Err(refused(Reason::Above(Ratio::whole(most)))),
        }
    }

    fn value_of_byte(self, byte: u8, drive: DriveUnits) -> Option<Result<Value, UnitError>> {
        let signed = byte.cast_signed();
        let exact = |ratio| Ok(Value::Exact(ratio));
        Some(match self {
            Self::MomentaryCurrent => exact(momentary_current_from_raw(signed, drive.device)),
            Self::EffectiveCurrent => {
                effective_current_from_raw(byte, drive.device).map(Value::Exact)
            }
            Self::TorqueLimit => exact(torque_limit_from_raw(signed, drive.device)),
            Self::CoolerTemperature => cooler_from_raw(byte).map(Value::Approximate),
            Self::MotorSensor => motor_sensor_from_raw(byte).map(Value::Exact),
            Self::Emf => exact(emf_from_raw(byte)),
            Self::TachoFilter => tacho_filter_from_raw(byte).map(Value::Exact),
            Self::MotorPoles => motor_poles(byte).map(|poles| Value::Exact(whole(poles))),
            Self::AnalogueSpeed => exact(analogue_speed_from_raw(byte)),
            Self::ScopePeriod => exact(Ratio::of(i64::from(scope_period_us(byte)), 1)),
            _ => return None,
        })
    }

    fn value_of_word(self, bytes: [u8; 2], drive: DriveUnits) -> Option<Result<Value, UnitError>> {
        let word = u16::from_be_bytes(bytes);
        let signed = word.cast_signed();
        let exact = |ratio| Ok(Value::Exact(ratio));
        Some(match self {
            Self::Torque => exact(torque_from_raw(signed, drive.device)),
            Self::Speed => exact(speed_from_raw(signed, drive.range)),
            Self::MaxSpeed => max_speed_from_raw(word, drive.range).map(Value::Exact),
            Self::Ramp => ramp_from_raw(word, drive.range).map(Value::from),
            Self::Turns => exact(whole(signed)),
            Self::Angle => exact(angle_from_raw(word)),
            Self::SlippingError => slipping_error_from_raw(word).map(Value::from),
            Self::EncoderImpulses => encoder_impulses(word).map(|n| Value::Exact(whole(n))),
            Self::Hours => exact(whole(operating_hours_from_bytes(bytes))),
            Self::Date => Date::from_raw(word).map(Value::Date),
            _ => return None,
        })
    }
}

fn whole(number: impl Into<i32>) -> Ratio {
    Ratio::whole(number.into())
}

#[cfg(test)]
mod tests {
    use super::super::super::cells::RAM;
    use super::super::super::eeprom::EEPROM;
    use super::*;

    const DRIVE: DriveUnits = DriveUnits {
        device: DriveType::Nd5610,
        range: SpeedRange::To8000,
    };

    #[test]
    fn values() {
        let value = |scale: Scale, bytes: &[u8]| scale.value(bytes, DRIVE).unwrap().unwrap();
        let exact = |numerator, denominator| Value::Exact(Ratio::of(numerator, denominator));
        assert_eq!(value(Scale::MomentaryCurrent, &[0xFF]), exact(-244, 1_000));
        assert_eq!(value(Scale::Speed, &[0xFF, 0xFF]), exact(-78_125, 294_912));
        assert_eq!(value(Scale::Turns, &[0xFF, 0xFE]), exact(-2, 1));
        assert_eq!(value(Scale::Ramp, &[0x7F, 0xFF]), Value::Off);
        assert_eq!(value(Scale::SlippingError, &[0x80, 0x00]), Value::Off);
        assert_eq!(value(Scale::Hours, &[0x01, 0x00]), exact(1, 1));
        assert_eq!(
            value(Scale::SerialNumber, &[0x01, 0x23, 0x45]),
            exact(12_345, 1)
        );
        let date = Date::new(1996, 1, 31).unwrap();
        assert_eq!(value(Scale::Date, &[0x06, 0x3F]), Value::Date(date));
    }

    #[test]
    fn wrong_number_of_bytes() {
        assert_eq!(Scale::Speed.value(&[0], DRIVE), None);
        assert_eq!(Scale::Emf.value(&[0, 0], DRIVE), None);
        assert_eq!(Scale::SerialNumber.value(&[0, 0], DRIVE), None);
        assert_eq!(Scale::Date.value(&[], DRIVE), None);
    }

    /// Every raw value that stands for a number comes back from it.
    #[test]
    fn every_cell_comes_back() {
        let drive = DriveUnits {
            device: DriveType::Nd5610,
            range: SpeedRange::To8000,
        };
        for cell in RAM.iter().chain(EEPROM).filter(|cell| cell.size <= 2) {
            let Some(scale) = cell.scale else { continue };
            for raw in 0..1_u32 << (8 * cell.size) {
                let all = raw.to_be_bytes();
                let bytes = &all[4 - usize::from(cell.size)..];
                let Some(Ok(value)) = scale.value(bytes, drive) else {
                    continue;
                };
                if let Some(Ok(back)) = scale.encode(value, drive) {
                    assert_eq!(back, raw, "{}", cell.printed);
                }
            }
        }
        let position = Value::Exact(Ratio::of(-41, 4));
        let raw = Scale::Position.encode(position, drive).unwrap().unwrap();
        assert_eq!(raw, 0xFFF5_C000);
        let back = Scale::Position.value(&raw.to_be_bytes(), drive);
        assert_eq!(back, Some(Ok(position)));
        let most = Value::Exact(Ratio::whole(32_768));
        assert!(Scale::Turns.encode(most, drive).unwrap().is_err());
        assert_eq!(Scale::Speed.encode(Value::Off, drive), None);
    }
}
