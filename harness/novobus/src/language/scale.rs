//! The scales of the drive's cells (ND21 14) in the units of the language.

use harness_bench::scenario::quantity::{Dimension, figures};
use harness_proto::nd21::units::{Scale, Value};

/// What the values of a scale measure; `None` for plain numbers and dates.
pub(crate) const fn dimension_of(scale: Scale) -> Option<Dimension> {
    Some(match scale {
        Scale::Speed | Scale::MaxSpeed | Scale::AnalogueSpeed => Dimension::Speed,
        Scale::Ramp => Dimension::Ramp,
        Scale::MomentaryCurrent | Scale::EffectiveCurrent | Scale::TorqueLimit | Scale::Torque => {
            Dimension::Current
        }
        Scale::Turns | Scale::Angle | Scale::Position | Scale::SlippingError => Dimension::Angle,
        Scale::CoolerTemperature => Dimension::Temperature,
        Scale::MotorSensor => Dimension::Resistance,
        Scale::Emf => Dimension::Voltage,
        Scale::TachoFilter | Scale::ScopePeriod => Dimension::Time,
        Scale::Hours => Dimension::Hours,
        Scale::MotorPoles | Scale::EncoderImpulses | Scale::SerialNumber | Scale::Date => {
            return None;
        }
    })
}

/// The value of a cell as text, in the unit of its scale: `1500.1 rpm`, `off`, `1996-01-31`.
#[must_use]
pub(crate) fn shown(value: Value, scale: Scale) -> String {
    let number = match value {
        Value::Exact(ratio) => ratio.to_f64(),
        Value::Approximate(number) => number,
        Value::Off => return "off".to_owned(),
        Value::Date(date) => {
            return format!("{}-{:02}-{:02}", date.year(), date.month(), date.day());
        }
    };
    let unit = scale.unit();
    let text = format!("{} {unit}", figures(number, unit));
    text.trim_end().to_owned()
}
