//! Lines that begin with `drive`.

use super::super::syntax::{FrameStep, Outside, PropertyValue, SetupKind};
use super::message::identifier;
use super::value;
use harness_bench::scenario::expression::{self, Located};
use harness_bench::scenario::parse::words::{deviation, equals, named};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::times;
use harness_proto::unitek::properties::{Accepts, PROFILES, PROPERTIES, UnitekProperty};
use harness_sim::unitek::deviation::DEVIATIONS;
use harness_sim::unitek::{Control, Inputs};

pub(super) enum ParsedDriveLine {
    /// A header line.
    Setup(SetupKind),
    /// A header line or a step.
    Outside(Outside),
    /// A step.
    Restart,
}

#[derive(Clone, Copy)]
enum Word {
    Rx,
    Tx,
    Profile,
    Property,
    Mode,
    Deviates,
    Register,
    Input,
    Force,
    Restart,
}

const WORDS: [(&str, Word); 10] = [
    ("register", Word::Register),
    ("input", Word::Input),
    ("force", Word::Force),
    ("restart", Word::Restart),
    ("property", Word::Property),
    ("profile", Word::Profile),
    ("mode", Word::Mode),
    ("deviates", Word::Deviates),
    ("rx", Word::Rx),
    ("tx", Word::Tx),
];

const MODES: [(&str, Control); 3] = [
    ("speed", Control::Speed),
    ("torque", Control::Torque),
    ("position", Control::Position),
];

/// The word of a control mode.
pub(in super::super) fn mode_word(mode: Control) -> &'static str {
    let row = MODES.iter().find(|(_, control)| *control == mode);
    row.map_or("", |(word, _)| word)
}

/// Reads what stands after `drive`.
pub(super) fn line(scanner: &mut Scanner<'_>) -> Result<(Located, ParsedDriveLine), Problem> {
    let drive = expression::sum(scanner)?;
    if scanner.at_end() {
        let there = SetupKind::There { rx: None, tx: None };
        return Ok((drive, ParsedDriveLine::Setup(there)));
    }
    let before = scanner.clone();
    let line = match named(scanner, &WORDS, "what the line says of the drive")? {
        Word::Rx | Word::Tx => {
            *scanner = before;
            ParsedDriveLine::Setup(identifiers(scanner)?)
        }
        Word::Profile => {
            let names = PROFILES.map(|name| (name, name));
            ParsedDriveLine::Setup(SetupKind::Profile(named(scanner, &names, "a profile")?))
        }
        Word::Property => ParsedDriveLine::Setup(property(scanner)?),
        Word::Mode => {
            ParsedDriveLine::Setup(SetupKind::Mode(named(scanner, &MODES, "a control mode")?))
        }
        Word::Deviates => {
            let known = deviation(scanner, &DEVIATIONS, "a drive", "`drive 1 deviates NAME`")?;
            ParsedDriveLine::Setup(SetupKind::Deviates(known))
        }
        Word::Register => {
            let register = value::register(scanner)?;
            equals(scanner)?;
            let value = value::value(scanner, register.unit())?;
            ParsedDriveLine::Outside(Outside::Register(register, value))
        }
        Word::Input => {
            let names = Inputs::SWITCHES.map(|name| (name, name));
            let input = named(scanner, &names, "an input")?;
            let levels = [("high", true), ("low", false)];
            let level = named(scanner, &levels, "a level")?;
            ParsedDriveLine::Outside(Outside::Input(input, level))
        }
        Word::Force => ParsedDriveLine::Outside(force(scanner)?),
        Word::Restart => ParsedDriveLine::Restart,
    };
    Ok((drive, line))
}

/// A line that begins with `drive`, as a step.
pub(super) fn step(scanner: &mut Scanner<'_>) -> Result<FrameStep, Problem> {
    let before = scanner.clone();
    let (drive, line) = line(scanner)?;
    match line {
        ParsedDriveLine::Outside(outside) => Ok(FrameStep::Outside(drive, outside)),
        ParsedDriveLine::Restart => Ok(FrameStep::Outside(drive, Outside::Restart)),
        // A time stands in front of it.
        ParsedDriveLine::Setup(_) => {
            *scanner = before;
            Err(scanner
                .unexpected("a drive and what happens to it (input, force, register, restart)"))
        }
    }
}

/// `rx 210 tx 190`, in either order; one of them may be left out.
fn identifiers(scanner: &mut Scanner<'_>) -> Result<SetupKind, Problem> {
    let (mut rx, mut tx) = (None, None);
    while !scanner.at_end() {
        let names = [("rx", true), ("tx", false)];
        let receives = named(scanner, &names, "an identifier of the drive")?;
        let before = scanner.clone();
        let id = identifier(scanner)?;
        let number = u16::try_from(id.number()).ok();
        let number = number.filter(|number| !id.is_extended() && *number != 0);
        let Some(number) = number else {
            *scanner = before;
            return Err(scanner.unexpected("an identifier from 001 to 7FF"));
        };
        let place = if receives { &mut rx } else { &mut tx };
        if place.replace(number).is_some() {
            *scanner = before;
            return Err(scanner.unexpected("the end of the line (it is given twice)"));
        }
    }
    Ok(SetupKind::There { rx, tx })
}

/// `map-reply = native`, `homing-time = 20ms`; without `=` as well.
fn property(scanner: &mut Scanner<'_>) -> Result<SetupKind, Problem> {
    let names = PROPERTIES.iter().map(|property| (property.name, property));
    let names: Vec<(&str, &'static UnitekProperty)> = names.collect();
    let property = named(scanner, &names, "a property")?;
    scanner.eat("=");
    let value = match property.accepts {
        Accepts::Words(words) => {
            let before = scanner.clone();
            let word = scanner.take_while(|c| c.is_ascii_alphanumeric() || c == '-');
            let word = word.map_or("", |word| word.value);
            if !words.contains(&word) {
                *scanner = before;
                let problem = scanner.unexpected(&words.join(" or "));
                return Err(problem.did_you_mean(word, words));
            }
            PropertyValue::Word(word.to_owned())
        }
        Accepts::Byte => {
            let before = scanner.clone();
            let digits = scanner.take_while(|c| c.is_ascii_hexdigit());
            let Some(digits) = digits.filter(|digits| digits.value.len() == 2) else {
                *scanner = before;
                return Err(scanner.unexpected("two hexadecimal digits"));
            };
            PropertyValue::Word(digits.value.to_ascii_uppercase())
        }
        Accepts::TimeUpTo(_) => PropertyValue::Time(times::duration(scanner)?),
    };
    Ok(SetupKind::Property(property, value))
}

/// `tol = 1`, `tol off`
fn force(scanner: &mut Scanner<'_>) -> Result<Outside, Problem> {
    let forced = Inputs::FORCED.map(|name| (name, name));
    // As the registers that show them are called.
    let others = [
        ("T_MOTOR", "motor-temperature"),
        ("T_IGBT", "igbt-temperature"),
        ("T_AIR", "air-temperature"),
        ("DC_BUS", "bus-voltage"),
        ("voltage", "bus-voltage"),
    ];
    let names = [&forced[..], &others].concat();
    let name = named(scanner, &names, "what is overruled")?;
    let equal = scanner.eat("=");
    if scanner.eat_word("off") {
        return Ok(Outside::Force(name, None));
    }
    if !equal {
        return Err(scanner.unexpected("`=` and a value, or `off`"));
    }
    let unit = value::register_of_force(name).map(|register| register.unit);
    Ok(Outside::Force(name, Some(value::value(scanner, unit)?)))
}
