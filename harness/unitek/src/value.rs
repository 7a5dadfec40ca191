//! Registers and their values on a command line: `SPEED_CMD=10%`, `0x31=0CCD`, and how they are shown.

use harness_bench::scenario::problem::nearest;
use harness_proto::unitek::frame::{Data, Reply};
use harness_proto::unitek::units::{Decimal, Given, Scaling, shown, to_raw, usual};
use harness_proto::unitek::words::{Bit, ERRORS, IO, MODE, STATUS, set_bits};
use harness_proto::unitek::{ALIASES, Access, BadName, REGISTERS, Register, Unit};

/// The word that means every register.
pub(crate) const ALL: &str = "all";

/// The register of this name or number.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub(crate) fn register(text: &str) -> Result<&'static Register, String> {
    Register::named(text).map_err(|error| match error {
        BadName::Ambiguous { .. } => format!("`{text}`: {error}"),
        BadName::Unknown => {
            let names = REGISTERS.iter().map(|register| register.name);
            let known: Vec<_> = names.chain(ALIASES.map(|(alias, _)| alias)).collect();
            let near = nearest(text, &known);
            let near = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            format!(
                "there is no register `{text}`; {near}A name of `drivebench cells --bus unitek` or a number such as 0x31 expected"
            )
        }
    })
}

/// The registers of these names, each once and in their order; [`ALL`] for every one.
///
/// # Errors
/// The first name that is wrong.
pub(crate) fn registers(texts: &[String]) -> Result<Vec<&'static Register>, String> {
    let mut found: Vec<&'static Register> = Vec::new();
    for text in texts {
        let named = match text.as_str() {
            ALL => REGISTERS.iter().collect(),
            name => vec![register(name)?],
        };
        for register in named {
            if !found.iter().any(|other| other.number == register.number) {
                found.push(register);
            }
        }
    }
    Ok(found)
}

/// What is to be written into a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Assignment {
    pub(crate) register: &'static Register,
    pub(crate) value: Value,
}

/// A value on a command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    /// As it travels.
    Raw(u32),
    /// A number with its unit.
    Given(Decimal, Given),
}

impl Value {
    /// The bits for a register, as wide as the register is.
    ///
    /// # Errors
    /// The register cannot hold it, in a sentence.
    pub(crate) fn data(self, register: &Register, scaling: Scaling) -> Result<Data, String> {
        let raw = match self {
            Self::Raw(raw) => raw,
            Self::Given(decimal, given) => {
                to_raw(register, decimal, given, scaling).map_err(|error| error.to_string())?
            }
        };
        Ok(Data::of(register, raw))
    }
}

/// Reads `REGISTER=VALUE`: a number with a unit of the register, or hexadecimal digits, after `0x` where the register has a unit.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub(crate) fn assignment(text: &str) -> Result<Assignment, String> {
    let (name, written) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` is no assignment: REGISTER=VALUE expected"))?;
    let register = register(name.trim())?;
    let value = value(written.trim(), register)?;
    Ok(Assignment { register, value })
}

fn value(text: &str, register: &Register) -> Result<Value, String> {
    let unit = usual(register.unit);
    let wrong = || {
        let digits = register.width.bits() / 4;
        let expected = match unit {
            Some(unit) => {
                format!(
                    "a number with its unit, such as 1{}, or `0x` and {digits} hexadecimal digits expected",
                    unit.name()
                )
            }
            None => format!("up to {digits} hexadecimal digits expected"),
        };
        format!("`{text}` is no value of {}: {expected}", register.name)
    };
    let hex = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let digits = match (hex, unit) {
        (Some(digits), _) => digits,
        (None, None) => text,
        (None, Some(_)) => {
            let end = text.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c));
            let (number, name) = text.split_at(end.ok_or_else(wrong)?);
            let given = Given::from_name(name.trim()).ok_or_else(wrong)?;
            let number = decimal(number).ok_or_else(wrong)?;
            return Ok(Value::Given(number, given));
        }
    };
    let plain = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let raw = u32::from_str_radix(digits, 16).ok().filter(|_| plain);
    raw.filter(|raw| raw & !register.mask() == 0)
        .map(Value::Raw)
        .ok_or_else(wrong)
}

/// A decimal number with at most nine digits after its point.
fn decimal(text: &str) -> Option<Decimal> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let places = u8::try_from(fraction.len()).ok()?;
    if places > Decimal::MAX_PLACES || text.ends_with('.') {
        return None;
    }
    let digits = format!("{whole}{fraction}").parse().ok()?;
    Some(Decimal { digits, places })
}

/// The names of the bits of a register; none of a register that holds a number.
#[must_use]
pub(crate) const fn bits(unit: Unit) -> &'static [Bit] {
    match unit {
        Unit::Status => STATUS,
        Unit::Errors => ERRORS,
        Unit::Io => IO,
        Unit::Mode => MODE,
        _ => &[],
    }
}

/// The value of a reply in words: a number with its unit, names of bits, or nothing where the manual gives no meaning.
#[must_use]
pub(crate) fn words(reply: &Reply, scaling: Scaling) -> String {
    let register = Register::of(reply.register);
    // A short reply of a wide register keeps its sign.
    let bits = (reply.number() & i64::from(u32::MAX)) as u32;
    let unit = usual(register.unit).and_then(|unit| shown(register, bits, unit, scaling));
    match (unit, register.unit) {
        (Some(value), Unit::Speed) => match shown(register, bits, Given::Rpm, scaling) {
            Some(rpm) => format!("{value} ({rpm})"),
            None => value.to_string(),
        },
        (Some(value), _) => value.to_string(),
        (None, unit) => {
            let names: Vec<_> = set_bits(self::bits(unit), bits)
                .map(|bit| bit.name)
                .collect();
            names.join(" ")
        }
    }
}

/// The digits of a reply, as many as it carried.
#[must_use]
pub(crate) fn hex(data: Data) -> String {
    match data {
        Data::Short(value) => format!("{value:04X}"),
        Data::Long(value) => format!("{value:08X}"),
    }
}

/// Whether a register keeps what is written.
#[must_use]
pub(crate) const fn is_parameter(register: &Register) -> bool {
    matches!(register.access, Access::RW)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(text: &str) -> Result<Data, String> {
        let Assignment { register, value } = assignment(text)?;
        value.data(register, Scaling::default())
    }

    /// Numbers of the manual (App 5, App 6), in units and as digits.
    #[test]
    fn values_of_the_manual() {
        for (text, data) in [
            ("SPEED_CMD=10%", Data::Short(0x0CCD)),
            ("speed_soll=-100%", Data::Short(0x8001)),
            ("31=1800rpm", Data::Short(0x4000)),
            ("0x90=50%", Data::Short(0x2AAA)),
            ("POS_DEST=200turns", Data::Long(0x00C8_0000)),
            ("SPEED_CMD=0x0CCD", Data::Short(0x0CCD)),
            ("MODE=4", Data::Short(4)),
            ("VAR1=0000003E", Data::Long(0x3E)),
        ] {
            assert_eq!(raw(text), Ok(data), "{text}");
        }
    }

    #[test]
    fn mistakes_name_what_is_expected() {
        for (text, part) in [
            ("SPEED_CMD", "REGISTER=VALUE expected"),
            ("SPEED_CMDD=1%", "did you mean `SPEED_CMD`?"),
            ("SPEED_DELTAMA=1ms", "several registers have this name"),
            ("SPEED_CMD=10", "a number with its unit"),
            ("SPEED_CMD=10ms", "is not counted in ms"),
            ("SPEED_CMD=101%", "out of range"),
            ("SPEED_CMD=1.%", "a number with its unit"),
            ("MODE=12345", "up to 4 hexadecimal digits"),
            ("MODE=+4", "up to 4 hexadecimal digits"),
        ] {
            let error = raw(text).expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
        assert_eq!(registers(&["all".to_owned()]).map(|all| all.len()), Ok(256));
    }

    #[test]
    fn values_are_shown_with_their_unit_or_bits() {
        let shown = |register: u8, data| {
            let stuff = 0;
            words(
                &Reply {
                    register,
                    data,
                    stuff,
                },
                Scaling::default(),
            )
        };
        assert_eq!(shown(0x30, Data::Short(0xF333)), "-10.0% (-360.0 rpm)");
        assert_eq!(shown(0x40, Data::Short(0x0181)), "Ena P-N N-I");
        assert_eq!(shown(0x8F, Data::Long(0x20)), "POWERVOLTAGE");
        assert_eq!(shown(0x1B, Data::Short(0x01D8)), "");
    }
}
