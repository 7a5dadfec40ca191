//! The values that a walk writes to parameters: both ends of the range that the manual prints, and the next values beyond them.

use harness_proto::nordac::guard::{TaskClass, class};
use harness_proto::nordac::parameter::{Flag, Limit};
use harness_proto::nordac::{PARAMETERS, Parameter};

/// A value that a walk writes to a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WalkedValue {
    /// The name of its kind in a report.
    pub(super) name: &'static str,
    pub(super) parameter: &'static Parameter,
    pub(super) value: i32,
    /// Why it is not written, whatever the rig's file permits; `None` if it may be.
    pub(super) left_out: Option<&'static str>,
}

/// The values for all parameters that can be written and whose range is printed in numbers. A range that ends with the value of another
/// parameter is left to kept conversations.
pub(super) fn values() -> impl Iterator<Item = WalkedValue> {
    PARAMETERS.iter().flat_map(|parameter| {
        let kind = kind(parameter);
        let ends = match (parameter.least, parameter.most) {
            (Limit::Raw(least), Limit::Raw(most)) => vec![least, most, least - 1, most + 1],
            _ => Vec::new(),
        };
        // What 16 bits do not hold is no value beyond.
        let fits = |value: &i32| i16::try_from(*value).is_ok();
        let ends = ends.into_iter().filter(fits);
        let ends = ends.filter_map(move |value| kind.map(|kind| (kind, value)));
        ends.map(|((name, left_out), value)| WalkedValue {
            name,
            parameter,
            value,
            left_out,
        })
    })
}

/// What the values of a parameter are, and why none is written; `None` for one that cannot be written, or that kept conversations write.
fn kind(parameter: &Parameter) -> Option<(&'static str, Option<&'static str>)> {
    match (class(parameter.number), parameter.number) {
        _ if parameter.has(Flag::ReadOnly) || parameter.is_array() => None,
        (
            TaskClass::Stored,
            971 | 1206 | 1207 | 1500 | 1504 | 1505 | 1601 | 1603 | 1618 | 1620 | 1623,
        ) => Some((
            "values of modes",
            Some("they change who controls the inverter, or what its inputs do"),
        )),
        (TaskClass::Stored, 1517 | 1518 | 1527..=1542) => {
            Some(("values of outputs", Some("they switch an output at once")))
        }
        (TaskClass::Stored, _) => Some(("values of parameters", None)),
        (TaskClass::MotorData | TaskClass::Speed, _) => Some((
            "values of motor data",
            Some("a wrong value could damage the motor, or start it"),
        )),
        (TaskClass::BusSettings | TaskClass::Everything | TaskClass::Never, _) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(number: u16) -> Vec<i32> {
        let values = values().filter(|value| value.parameter.number == number);
        values.map(|value| value.value).collect()
    }

    #[test]
    fn both_ends_of_each_range_are_written_and_the_values_beyond() {
        assert_eq!(of(1412), [0, 1000, -1, 1001]);
        assert_eq!(of(1415), [-100, 100, -101, 101]);
        assert_eq!(of(1501), [-32_768, 32_767]);
        // Its highest value is that of 1205; and 1800 is only read.
        assert!(of(1204).is_empty() && of(1800).is_empty());
    }
}
