//! `drivebench params` on NORDAC inverters: the parameters that can be written, of every set, in a file and back.
//!
//! ```toml
//! [nordac]
//! "1202.1" = 100    # Accel. time  5.00 s
//! ```

use super::bench::driver;
use super::read::ReadCell;
use super::write::refuse_denied;
use crate::driver::{Driver, Error};
use crate::rig::{Inverters, Session};
use crate::value::{Assignment, Cell, every, parameter, shown};
use harness_bench::command::drives::CommandDrives as _;
use harness_bench::command::failure::Failure;
use harness_bench::command::params::{EntryMistake, ParameterFile};
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::{Parameter, ParameterRef, PkwError};
use toml::de::DeValue;

/// What does something and keeps nothing (970, 971, 1602), and the password: not in a file.
const NOT_KEPT: [u16; 5] = [970, 971, 1602, 1603, 1604];

/// Bus mode, interface, PPO type, rate and address: two inverters with those of one file could not be told apart, and would change who controls
/// them.
const REACHED: [u16; 6] = [1619, 1620, 1621, 1622, 1623, 1624];

fn is_kept(parameter: &Parameter) -> bool {
    !parameter.has(Flag::ReadOnly) && !NOT_KEPT.contains(&parameter.number)
}

pub(super) const PARAMETERS: ParameterFile<Inverters, Assignment> = ParameterFile {
    table: "nordac",
    about: ", as the numbers that travel: number and, where it depends on them, element and set",
    expected: [
        "a parameter that can be written expected here",
        "a whole number, or a value with its unit in quotes, expected here",
    ],
    entry,
    no_table: |key| format!("there is no table `{key}`"),
    read,
    compare,
    is_loaded: |wanted| !REACHED.contains(&wanted.parameter.parameter.number),
    never_loaded: "say how the inverter is reached and who controls it, and are never loaded (1619 to 1624)",
    write: |session, slave, orders, _| {
        let mut driver = driver(session);
        refuse_denied(&driver, slave, orders)?;
        Ok(write_all(&mut driver, slave, orders)?)
    },
    written: "written, and the inverter answered with the values",
    stores_nothing: Some(
        "--store is for drives that lose what is written; this one stores every parameter at once (971)",
    ),
};

/// Writes parameters. One whose limit is another of them, such as 1204 and 1205, is written after it.
fn write_all(driver: &mut Driver<'_>, slave: u8, orders: &[Assignment]) -> Result<(), Error> {
    let mut left = orders.to_vec();
    loop {
        let mut refused = None;
        let mut again = Vec::new();
        for order in &left {
            match driver.write(slave, &order.parameter, order.number) {
                Ok(_) => {}
                Err(
                    error @ Error::Refused {
                        error: PkwError::Limit,
                        ..
                    },
                ) => {
                    again.push(*order);
                    refused.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        match refused {
            None => return Ok(()),
            Some(error) if again.len() == left.len() => return Err(error),
            Some(_) => left = again,
        }
    }
}

/// The lines of a file with the parameters of a slave.
fn read(session: &mut Session, slave: u8) -> Result<Vec<String>, Failure> {
    let all: Vec<_> = every(is_kept).map(Cell::Parameter).collect();
    let found = Inverters::read(session, &[slave], &all)?;
    Ok(found.iter().filter_map(line).collect())
}

fn line(found: &ReadCell) -> Option<String> {
    let Cell::Parameter(cell) = found.cell else {
        return None;
    };
    let key = format!("\"{}\"", key(&cell));
    let (number, name) = (found.number, cell.parameter.name);
    Some(format!(
        "{key:11} = {number:6} # {name:22} {}",
        found.words()
    ))
}

/// The key of a parameter: with its set even where that is the first one.
fn key(parameter: &ParameterRef) -> String {
    let ParameterRef {
        parameter: row,
        index,
    } = parameter;
    let (number, set) = (row.number, index.set + 1);
    match (row.is_array(), row.has(Flag::Set)) {
        (true, true) => format!("{number}.{}.{set}", index.element),
        (false, true) => format!("{number}.{set}"),
        _ => parameter.to_string(),
    }
}

/// The parameters that read differently from a file.
fn compare(
    session: &mut Session,
    slave: u8,
    wanted: &[Assignment],
) -> Result<Vec<(Assignment, String)>, Failure> {
    let mut driver = driver(session);
    driver.join(slave)?;
    let mut differing = Vec::new();
    for wanted in wanted {
        let reads = driver.read(slave, &wanted.parameter)?;
        if reads != wanted.number {
            let line = format!(
                "{:9} {:22} file {}  slave {}\n",
                key(&wanted.parameter),
                wanted.parameter.parameter.name,
                shown(&wanted.parameter, wanted.number),
                shown(&wanted.parameter, reads)
            );
            differing.push((*wanted, line));
        }
    }
    Ok(differing)
}

/// A line of a file.
fn entry(key: &str, value: &DeValue<'_>) -> Result<Assignment, EntryMistake> {
    let found = parameter(key).map_err(EntryMistake::Key)?;
    let known = found.parameter;
    if !is_kept(known) {
        let why = format!("parameter {found} ({}) is not kept in a file", known.name);
        return Err(EntryMistake::Key(why));
    }
    let wrong =
        |why: &dyn std::fmt::Display| EntryMistake::Value(format!("{key} ({}): {why}", known.name));
    let text = match value {
        DeValue::Integer(number) => number.to_string(),
        DeValue::String(text) => text.to_string(),
        _ => return Err(wrong(&"this is no number")),
    };
    let number = known
        .parse(found.index.element, &text)
        .map_err(|error| wrong(&error))?;
    match known.raw_of(number) {
        Some(_) => Ok(Assignment {
            parameter: found,
            number,
        }),
        None => Err(wrong(&"it is larger than the parameter")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_bench::scenario::source::Source;

    fn read(text: &str) -> Result<Vec<(String, i64)>, Vec<String>> {
        let source = Source::from_bytes("p.toml".to_owned(), text.into()).expect("a text");
        let found = PARAMETERS.parse(&source).map_err(|problems| {
            let all = problems.all().iter();
            all.map(|problem| format!("{}: {}", problem.span.start, problem.message))
                .collect::<Vec<_>>()
        })?;
        let all = found.iter();
        let all = all.map(|found| (key(&found.parameter), found.number));
        Ok(all.collect())
    }

    #[test]
    fn files_and_their_mistakes() {
        let good =
            "[nordac]\n\"1202.1\" = 100\n\"1205.3\" = \"50.0 Hz\"\n\"1415.2\" = -10\n1621 = 2\n";
        let wanted = [
            ("1202.1", 100),
            ("1205.3", 500),
            ("1415.2", -10),
            ("1621", 2),
        ];
        let wanted = wanted.map(|(key, number)| (key.to_owned(), number));
        let mut found = read(good).expect("good");
        found.sort();
        assert_eq!(found, wanted);
        for (text, part) in [
            ("[nd21]\n", "1: there is no table `nd21`"),
            ("[nordac]\n", "0: the file has no parameters"),
            (
                "[nordac]\n1800 = 1\n",
                "9: parameter 1800 (New error) is not kept",
            ),
            (
                "[nordac]\n1602 = 1\n",
                "9: parameter 1602 (Factory setting) is not kept",
            ),
            (
                "[nordac]\n\"1205.9\" = 1\n",
                "9: `1205.9`: parameter 1205 has sets 1 to 4",
            ),
            (
                "[nordac]\n1202 = 1.5\n",
                "16: 1202 (Accel. time): this is no number",
            ),
            ("[nordac]\n1202 = \"5Hz\"\n", "is counted in s"),
            ("[nordac\n", "unclosed table"),
        ] {
            let problems = read(text).expect_err(text);
            assert!(problems[0].contains(part), "{text}: {problems:?}");
        }
    }
}
