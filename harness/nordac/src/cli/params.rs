//! `drivebench params` on NORDAC inverters: the parameters that can be written, of every set, in a file and back.
//!
//! ```toml
//! [nordac]
//! "1202.1" = 100    # Accel. time  5.00 s
//! ```

use super::bench::driver;
use super::read::{Found, find};
use super::write::refuse_denied;
use crate::driver::{Driver, Error};
use crate::rig::Inverters;
use crate::value::{Assignment, Cell, every, parameter, shown};
use harness_bench::command::drive::{LoadArguments, ParamsArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::file;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, single};
use harness_bench::command::rig_name::Use;
use harness_bench::counted::counted;
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::{Parameter, PkwError};
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// The table with the parameters.
const TABLE: &str = "nordac";

/// What does something and keeps nothing (970, 971, 1602), and the password: not in a file.
const NOT_KEPT: [u16; 5] = [970, 971, 1602, 1603, 1604];

/// Bus mode, interface, PPO type, rate and address: two inverters with those of one file could not be told apart, and would change who controls
/// them.
const REACHED: [u16; 6] = [1619, 1620, 1621, 1622, 1623, 1624];

/// Whether a file keeps a parameter.
fn is_kept(own: &Parameter) -> bool {
    !own.has(Flag::ReadOnly) && !NOT_KEPT.contains(&own.number)
}

/// Writes the parameters of a slave into a file.
pub(super) fn save(
    bench: PortBench<'_, Inverters>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let as_what = Use::look("params save");
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let slave = single(&arguments.drive, session)?;
        let found = parameters(&mut driver(session), slave)?;
        file::write(&arguments.file, &text(slave, &found))?;
        let path = arguments.file.display();
        let count = counted(found.len(), "parameter");
        output.say(&format!("{count} of slave {slave} in {path}\n"));
        Ok(Exit::Passed)
    })
}

/// Compares a slave with a file.
pub(super) fn diff(
    bench: PortBench<'_, Inverters>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let wanted = read_file(&arguments.file)?;
    let as_what = Use::look("params diff");
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let slave = single(&arguments.drive, session)?;
        let mut driver = driver(session);
        driver.join(slave)?;
        let differing = differing(&mut driver, slave, &wanted)?;
        output.result(&page(&differing))?;
        Ok(match differing.is_empty() {
            true => Exit::Passed,
            false => Exit::Failed,
        })
    })
}

/// Writes the parameters of a file that differ into a slave.
pub(super) fn load(
    bench: PortBench<'_, Inverters>,
    arguments: &LoadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let own = &arguments.params;
    let wanted = read_file(&own.file)?;
    if arguments.store {
        return Err(Failure::refused(
            "--store is for drives that lose what is written; this one stores every parameter at once (971)",
        ));
    }
    let as_what = Use {
        purpose: "params load",
        moves: arguments.yes,
        holds: arguments.hold.hold || !arguments.yes,
    };
    on(bench, &own.rig, as_what, output, |session, output| {
        let slave = single(&own.drive, session)?;
        let mut driver = driver(session);
        driver.join(slave)?;
        let differing = differing(&mut driver, slave, &wanted)?;
        output.result(&page(&differing))?;
        if !arguments.yes {
            output.say("nothing was written; --yes writes it\n");
            return Ok(Exit::Passed);
        }
        let loaded =
            |own: &&(Assignment, i64)| !REACHED.contains(&own.0.parameter.parameter.number);
        let orders: Vec<_> = differing.iter().filter(loaded).map(|own| own.0).collect();
        refuse_denied(&driver, slave, &orders)?;
        write_all(&mut driver, slave, &orders)?;
        let kept = differing.len() - orders.len();
        if kept > 0 {
            output.complain(&format!(
                "{kept} of them say how the inverter is reached and who controls it, and are never loaded (1619 to 1624)"
            ));
        }
        let count = counted(orders.len(), "parameter");
        output.say(&format!(
            "{count} written, and the inverter answered with the values\n"
        ));
        Ok(match kept {
            0 => Exit::Passed,
            _ => Exit::Failed,
        })
    })
}

/// Writes parameters. One whose limit is another of them, such as 1204 and 1205, is written behind it.
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

/// The parameters that a file keeps, read.
fn parameters(driver: &mut Driver<'_>, slave: u8) -> Result<Vec<Found>, Failure> {
    driver.join(slave)?;
    let all: Vec<_> = every(is_kept).map(Cell::Parameter).collect();
    Ok(find(driver, slave, &all)?)
}

fn text(slave: u8, found: &[Found]) -> String {
    let mut text = format!(
        "# Parameters of NORDAC slave {slave}, as the numbers that travel: number and, where it depends on them, element and set.\n\
         # Behind: name and value.\n\n[{TABLE}]\n"
    );
    for found in found {
        let Cell::Parameter(own) = found.cell else {
            continue;
        };
        let key = format!("\"{}\"", key(&own));
        let line = format!(
            "{key:11} = {:6} # {:22} {}",
            found.number,
            own.parameter.name,
            found.words()
        );
        text.push_str(&format!("{}\n", line.trim_end()));
    }
    text
}

/// The key of a parameter: with its set even where that is the first one.
fn key(own: &harness_proto::nordac::ParameterRef) -> String {
    let set = own.index.set + 1;
    let number = own.parameter.number;
    match (own.parameter.is_array(), own.parameter.has(Flag::Set)) {
        (true, true) => format!("{number}.{}.{set}", own.index.element),
        (false, true) => format!("{number}.{set}"),
        _ => own.to_string(),
    }
}

/// The parameters that read differently from a file, and what they read.
fn differing(
    driver: &mut Driver<'_>,
    slave: u8,
    wanted: &[Assignment],
) -> Result<Vec<(Assignment, i64)>, Error> {
    let mut differing = Vec::new();
    for own in wanted {
        let reads = driver.read(slave, &own.parameter)?;
        if reads != own.number {
            differing.push((*own, reads));
        }
    }
    Ok(differing)
}

fn page(differing: &[(Assignment, i64)]) -> String {
    let line = |(wanted, reads): &(Assignment, i64)| {
        format!(
            "{:9} {:22} file {}  slave {}\n",
            key(&wanted.parameter),
            wanted.parameter.parameter.name,
            shown(&wanted.parameter, wanted.number),
            shown(&wanted.parameter, *reads)
        )
    };
    differing.iter().map(line).collect()
}

fn read_file(path: &Path) -> Result<Vec<Assignment>, Failure> {
    let source = Source::read(path).map_err(|error| Failure::File(error.into()))?;
    Ok(parse(&source)?)
}

/// The parameters of a file.
fn parse(source: &Source) -> Result<Vec<Assignment>, Problems> {
    let problem = |range: std::ops::Range<usize>, message: String, expected: &str| {
        let span = TextSpan {
            start: range.start,
            end: range.end,
        };
        Problem::new(span, message, expected)
    };
    let (mut problems, mut found) = (Vec::new(), Vec::new());
    let table = match DeTable::parse(&source.text) {
        Ok(table) => Some(table),
        Err(error) => {
            let range = error.span().unwrap_or(0..0);
            let message = error.message().to_owned();
            problems.push(problem(range, message, "TOML expected here"));
            None
        }
    };
    for (name, value) in table.iter().flat_map(|table| table.get_ref().iter()) {
        match value.get_ref() {
            DeValue::Table(entries) if name.get_ref() == TABLE => {
                for (key, value) in entries {
                    match entry(key.get_ref(), value.get_ref()) {
                        Ok(entry) => found.push(entry),
                        Err((true, message)) => {
                            let expected = "a parameter that can be written expected here";
                            problems.push(problem(key.span(), message, expected));
                        }
                        Err((false, message)) => {
                            let expected =
                                "a whole number, or a value with its unit in quotes, expected here";
                            problems.push(problem(value.span(), message, expected));
                        }
                    }
                }
            }
            _ => {
                let message = format!("there is no table `{}`", name.get_ref());
                problems.push(problem(name.span(), message, "a table [nordac] expected"));
            }
        }
    }
    if problems.is_empty() && found.is_empty() {
        let message = "the file has no parameters".to_owned();
        problems.push(problem(0..0, message, "a table [nordac] expected"));
    }
    if problems.is_empty() {
        return Ok(found);
    }
    problems.sort_by_key(|problem| problem.span.start);
    Err(Problems::new(&source.name, source.text.clone(), problems))
}

/// A line of a file. The error says whether the key is wrong, and why.
fn entry(key: &str, value: &DeValue<'_>) -> Result<Assignment, (bool, String)> {
    let found = parameter(key).map_err(|why| (true, why))?;
    let own = found.parameter;
    if !is_kept(own) {
        let why = format!("parameter {found} ({}) is not kept in a file", own.name);
        return Err((true, why));
    }
    let wrong = |why: &dyn std::fmt::Display| (false, format!("{key} ({}): {why}", own.name));
    let text = match value {
        DeValue::Integer(number) => number.to_string(),
        DeValue::String(text) => text.to_string(),
        _ => return Err(wrong(&"this is no number")),
    };
    let number = own
        .parse(found.index.element, &text)
        .map_err(|error| wrong(&error))?;
    match own.raw_of(number) {
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

    fn read(text: &str) -> Result<Vec<(String, i64)>, Vec<String>> {
        let source = Source::from_bytes("p.toml".to_owned(), text.into()).expect("a text");
        let found = parse(&source).map_err(|problems| {
            let all = problems.all().iter();
            all.map(|problem| format!("{}: {}", problem.span.start, problem.message))
                .collect::<Vec<_>>()
        })?;
        let all = found.iter().map(|own| (key(&own.parameter), own.number));
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
