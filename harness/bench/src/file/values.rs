//! The values of a rig file that are written as a text: times, speeds, links, lines.

use crate::scenario::quantity::{Dimension, figures, parse};
use harness_proto::time::Span;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// The longest time in a rig file: a week.
const MAX_TIME: Duration = Duration::from_secs(7 * 24 * 3600);
/// The highest speed in a rig file, in rpm: that of the fastest range (ND21 14.5.1).
const MAX_SPEED: f64 = 32_767.0;

/// Why a text is no value: what is wrong, and what was expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}: {expected}")]
pub struct ValueError {
    /// What is wrong.
    pub message: String,
    /// What was expected.
    pub expected: String,
}

fn wrong(message: impl Into<String>, expected: impl Into<String>) -> ValueError {
    ValueError {
        message: message.into(),
        expected: expected.into(),
    }
}

/// A time longer than nothing and not longer than a week, written with its unit: `100ms`, `5 s`, `1h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Time(pub Duration);

impl Time {
    /// A time of `seconds`.
    #[must_use]
    pub const fn seconds(seconds: u64) -> Self {
        Self(Duration::from_secs(seconds))
    }

    /// The same in virtual time.
    #[must_use]
    pub fn span(self) -> Span {
        Span::from_nanos(u64::try_from(self.0.as_nanos()).unwrap_or(u64::MAX))
    }
}

impl FromStr for Time {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let expected = "a time such as \"100ms\", \"5s\" or \"1h\" expected here";
        let quantity =
            parse(text).map_err(|_| wrong(format!("`{text}` is not a time"), expected))?;
        let micros = match quantity.unit.dimension() {
            Dimension::Time => quantity.value.to_f64(),
            Dimension::Hours => quantity.value.to_f64() * 3.6e9,
            _ => {
                return Err(wrong(
                    format!("`{}` is not a unit of time", quantity.unit.name),
                    expected,
                ));
            }
        };
        Duration::try_from_secs_f64((micros * 1e-6 * 1e9).round() / 1e9)
            .ok()
            .filter(|time| !time.is_zero() && *time <= MAX_TIME)
            .map(Self)
            .ok_or_else(|| {
                wrong(
                    format!("`{text}` is not possible here"),
                    "a time above 0 and up to 168h expected here",
                )
            })
    }
}

impl fmt::Display for Time {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let micros = self.0.as_micros();
        match (micros % 3_600_000_000, micros % 1_000_000, micros % 1000) {
            (0, _, _) => write!(f, "{}h", micros / 3_600_000_000),
            (_, 0, _) => write!(f, "{}s", micros / 1_000_000),
            (_, _, 0) => write!(f, "{}ms", micros / 1000),
            _ => write!(f, "{micros}us"),
        }
    }
}

/// A speed above nothing, in rpm, written with its unit: `300rpm`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Speed(pub f64);

impl FromStr for Speed {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let expected = "a speed such as \"300rpm\" expected here";
        let quantity =
            parse(text).map_err(|_| wrong(format!("`{text}` is not a speed"), expected))?;
        let rpm = quantity.value.to_f64();
        if quantity.unit.dimension() != Dimension::Speed {
            let message = format!("`{}` is not a unit of speed", quantity.unit.name);
            return Err(wrong(message, expected));
        }
        if rpm <= 0.0 || rpm > MAX_SPEED {
            return Err(wrong(
                format!("`{text}` is not possible here"),
                "a speed above 0 and up to 32767rpm expected here",
            ));
        }
        Ok(Self(rpm))
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}rpm", figures(self.0, "rpm"))
    }
}

/// A highest speed: in rpm, or as a share of the speed that drives call 100 %.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum MaxSpeed {
    /// In rpm.
    Rpm(Speed),
    /// In per cent, above 0 and up to 100.
    Percent(f64),
}

impl FromStr for MaxSpeed {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let Some(number) = text.trim().strip_suffix('%') else {
            return text.parse().map(Self::Rpm);
        };
        let percent = number.trim().parse::<f64>().ok();
        let fits = |percent: &f64| *percent > 0.0 && *percent <= 100.0;
        percent.filter(fits).map(Self::Percent).ok_or_else(|| {
            wrong(
                format!("`{text}` is not possible here"),
                "a share above 0% and up to 100% expected here",
            )
        })
    }
}

impl fmt::Display for MaxSpeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rpm(speed) => speed.fmt(f),
            Self::Percent(percent) => write!(f, "{percent}%"),
        }
    }
}

/// A share of what is called 100 %, written with its sign: `50%`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Percent(pub f64);

impl FromStr for Percent {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let number = text.trim().strip_suffix('%');
        let percent = number.and_then(|number| number.trim().parse().ok());
        let fits = |percent: &f64| *percent > 0.0 && *percent < 200.0;
        percent.filter(fits).map(Self).ok_or_else(|| {
            wrong(
                format!("`{text}` is not possible here"),
                "a share above 0% and below 200% expected here",
            )
        })
    }
}

impl fmt::Display for Percent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}%", self.0)
    }
}

/// A frequency written with its unit: `35Hz`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Hertz(pub f64);

impl FromStr for Hertz {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let number = text.trim().strip_suffix("Hz");
        let hertz = number.and_then(|number| number.trim().parse().ok());
        let fits = |hertz: &f64| *hertz > 0.0 && *hertz <= 999.0;
        hertz.filter(fits).map(Self).ok_or_else(|| {
            wrong(
                format!("`{text}` is not possible here"),
                "a frequency above 0Hz and up to 999Hz expected here",
            )
        })
    }
}

impl fmt::Display for Hertz {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}Hz", self.0)
    }
}

/// A bit rate in kbit/s.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct KilobitRate(#[schemars(range(min = 1, max = 1500))] pub f64);

impl KilobitRate {
    /// Bits a second.
    #[must_use]
    pub fn bits_per_second(self) -> u32 {
        (self.0 * 1000.0).round().clamp(0.0, f64::from(u32::MAX)) as u32
    }
}

impl fmt::Display for KilobitRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

impl Serialize for KilobitRate {
    /// A whole number stays one.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.bits_per_second() {
            bits if bits % 1000 == 0 => serializer.serialize_u32(bits / 1000),
            _ => serializer.serialize_f64(self.0),
        }
    }
}

/// A link of a ring by its ends, as a scenario writes it: `98->97`, `master->99`, `0->master`. An end that
/// is `None` is the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct LinkName {
    /// Who sends.
    pub from: Option<u8>,
    /// Who receives.
    pub to: Option<u8>,
}

impl LinkName {
    /// Whether a ring of `drives` drives has this link: bytes go from the master to the drive with the highest address and down
    /// to drive 0 (ND21 8.1).
    #[must_use]
    pub fn is_in(self, drives: u8) -> bool {
        match (self.from, self.to) {
            (None, Some(to)) => to.checked_add(1) == Some(drives),
            (Some(from), None) => from == 0 && drives > 0,
            (Some(from), Some(to)) => to.checked_add(1) == Some(from) && from < drives,
            (None, None) => false,
        }
    }
}

impl FromStr for LinkName {
    type Err = ValueError;

    fn from_str(text: &str) -> Result<Self, ValueError> {
        let end = |text: &str| match text.trim() {
            "master" => Some(None),
            number => number.parse().ok().map(Some),
        };
        text.split_once("->")
            .and_then(|(from, to)| {
                Some(Self {
                    from: end(from)?,
                    to: end(to)?,
                })
            })
            .ok_or_else(|| {
                wrong(
                    format!("`{text}` is not a link"),
                    "a link such as \"98->97\", \"master->99\" or \"0->master\" expected here",
                )
            })
    }
}

impl fmt::Display for LinkName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |end: Option<u8>| end.map_or("master".to_owned(), |drive| drive.to_string());
        write!(f, "{}->{}", end(self.from), end(self.to))
    }
}

/// What each of these values has in common: from and to a text, and a name and a `format` in the schema by which a file is checked.
macro_rules! text_values {
    ($($value:ident $schema:literal $format:literal $about:literal;)*) => {
        $(
            impl TryFrom<String> for $value {
                type Error = ValueError;

                fn try_from(text: String) -> Result<Self, ValueError> {
                    text.parse()
                }
            }

            impl From<$value> for String {
                fn from(value: $value) -> Self {
                    value.to_string()
                }
            }

            impl JsonSchema for $value {
                fn schema_name() -> Cow<'static, str> {
                    $schema.into()
                }

                fn json_schema(_: &mut SchemaGenerator) -> Schema {
                    json_schema!({ "type": "string", "format": $format, "description": $about })
                }
            }
        )*

        /// Checks a text against the `format` of the schema. An unknown format accepts every text.
        pub(crate) fn check_format(format: &str, text: &str) -> Result<(), ValueError> {
            match format {
                $($format => text.parse::<$value>().map(|_| ()),)*
                _ => Ok(()),
            }
        }
    };
}

text_values! {
    Time "Time" "drivebench-time" "a time above 0 with its unit: 100ms, 5s, 1h";
    Speed "Speed" "drivebench-speed" "a speed above 0 with its unit: 300rpm";
    MaxSpeed "MaxSpeed" "drivebench-max-speed" "a speed above 0 with its unit: 300rpm, 10%";
    Percent "Percent" "drivebench-percent" "a share above 0% and below 200%: 50%";
    Hertz "Hertz" "drivebench-frequency" "a frequency with its unit: 35Hz";
    LinkName "Wire" "drivebench-link" "a link by its ends: 98->97, master->99, 0->master";
}
