//! Interlocks on registers of UNITEK drives: a value within bounds, or a bit at its level.

use super::driver::{Driver, Error};
use super::value::{bits, register};
use crate::link::Trouble;
use crate::rig::Rig;
use crate::rig::file::{Interlock, Level};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Register;
use harness_proto::unitek::units::{Given, Scaling, usual, value};

/// What is wrong with an entry of `[[interlock]]`: its key, the message, and what was expected.
type Mistake = (&'static str, String, String);

/// A bound: a number, and its unit where the register has one.
#[derive(Clone, Copy, Debug)]
struct Bound(f64, Option<Given>);

/// What must hold.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    /// The value stays within bounds.
    Within(Option<Bound>, Option<Bound>),
    /// A bit stays at its level.
    Bit(u8, Level),
}

/// An interlock on a register.
#[derive(Clone, Debug)]
pub(super) struct RegisterInterlock {
    node: u8,
    register: &'static Register,
    wanted: Wanted,
    text: Interlock,
    every: Span,
    /// When it is looked at next.
    pub(super) next: Instant,
}

impl RegisterInterlock {
    /// Those of a rig's file, which was checked.
    pub(super) fn all(rig: &Rig) -> Vec<Self> {
        let all = rig.file.interlock.iter();
        all.filter_map(|own| Self::read(own).ok()).collect()
    }

    /// Reads an entry.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn read(own: &Interlock) -> Result<Self, Mistake> {
        let Some(name) = &own.register else {
            let message = "no register is named".to_owned();
            return Err(("drive", message, "`register` expected beside it".to_owned()));
        };
        let expected = "a register of `drivebench cells --bus unitek` expected here";
        let register =
            register(name).map_err(|message| ("register", message, expected.to_owned()))?;
        let wanted = match (&own.bit, own.level) {
            (Some(bit), Some(level)) if own.min.is_none() && own.max.is_none() => {
                let table = bits(register.unit);
                let found = table.iter().find(|known| known.name == bit);
                let names: Vec<_> = table.iter().map(|known| known.name).collect();
                let found = found.ok_or_else(|| {
                    let message = format!("{} has no bit `{bit}`", register.name);
                    let expected = match names.is_empty() {
                        true => "`min` or `max` expected in its place".to_owned(),
                        false => format!("one of {} expected here", names.join(", ")),
                    };
                    ("bit", message, expected)
                })?;
                Wanted::Bit(found.number, level)
            }
            (None, None) if own.min.is_some() || own.max.is_some() => {
                let bound = |key, text: &Option<String>| {
                    let read = text.as_deref().map(|text| bound(text, register));
                    read.transpose()
                        .map_err(|(message, expected)| (key, message, expected))
                };
                Wanted::Within(bound("min", &own.min)?, bound("max", &own.max)?)
            }
            _ => {
                let message = "what must hold is not clear".to_owned();
                let expected = "`min`, `max` or both, or `bit` and `level`, expected beside it";
                return Err(("register", message, expected.to_owned()));
            }
        };
        let every = u64::try_from(own.every.0.as_nanos()).unwrap_or(u64::MAX);
        Ok(Self {
            node: own.drive,
            register,
            wanted,
            text: own.clone(),
            every: Span::from_nanos(every),
            next: Instant::START,
        })
    }

    /// Reads the register and compares it. One with a cycle is left alone: its frames cannot be told from a reply.
    ///
    /// # Errors
    /// [`Trouble::Interlock`] if it does not hold, [`Trouble::Lost`] if the drive does not answer.
    pub(super) fn look(&mut self, driver: &mut Driver<'_>) -> Result<(), Trouble> {
        self.next = driver.now() + self.every;
        let name = format!(
            "interlock on {} of drive {}{}",
            self.register.name,
            self.node,
            self.text
                .message
                .as_ref()
                .map_or_else(String::new, |own| format!(" ({own})"))
        );
        let unread = |error: Error| match error {
            Error::Link(trouble) => trouble,
            error => Trouble::Lost(format!("{name} cannot be read: {error}")),
        };
        let axis = driver.axes().find(|axis| axis.node == self.node);
        let axis = axis.ok_or_else(|| unread(Error::NoSuchDrive(self.node)))?;
        if driver.has_cycle(axis, self.register.number) {
            return Ok(());
        }
        let mut word = |register| {
            let reply = driver.read(axis, register).map_err(unread)?;
            Ok::<_, Trouble>((reply.number() & i64::from(u32::MAX)) as u32)
        };
        let raw = word(self.register.number)?;
        let (holds, required) = match self.wanted {
            Wanted::Bit(bit, level) => {
                let high = raw >> bit & 1 == 1;
                let name = self.text.bit.as_deref().unwrap_or_default();
                let wanted = if level == Level::High { 1 } else { 0 };
                (
                    high == (level == Level::High),
                    format!("{name} = {wanted} is required"),
                )
            }
            Wanted::Within(min, max) => {
                let mut scaling = Scaling::default();
                if usual(self.register.unit).is_some() {
                    scaling.rpm_max = (word(0xCE)? & 0xFFFF) as u16;
                    scaling.device_current = (word(0xC6)? & 0xFFFF) as u16;
                    scaling.units_at_200 = (word(0xD9)? & 0xFFFF) as u16;
                }
                let number = |given: Option<Given>| match given {
                    Some(given) => value(self.register, raw, given, scaling),
                    None => Some(self.register.number_of(raw) as f64),
                };
                // What has no meaning is within no bounds.
                let above = min.is_none_or(|own| number(own.1).is_some_and(|is| is >= own.0));
                let below = max.is_none_or(|own| number(own.1).is_some_and(|is| is <= own.0));
                let texts = [("at least", &self.text.min), ("at most", &self.text.max)];
                let texts = texts.iter().filter_map(|(word, text)| {
                    let text = text.as_ref()?;
                    Some(format!("{word} {text}"))
                });
                let texts: Vec<_> = texts.collect();
                (
                    above && below,
                    format!("{} is required", texts.join(" and ")),
                )
            }
        };
        match holds {
            true => Ok(()),
            false => Err(Trouble::Interlock(format!(
                "{name}: {raw:X} was read, {required}"
            ))),
        }
    }
}

/// Reads a bound: a number with a unit of the register, or a whole number where it has none.
fn bound(text: &str, register: &Register) -> Result<Bound, (String, String)> {
    let end = text.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == '%');
    let (number, unit) = (end.trim(), text[end.len()..].trim());
    let expected = match usual(register.unit) {
        Some(unit) => format!(
            "a number with its unit, such as 10{}, expected here",
            unit.name()
        ),
        None => "the register has no unit: a whole number in quotes expected here".to_owned(),
    };
    let given = Given::from_name(unit);
    let scales = given.is_none_or(|own| value(register, 0, own, Scaling::default()).is_some());
    let fits = match usual(register.unit) {
        Some(_) => given.is_some() && scales,
        None => unit.is_empty() && number.parse::<i64>().is_ok(),
    };
    let parsed = number.parse::<f64>().ok().filter(|own| own.is_finite());
    match parsed.filter(|_| fits) {
        Some(parsed) => Ok(Bound(parsed, given)),
        None => Err((
            format!("`{text}` is no bound of {}", register.name),
            expected,
        )),
    }
}
