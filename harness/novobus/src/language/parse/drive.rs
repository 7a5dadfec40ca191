//! Lines that begin with `drive`: what a drive holds or is before anything is sent, what happens to it
//! from outside the bus, and what must hold of it.

use super::value::{assigned, bytes, cell_by_name, cell_check, cell_names, eeprom_place, place};
use super::words::{deviates, drives, equals, named, required};
use crate::language::syntax::{Condition, DriveCheck, DriveRange, Influence, SetupKind, Showing};
use harness_bench::scenario::expression;
use harness_bench::scenario::problem::{Problem, Spanned};
use harness_bench::scenario::quantity::{self, Dimension};
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::units::{DriveType, INCREMENTS_PER_TURN};
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::nd21;
use harness_sim::nd21::{Mode, Stimulus};
use harness_sim::novobus::drive::Model;

/// The words with which such a line begins.
pub(crate) const WORDS: [&str; 2] = ["drive", "drives"];

/// Positions have 31 bits (ND21 13.1.9).
const MAX_TURNS: i32 = 16_384;

/// Maximum resistance in ohms: more is an open circuit.
const MAX_OHM: i32 = 10_000_000;

pub(crate) const DEVICES: [(&str, DriveType); 4] = [
    ("5605", DriveType::Nd5605),
    ("5610", DriveType::Nd5610),
    ("5615", DriveType::Nd5615),
    ("5620", DriveType::Nd5620),
];

/// What stands behind the drives.
pub(crate) enum DriveLine {
    /// What it holds or is; in the header only.
    Setup(SetupKind),
    /// What happens to it.
    Influence(Influence),
    /// What must hold.
    Condition(Condition),
}

#[derive(Clone, Copy)]
enum DriveWord {
    Memory,
    Eeprom,
    Property,
    Deviates,
    Model,
    Type,
    Input,
    Cam,
    Analogue,
    Frequency,
    Cooler,
    MotorSensor,
    Rail,
    Resolver,
    Load,
    Rotor,
    Phases,
    Power,
}

/// What can be set, and what can happen.
const SETTINGS: [(&str, DriveWord); 18] = [
    ("memory", DriveWord::Memory),
    ("eeprom", DriveWord::Eeprom),
    ("property", DriveWord::Property),
    ("deviates", DriveWord::Deviates),
    ("model", DriveWord::Model),
    ("type", DriveWord::Type),
    ("input", DriveWord::Input),
    ("cam", DriveWord::Cam),
    ("analogue", DriveWord::Analogue),
    ("frequency", DriveWord::Frequency),
    ("cooler", DriveWord::Cooler),
    ("motor-sensor", DriveWord::MotorSensor),
    ("rail", DriveWord::Rail),
    ("resolver", DriveWord::Resolver),
    ("load", DriveWord::Load),
    ("rotor", DriveWord::Rotor),
    ("phases", DriveWord::Phases),
    ("power", DriveWord::Power),
];

#[derive(Clone, Copy)]
enum ConditionWord {
    Memory,
    In,
    Not,
    Normal,
    Gpo1,
    Gpo2,
    Ready,
    AnalogueOutput,
    Encoder,
    Display,
    Mode,
}

/// What can hold, beside the cells.
const CONDITIONS: [(&str, ConditionWord); 11] = [
    ("memory", ConditionWord::Memory),
    ("in", ConditionWord::In),
    ("not", ConditionWord::Not),
    ("normal", ConditionWord::Normal),
    ("GPO1", ConditionWord::Gpo1),
    ("GPO2", ConditionWord::Gpo2),
    ("ready", ConditionWord::Ready),
    ("analogue-output", ConditionWord::AnalogueOutput),
    ("encoder", ConditionWord::Encoder),
    ("display", ConditionWord::Display),
    ("mode", ConditionWord::Mode),
];

/// Reads the text after `drive`.
pub(crate) fn line(scanner: &mut Scanner<'_>) -> Result<(DriveRange, DriveLine), Problem> {
    let drives = drives(scanner)?;
    let before = scanner.clone();
    let word = scanner.word().map_or("", |word| word.value);
    let line = match SETTINGS.iter().find(|(name, _)| *name == word) {
        Some((_, word)) => setting(*word, scanner)?,
        None => {
            *scanner = before;
            let set: Vec<_> = SETTINGS.iter().map(|(name, _)| *name).collect();
            DriveLine::Condition(condition(scanner, &set)?)
        }
    };
    Ok((drives, line))
}

/// Reads the text after `? drive` and `until drive`.
pub(crate) fn check(scanner: &mut Scanner<'_>) -> Result<DriveCheck, Problem> {
    let here = scanner.here();
    let drives = drives(scanner)?;
    let condition = condition(scanner, &[])?;
    Ok(DriveCheck {
        drives,
        condition,
        span: scanner.since(here),
    })
}

fn setting(word: DriveWord, scanner: &mut Scanner<'_>) -> Result<DriveLine, Problem> {
    let one = |stimulus| Ok(DriveLine::Influence(Influence::Stimuli(vec![stimulus])));
    let number = |scanner: &mut Scanner<'_>, dimension, parts, least, most| {
        quantity::quantity(scanner, Some(dimension))?.whole(parts, least, most)
    };
    match word {
        DriveWord::Memory => {
            let place = place(scanner)?;
            let value = assigned(scanner, &place)?;
            Ok(DriveLine::Setup(SetupKind::Memory(place, value)))
        }
        DriveWord::Eeprom => {
            let place = eeprom_place(scanner)?;
            let value = assigned(scanner, &place)?;
            Ok(DriveLine::Setup(SetupKind::Eeprom(place, value)))
        }
        DriveWord::Property => Ok(DriveLine::Setup(property(scanner)?)),
        DriveWord::Deviates => Ok(DriveLine::Setup(SetupKind::Deviates(deviates(scanner)?))),
        DriveWord::Model => {
            let model = named(scanner, &Model::NAMES, "a drive model")?;
            Ok(DriveLine::Setup(SetupKind::Model(model)))
        }
        DriveWord::Type => device(scanner),
        DriveWord::Input => Ok(DriveLine::Influence(Influence::Stimuli(inputs(scanner)?))),
        DriveWord::Cam => one(cam(scanner)?),
        DriveWord::Analogue => {
            let millivolts = number(scanner, Dimension::Voltage, 1_000, -10, 10)?;
            one(Stimulus::Analogue(millivolts))
        }
        DriveWord::Frequency => {
            let hertz = number(scanner, Dimension::Frequency, 1, 0, 1_000_000)?;
            one(Stimulus::Frequency(hertz.unsigned_abs()))
        }
        DriveWord::Cooler => {
            let tenths = number(scanner, Dimension::Temperature, 10, -50, 200)?;
            one(Stimulus::Cooler(tenths))
        }
        DriveWord::MotorSensor => {
            let ohms = number(scanner, Dimension::Resistance, 1, 0, MAX_OHM)?;
            one(Stimulus::MotorSensor(ohms.unsigned_abs()))
        }
        DriveWord::Rail => {
            let volts = number(scanner, Dimension::Voltage, 1, 0, 1_000)?;
            one(Stimulus::Rail(volts.unsigned_abs()))
        }
        DriveWord::Load => {
            let milliamperes = number(scanner, Dimension::Current, 1_000, -100, 100)?;
            one(Stimulus::Load(milliamperes))
        }
        DriveWord::Resolver => one(Stimulus::Resolver(either(scanner, ["off", "on"])?)),
        DriveWord::Rotor => one(Stimulus::Jammed(either(scanner, ["free", "jammed"])?)),
        DriveWord::Phases => one(Stimulus::Short(either(scanner, ["sound", "shorted"])?)),
        DriveWord::Power => {
            let on = either(scanner, ["off", "on"])?;
            Ok(DriveLine::Influence(Influence::Power(on)))
        }
    }
}

/// One of two words; true for the second.
fn either(scanner: &mut Scanner<'_>, [no, yes]: [&str; 2]) -> Result<bool, Problem> {
    named(scanner, &[(no, false), (yes, true)], "its state")
}

fn device(scanner: &mut Scanner<'_>) -> Result<DriveLine, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.chunk().value;
    match DEVICES.iter().find(|(name, _)| *name == digits) {
        Some((_, device)) => {
            *scanner = ahead;
            Ok(DriveLine::Setup(SetupKind::Type(*device)))
        }
        None => Err(scanner.unexpected("a type: 5605, 5610, 5615 or 5620 (ND21 4.2.2)")),
    }
}

fn property(scanner: &mut Scanner<'_>) -> Result<SetupKind, Problem> {
    let bus = PROPERTIES.iter().map(|p| p.name);
    let known: Vec<_> = bus
        .chain(nd21::PROPERTIES.iter().map(|p| p.name))
        .map(|name| (name, name))
        .collect();
    let here = scanner.here();
    let name = named(scanner, &known, "a property")?;
    let name = Spanned {
        value: name.to_owned(),
        span: scanner.since(here),
    };
    equals(scanner)?;
    if scanner.peek().is_some_and(|c| c.is_ascii_digit()) {
        return Ok(SetupKind::Time(name, times::duration(scanner)?));
    }
    let Some(word) = scanner.word() else {
        return Err(scanner.unexpected("a value"));
    };
    let word = Spanned {
        value: word.value.to_owned(),
        span: word.span,
    };
    Ok(SetupKind::Word(name, word))
}

/// `GPIN4 3turns..3.5turns`: the positions of the rotor since power-up between which it is high.
fn cam(scanner: &mut Scanner<'_>) -> Result<Stimulus, Problem> {
    let names = Input::ALL.map(|input| (input.name(), input));
    let input = named(scanner, &names, "an input")?;
    let position = |scanner: &mut Scanner<'_>| {
        let turns = quantity::quantity(scanner, Some(Dimension::Angle))?;
        let increments = turns.whole(INCREMENTS_PER_TURN.cast_signed(), -MAX_TURNS, MAX_TURNS)?;
        Ok((i64::from(increments), turns.span))
    };
    let (from, _) = position(scanner)?;
    if !scanner.eat("..") {
        return Err(scanner.unexpected("`..` and where it ends, as in 3turns..3.5turns"));
    }
    let (to, span) = position(scanner)?;
    if to <= from {
        return Err(Problem::new(
            span,
            "the cam ends before it begins",
            "a position beyond the first expected here",
        ));
    }
    Ok(Stimulus::Cam(input, from, to))
}

/// `GPIN3 GPIN5 high`
fn inputs(scanner: &mut Scanner<'_>) -> Result<Vec<Stimulus>, Problem> {
    let mut inputs = Vec::new();
    loop {
        let mut ahead = scanner.clone();
        let word = ahead.word().map_or("", |word| word.value);
        let level = match word {
            "high" if !inputs.is_empty() => true,
            "low" if !inputs.is_empty() => false,
            name => {
                let Some(input) = Input::from_name(name) else {
                    let expected = if inputs.is_empty() {
                        "an input (GPIN1 to GPIN8, ESCHP or ESCHN)"
                    } else {
                        "`high`, `low` or another input"
                    };
                    let inputs = Input::ALL.map(Input::name);
                    let known: Vec<_> = inputs.into_iter().chain(["high", "low"]).collect();
                    return Err(scanner.unexpected(expected).did_you_mean(name, &known));
                };
                inputs.push(input);
                *scanner = ahead;
                continue;
            }
        };
        *scanner = ahead;
        let stimuli = inputs
            .into_iter()
            .map(|input| Stimulus::Input(input, level));
        return Ok(stimuli.collect());
    }
}

/// What must hold; `others` may stand in its place and are named in mistakes.
fn condition(scanner: &mut Scanner<'_>, others: &[&'static str]) -> Result<Condition, Problem> {
    let before = scanner.clone();
    let word = scanner.word().map_or("", |word| word.value);
    if let Some((_, held)) = CONDITIONS.iter().find(|(name, _)| *name == word) {
        return held_condition(*held, scanner);
    }
    *scanner = before;
    if let Some(place) = cell_by_name(scanner) {
        return Ok(Condition::Cell(cell_check(scanner, place)?));
    }
    let conditions = CONDITIONS.iter().map(|(name, _)| *name);
    let known: Vec<_> = others.iter().copied().chain(conditions).collect();
    let expected = if others.is_empty() {
        format!("a condition ({}, or a cell's name)", known.join(", "))
    } else {
        "a setting or a condition".to_owned()
    };
    let names: Vec<_> = known.iter().copied().chain(cell_names()).collect();
    let chunk = scanner.clone().chunk().value;
    let found = if word.is_empty() { chunk } else { word };
    let mut problem = scanner.unexpected(&expected);
    if !others.is_empty() {
        problem = problem.help(format!("{}, or a cell's name", known.join(", ")));
    }
    Err(problem.did_you_mean(found, &names))
}

fn held_condition(held: ConditionWord, scanner: &mut Scanner<'_>) -> Result<Condition, Problem> {
    let showing = match held {
        ConditionWord::Memory => {
            let place = place(scanner)?;
            if scanner.clone().eat("&") {
                return Ok(Condition::Cell(cell_check(scanner, place)?));
            }
            equals(scanner)?;
            return Ok(Condition::Memory(place, bytes(scanner)?));
        }
        ConditionWord::Normal => return Ok(Condition::InError(false)),
        ConditionWord::In => {
            required(scanner, &["error"])?;
            return Ok(Condition::InError(true));
        }
        ConditionWord::Not => {
            required(scanner, &["in"])?;
            required(scanner, &["error"])?;
            return Ok(Condition::InError(false));
        }
        ConditionWord::Gpo1 => Showing::Gpo1(either(scanner, ["low", "high"])?),
        ConditionWord::Gpo2 => Showing::Gpo2(either(scanner, ["low", "high"])?),
        ConditionWord::Ready => Showing::Ready(either(scanner, ["open", "closed"])?),
        ConditionWord::AnalogueOutput => {
            equals(scanner)?;
            let voltage = quantity::quantity(scanner, Some(Dimension::Voltage))?;
            let millivolts = voltage.whole(1_000, -20, 20)?;
            let tolerance = quantity::tolerance(scanner, Dimension::Voltage)?;
            Showing::Analogue(millivolts, voltage, tolerance)
        }
        ConditionWord::Encoder => {
            equals(scanner)?;
            let count = signed(scanner)?;
            let off = if quantity::plus_minus(scanner) {
                expression::plain(scanner)?
            } else {
                0
            };
            Showing::Encoder(count, off)
        }
        ConditionWord::Display => Showing::Display(display(scanner)?),
        ConditionWord::Mode => Showing::Mode(named(scanner, &Mode::NAMES, "a mode (ND21 11.8)")?),
    };
    Ok(Condition::Shows(showing))
}

fn signed(scanner: &mut Scanner<'_>) -> Result<i64, Problem> {
    let negative = scanner.eat("-");
    let number = expression::plain(scanner)?;
    Ok(if negative { -number } else { number })
}

/// Three digits, or `blank`.
fn display(scanner: &mut Scanner<'_>) -> Result<Option<[u8; 3]>, Problem> {
    if scanner.eat_word("blank") {
        return Ok(None);
    }
    let mut ahead = scanner.clone();
    let chunk = ahead.chunk().value;
    let digits: Vec<_> = chunk.chars().filter_map(|c| c.to_digit(16)).collect();
    match digits[..] {
        [a, b, c] if chunk.len() == 3 => {
            *scanner = ahead;
            let digit = |d: u32| u8::try_from(d).unwrap_or(0);
            Ok(Some([digit(a), digit(b), digit(c)]))
        }
        _ => Err(scanner.unexpected("the three digits of an error, such as 508, or `blank`")),
    }
}

/// Any error of the drive: its code of four digits, or its printed name (ND21 14.11).
pub(crate) fn error(scanner: &mut Scanner<'_>) -> Result<ErrorCode, Problem> {
    let text = scanner.rest().to_owned();
    let named = |error: &&ErrorCode| {
        let code = format!("{:04X}", error.code());
        error.printed_name().eq_ignore_ascii_case(&text) || code.eq_ignore_ascii_case(&text)
    };
    if let Some(error) = ErrorCode::ALL.iter().find(named) {
        scanner.eat(&text);
        return Ok(*error);
    }
    let names: Vec<_> = ErrorCode::ALL
        .iter()
        .map(|error| error.printed_name())
        .collect();
    Err(scanner
        .unexpected("an error code of four digits or its printed name (ND21 14.11)")
        .did_you_mean(&text, &names))
}
