//! Parameters and process words on a command line: `1205.3 = 50.0Hz`, `"Accel. time" = 5s`, `STW=047F HSW=50%`, and how they are shown.

use super::driver::{fault_name, percent};
use harness_bench::command::cyclic::{Setpoint, setpoint, word};
use harness_bench::scenario::problem::nearest;
use harness_proto::nordac::parameter::{Flag, NoParameter};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::words::{STW, State, ZSW, set_bits};
use harness_proto::nordac::{Image, PARAMETERS, Parameter, ParameterRef};

/// The word that means every parameter.
pub(crate) const ALL: &str = "all";

/// The word that begins the next step of an exchange.
pub(crate) const THEN: &str = "then";

/// A process word of a reply (NORDAC 3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReplyWord {
    Status,
    /// The main actual value.
    Actual,
    /// Actual value 2.
    Second,
}

impl ReplyWord {
    /// All of them, with their names.
    pub(crate) const ALL: [(&'static str, Self); 3] = [
        ("ZSW", Self::Status),
        ("HIW", Self::Actual),
        ("PZD4", Self::Second),
    ];

    #[must_use]
    pub(crate) fn name(self) -> &'static str {
        let row = Self::ALL.iter().find(|(_, word)| *word == self);
        row.map_or("", |(name, _)| name)
    }

    /// Its value in a reply.
    #[must_use]
    pub(crate) const fn of(self, image: &Image) -> u16 {
        match self {
            Self::Status => image.first(),
            Self::Actual => image.main(),
            Self::Second => image.fourth(),
        }
    }

    /// Its meaning: the state, percent of the maximum frequency, or nothing (what PZD4 means, 1517 says).
    #[must_use]
    pub(crate) fn words(self, value: u16) -> String {
        match self {
            Self::Status => status(value),
            Self::Actual => percentage(value),
            Self::Second => String::new(),
        }
    }
}

/// A setpoint or actual value in percent of the maximum frequency, with one decimal place.
#[must_use]
pub(crate) fn percentage(word: u16) -> String {
    // Adding 0 makes -0 positive.
    let tenths = (percent(word) * 10.0).round() / 10.0 + 0.0;
    format!("{tenths:.1} %")
}

/// What is read of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cell {
    /// A process word of a reply.
    Word(ReplyWord),
    /// A parameter, of one set and element.
    Parameter(ParameterRef),
}

impl Cell {
    /// How it is called: `ZSW`, `1205.3 Maximum frequ.`
    #[must_use]
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Word(word) => word.name().to_owned(),
            Self::Parameter(parameter) => format!("{parameter} {}", parameter.parameter.name),
        }
    }
}

/// The parameter of this number or name.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub(crate) fn parameter(text: &str) -> Result<ParameterRef, String> {
    ParameterRef::parse(text).map_err(|error| {
        let names: Vec<_> = PARAMETERS.iter().map(|parameter| parameter.name).collect();
        let near = match error {
            NoParameter::Name => nearest(text, &names),
            _ => None,
        };
        match near {
            Some(near) => format!("there is no parameter `{text}`: did you mean `{near}`?"),
            None => format!("`{text}`: {error}; `drivebench cells --bus nordac` lists them"),
        }
    })
}

/// What these texts name, each once and in their order; [`ALL`] for every parameter, in every set and with every element.
///
/// # Errors
/// The first name that is wrong.
pub(crate) fn cells(texts: &[String]) -> Result<Vec<Cell>, String> {
    let mut found: Vec<Cell> = Vec::new();
    for text in texts {
        let word = ReplyWord::ALL
            .iter()
            .find(|(name, _)| text.eq_ignore_ascii_case(name));
        match (word, text.as_str()) {
            (Some((_, word)), _) => found.push(Cell::Word(*word)),
            (None, ALL) => found.extend(every(|_| true).map(Cell::Parameter)),
            (None, name) => found.push(Cell::Parameter(parameter(name)?)),
        }
    }
    let mut place = 0;
    // `all` names hundreds, each once.
    if !texts.iter().any(|text| text == ALL) || texts.len() > 1 {
        while place < found.len() {
            match found[..place].contains(&found[place]) {
                true => drop(found.remove(place)),
                false => place += 1,
            }
        }
    }
    Ok(found)
}

/// Every set and element of the parameters that are wanted.
pub(crate) fn every(wanted: impl Fn(&Parameter) -> bool) -> impl Iterator<Item = ParameterRef> {
    PARAMETERS
        .iter()
        .filter(move |parameter| wanted(parameter))
        .flat_map(|parameter| {
            let sets = 0..parameter.sets();
            (0..u16::from(parameter.count)).flat_map(move |element| {
                sets.clone().map(move |set| ParameterRef {
                    parameter,
                    index: Index { element, set },
                })
            })
        })
}

/// What is to be written into a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Assignment {
    pub(crate) parameter: ParameterRef,
    /// Its value, in steps of its unit.
    pub(crate) number: i64,
}

/// Reads assignments: `1205.3=50Hz`, or in words of their own `Accel. time = 5 s`.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub(crate) fn assignments(texts: &[String]) -> Result<Vec<Assignment>, String> {
    // A space can stand anywhere in an assignment: the next one begins after a value and its unit.
    let mut all: Vec<(String, Option<String>)> = Vec::new();
    for text in texts {
        let unfinished = match all.last_mut() {
            Some((_, Some(value))) if value.is_empty() || is_unit(text) => {
                if !text.contains('=') {
                    value.push_str(text);
                    continue;
                }
                None
            }
            Some((name, value @ None)) => Some((name, value)),
            _ => None,
        };
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name, Some(value.trim().to_owned())),
            None => (text.as_str(), None),
        };
        match unfinished {
            Some((begun, rest)) => {
                begun.push(' ');
                begun.push_str(name);
                *rest = value;
            }
            None => all.push((name.to_owned(), value)),
        }
    }
    let one = |(name, value): &(String, Option<String>)| {
        let name = name.trim();
        let value = value.as_deref().filter(|value| !value.is_empty());
        let value = value.ok_or_else(|| {
            format!(
                "`{name}` is no assignment: PARAMETER=VALUE expected, such as \"Accel. time\" = 5s"
            )
        })?;
        assignment(name, value)
    };
    all.iter().map(one).collect()
}

/// Whether a text is the unit of some parameter.
fn is_unit(text: &str) -> bool {
    text == "rpm"
        || PARAMETERS.iter().any(|parameter| {
            !parameter.unit.name.is_empty() && parameter.unit.name.eq_ignore_ascii_case(text)
        })
}

/// Octets in hexadecimal: `81 00`.
pub(crate) fn hex<'a>(octets: impl IntoIterator<Item = &'a u8>) -> String {
    let octets = octets.into_iter().map(|octet| format!("{octet:02X}"));
    octets.collect::<Vec<_>>().join(" ")
}
fn assignment(name: &str, value: &str) -> Result<Assignment, String> {
    let parameter = parameter(name)?;
    let row = parameter.parameter;
    if row.has(Flag::ReadOnly) {
        return Err(format!("parameter {parameter} ({}) is read only", row.name));
    }
    let wrong = |why: String| format!("`{value}` is no value of {parameter} ({}): {why}", row.name);
    let number = row.parse(parameter.index.element, value);
    let number = number.map_err(|error| wrong(error.to_string()))?;
    match row.raw_of(number) {
        Some(_) => Ok(Assignment { parameter, number }),
        None => Err(wrong("it is larger than the parameter".to_owned())),
    }
}

/// The words of one step of an exchange. What is not given stays as it is in the step before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ExchangeStep {
    /// STW.
    pub(crate) control: Option<u16>,
    /// HSW.
    pub(crate) setpoint: Option<Setpoint>,
    /// PZD3.
    pub(crate) third: Option<u16>,
    /// PZD4.
    pub(crate) fourth: Option<u16>,
}

/// Reads the steps of an exchange: `STW=047E then STW=047F HSW=50%`.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub(crate) fn steps(texts: &[String]) -> Result<Vec<ExchangeStep>, String> {
    let mut steps = vec![ExchangeStep::default()];
    for text in texts {
        if text == THEN {
            steps.push(ExchangeStep::default());
            continue;
        }
        let expected = "STW=047F, HSW=50%, HSW=20Hz, PZD3=0000, PZD4=2000 or `then` expected";
        let wrong = || format!("`{text}` is no process word: {expected}");
        let (name, value) = text.split_once('=').ok_or_else(wrong)?;
        let Some(step) = steps.last_mut() else {
            return Err(wrong());
        };
        let twice = match name.trim().to_ascii_uppercase().as_str() {
            "STW" => step.control.replace(word(value)?).is_some(),
            "HSW" => step.setpoint.replace(setpoint(value)?).is_some(),
            "PZD3" => step.third.replace(word(value)?).is_some(),
            "PZD4" => step.fourth.replace(word(value)?).is_some(),
            _ => return Err(wrong()),
        };
        if twice {
            return Err(format!(
                "`{text}` gives {name} a second time in one step: `{THEN}` begins the next step"
            ));
        }
    }
    match steps.iter().any(|step| *step == ExchangeStep::default()) {
        true => Err("a step has no words: STW=047E, for example, expected".to_owned()),
        false => Ok(steps),
    }
}

/// A value of a parameter in words: with its unit, as a fault, or as bits.
#[must_use]
pub(crate) fn shown(parameter: &ParameterRef, number: i64) -> String {
    let element = parameter.index.element;
    let fault = matches!(
        (parameter.parameter.number, element),
        (1800, _) | (1801..=1805, 0) | (947, _)
    );
    let word = u16::try_from(number).unwrap_or_default();
    match parameter.parameter.number {
        _ if fault => fault_name(number)
            .map_or_else(|| number.to_string(), |name| format!("{number} ({name})")),
        967 => named(set_bits(&STW, word).map(|bit| bit.name)),
        968 => status(word),
        _ => parameter.parameter.show(element, number).to_string(),
    }
}

fn named<'n>(names: impl Iterator<Item = &'n str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

/// The state that a status word shows, and its other bits that are 1 (NORDAC 3.2.2).
#[must_use]
pub(crate) fn status(zsw: u16) -> String {
    // The bits of the state itself, and OFF2 and OFF3, which are named where they are active.
    const STATE: u16 = 0x007F;
    let state = State::of_zsw(zsw).map_or("no state of the manual", State::name);
    let mut all = vec![state.to_owned()];
    if zsw & 0x0010 == 0 {
        all.push("OFF2 active".to_owned());
    }
    if zsw & 0x0020 == 0 {
        all.push("OFF3 active".to_owned());
    }
    let others = set_bits(&ZSW, zsw & !STATE & 0x3FFF);
    all.extend(others.map(|bit| bit.one.to_owned()));
    let set = zsw >> 14;
    if set != 0 {
        all.push(format!("parameter set {}", set + 1));
    }
    all.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(texts: &[&str]) -> Result<Vec<(String, i64)>, String> {
        let texts: Vec<_> = texts.iter().map(|text| (*text).to_owned()).collect();
        let found = assignments(&texts)?;
        let shown = found
            .iter()
            .map(|assignment| (assignment.parameter.to_string(), assignment.number));
        Ok(shown.collect())
    }

    /// Names, numbers, sets and units (5, 3.4.3), with spaces anywhere.
    #[test]
    fn assignments_in_every_form() {
        for (texts, wanted) in [
            (&["1202=5s"][..], &[("1202", 100)][..]),
            (&["Accel. time = 5s"], &[("1202", 100)]),
            (&["Accel. time", "=", "5s"], &[("1202", 100)]),
            (&["Accel.", "time", "=", "5", "s"], &[("1202", 100)]),
            (&["accel. time=", "5s"], &[("1202", 100)]),
            (&["1205.3", "=50.0Hz"], &[("1205.3", 500)]),
            (&["1205.3", "=", "500"], &[("1205.3", 500)]),
            (
                &[
                    "Accel. time",
                    "=",
                    "5",
                    "s",
                    "Decel. time",
                    "=",
                    "3s",
                    "1600=2",
                ],
                &[("1202", 100), ("1203", 60), ("1600", 2)],
            ),
            (&["1415 = -1.0 Hz"], &[("1415", -10)]),
        ] {
            let wanted: Vec<_> = wanted
                .iter()
                .map(|(name, number)| ((*name).to_owned(), *number))
                .collect();
            assert_eq!(all(texts), Ok(wanted), "{texts:?}");
        }
    }

    #[test]
    fn mistakes_name_what_is_expected() {
        for (texts, part) in [
            (&["Acel. time=5s"][..], "did you mean `Accel. time`?"),
            (&["1999=5"], "there is no parameter with this number"),
            (&["1205.5=5"], "parameter 1205 has sets 1 to 4"),
            (
                &["1621.2=5"],
                "parameter 1621 has neither sets nor sub-indices",
            ),
            (&["1202"], "PARAMETER=VALUE expected"),
            (&["1202="], "PARAMETER=VALUE expected"),
            (&["1202=5.01s"], "the drive counts in steps of 0.05 s"),
            (&["1202=5Hz"], "is counted in s"),
            (&["1202=100000"], "larger than the parameter"),
            (&["1800=1"], "is read only"),
        ] {
            let error = all(texts).expect_err(part);
            assert!(error.contains(part), "{texts:?}: {error}");
        }
    }

    /// 3.2.3: 4000h is 100 %.
    #[test]
    fn process_words() {
        let read = |text: &str| {
            let texts: Vec<_> = text.split(' ').map(str::to_owned).collect();
            steps(&texts)
        };
        let found = read("STW=047E then stw=0x047F HSW=-50% PZD4=0FFF").expect("two steps");
        assert_eq!(found[0].control, Some(0x047E));
        let second = ExchangeStep {
            control: Some(0x047F),
            setpoint: Some(Setpoint::Raw(0xE000)),
            third: None,
            fourth: Some(0x0FFF),
        };
        assert_eq!(found[1], second);
        for (text, maximum, word) in [
            ("35Hz", 700, Some(0x2000)),
            ("-35Hz", 700, Some(0xE000)),
            ("0.1Hz", 700, Some(23)),
            ("0Hz", 0, Some(0)),
            ("10Hz", 0, None),
            ("200Hz", 700, None),
            ("2000", 700, Some(0x2000)),
            ("100%", 700, Some(0x4000)),
        ] {
            let setpoint = setpoint(text).expect(text);
            assert_eq!(setpoint.word(maximum), word, "{text}");
        }
        for (text, part) in [
            ("STW=47F", "four hexadecimal digits"),
            ("HSW=201%", "-200% to 199.99%"),
            ("HSW=fast", "50%, 20.0Hz or four hexadecimal digits"),
            ("ZSW=0000", "is no process word"),
            ("STW=047E STW=047F", "`then` begins the next step"),
            ("STW=047E then", "a step has no words"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    /// 3.2.2: the sequences of nordac's manual family.
    #[test]
    fn status_words_in_words() {
        let bus = "control by the bus requested";
        assert_eq!(
            status(0x0F37),
            format!(
                "operation enabled, actual value = setpoint, {bus}, reference value reached, clockwise"
            )
        );
        assert_eq!(
            status(0x4A48),
            format!(
                "no state of the manual, OFF2 active, OFF3 active, {bus}, clockwise, parameter set 2"
            )
        );
        let fault = parameter("1800").expect("a parameter");
        assert_eq!(shown(&fault, 10), "10 (bus time-out)");
        let first = every(|parameter| parameter.number == 1716);
        assert_eq!(first.count(), 256);
    }
}
