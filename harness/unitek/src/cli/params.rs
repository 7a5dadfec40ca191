//! `drivebench params` on UNITEK drives: the registers that the drive keeps in its EEPROM (RW), in a file and back.
//!
//! ```toml
//! [unitek]
//! 0x2C = "000A"     # SPEED_KP
//! 0xC8 = "0E10"     # SPEED_RPMMAX  3600 rpm
//! ```

use super::read::Found;
use super::write::{Order, refuse_denied};
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives};
use crate::value::{hex, is_parameter, register};
use harness_bench::command::axes::Axes;
use harness_bench::command::drive::{LoadArguments, ParamsArguments};
use harness_bench::command::drives::CommandDrives as _;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::file;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, single};
use harness_bench::command::rig_name::Use;
use harness_bench::counted::counted;
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_proto::unitek::guard::{Class, class};
use harness_proto::unitek::{Data, REGISTERS, Register};
use toml::de::{DeTable, DeValue};

/// Identifiers and bit rate: two drives with those of one file could not be told apart.
const REACHED: [u8; 5] = [0x68, 0x69, 0x73, 0x88, 0x89];

/// The table with the parameters.
const TABLE: &str = "unitek";

/// The register that stores all parameters, and the level that is loaded at power-up (ex 7).
const STORE: (u8, u16) = (0x84, 0);

/// Writes the parameters of a drive into a file.
pub(super) fn save(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    on(
        bench,
        &arguments.rig,
        Use::look("params save"),
        output,
        |session, output| {
            let (axis, found) = parameters(session, &arguments.drive)?;
            file::write(&arguments.file, &text(axis, &found))?;
            let path = arguments.file.display();
            output.say(&format!(
                "{} of drive {} in {path}\n",
                counted(found.len(), "parameter"),
                axis.node
            ));
            Ok(Exit::Passed)
        },
    )
}

/// Compares a drive with a file.
pub(super) fn diff(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let wanted = read_file(&arguments.file)?;
    on(
        bench,
        &arguments.rig,
        Use::look("params diff"),
        output,
        |session, output| {
            let (_, found) = parameters(session, &arguments.drive)?;
            let differing = differing(&wanted, &found);
            output.result(&page(&differing))?;
            Ok(match differing.is_empty() {
                true => Exit::Passed,
                false => Exit::Failed,
            })
        },
    )
}

/// Writes the parameters of a file that differ into a drive.
pub(super) fn load(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &LoadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let wanted = read_file(&arguments.params.file)?;
    let as_what = Use {
        purpose: "params load",
        moves: arguments.yes,
        holds: arguments.hold.hold || !arguments.yes,
    };
    on(
        bench,
        &arguments.params.rig,
        as_what,
        output,
        |session, output| {
            let (axis, found) = parameters(session, &arguments.params.drive)?;
            let differing = differing(&wanted, &found);
            output.result(&page(&differing))?;
            if !arguments.yes {
                output.say("nothing was written; --yes writes it\n");
                return Ok(Exit::Passed);
            }
            let writable = |own: &&(&'static Register, Data, Data)| {
                class(own.0.number) != Class::Never && !REACHED.contains(&own.0.number)
            };
            let orders: Vec<Order> = differing
                .iter()
                .filter(writable)
                .map(|(register, wanted, _)| (axis, *register, *wanted))
                .collect();
            let store = arguments.store.then(|| {
                let (register, level) = STORE;
                (axis, Register::of(register), Data::Short(level))
            });
            let all: Vec<_> = orders.iter().copied().chain(store).collect();
            let mut driver = session.driver();
            refuse_denied(&mut driver, &all)?;
            for (axis, register, data) in &all {
                driver.write(*axis, register.number, *data)?;
            }
            let kept = differing.len() - orders.len();
            if kept > 0 {
                output.complain(&format!(
                    "{kept} of them identify the device, or say how it is reached, and are never loaded (5A, 62, 67, 68, 69, 73, 88, 89)"
                ));
            }
            output.say(&format!(
                "{} written and read back\n",
                counted(orders.len(), "parameter")
            ));
            Ok(match kept {
                0 => Exit::Passed,
                _ => Exit::Failed,
            })
        },
    )
}

/// The parameters of a drive, read.
fn parameters(session: &mut Session, drive: &Axes) -> Result<(Axis, Vec<Found>), Failure> {
    let axis = single(drive, session)?;
    let all: Vec<_> = REGISTERS.iter().filter(|own| is_parameter(own)).collect();
    Ok((axis, UnitekDrives::read(session, &[axis], &all)?))
}

fn text(axis: Axis, found: &[Found]) -> String {
    let mut text = format!(
        "# Parameters of UNITEK drive {}: the registers that it keeps in its EEPROM (RW), as hexadecimal digits.\n\
         # Behind: name and value.\n\n[{TABLE}]\n",
        axis.node
    );
    for found in found {
        let register = found.register();
        let value = format!("\"{}\"", hex(found.reply.data));
        let line = format!(
            "0x{:02X} = {value:10} # {:14} {}",
            register.number,
            register.name,
            found.words()
        );
        text.push_str(&format!("{}\n", line.trim_end()));
    }
    text
}

/// The registers that read differently from a file: register, value of the file, value of the drive.
fn differing(
    wanted: &[(&'static Register, Data)],
    found: &[Found],
) -> Vec<(&'static Register, Data, Data)> {
    let of = |(register, wanted): &(&'static Register, Data)| {
        let found = found
            .iter()
            .find(|own| own.reply.register == register.number)?;
        let reads = Data::of(register, found.reply.data.bits());
        (reads != *wanted).then_some((*register, *wanted, reads))
    };
    wanted.iter().filter_map(of).collect()
}

fn page(differing: &[(&'static Register, Data, Data)]) -> String {
    let line = |(register, wanted, reads): &(&'static Register, Data, Data)| {
        format!(
            "{:02X} {:14} file {}  drive {}\n",
            register.number,
            register.name,
            hex(*wanted),
            hex(*reads)
        )
    };
    differing.iter().map(line).collect()
}

fn read_file(path: &std::path::Path) -> Result<Vec<(&'static Register, Data)>, Failure> {
    let source = Source::read(path).map_err(|error| Failure::File(error.into()))?;
    Ok(parse(&source)?)
}

/// The parameters of a file.
fn parse(source: &Source) -> Result<Vec<(&'static Register, Data)>, Problems> {
    let mut problems = Vec::new();
    let mut found = Vec::new();
    let problem = |range: std::ops::Range<usize>, message: String, expected: &str| {
        let span = TextSpan {
            start: range.start,
            end: range.end,
        };
        Problem::new(span, message, expected)
    };
    match DeTable::parse(&source.text) {
        Err(error) => {
            let range = error.span().unwrap_or(0..0);
            problems.push(problem(
                range,
                error.message().to_owned(),
                "TOML expected here",
            ));
        }
        Ok(table) => {
            for (name, value) in table.get_ref() {
                let DeValue::Table(entries) = value.get_ref() else {
                    let message = format!("`{}` is no table", name.get_ref());
                    problems.push(problem(name.span(), message, "a table [unitek] expected"));
                    continue;
                };
                if name.get_ref() != TABLE {
                    let message = format!("there is no table `{}`", name.get_ref());
                    problems.push(problem(name.span(), message, "a table [unitek] expected"));
                    continue;
                }
                for (key, value) in entries {
                    match entry(key.get_ref(), value.get_ref()) {
                        Ok(entry) => found.push(entry),
                        Err((true, message)) => {
                            problems.push(problem(
                                key.span(),
                                message,
                                "a parameter (RW) expected here",
                            ));
                        }
                        Err((false, message)) => {
                            problems.push(problem(
                                value.span(),
                                message,
                                "hexadecimal digits in quotes expected here",
                            ));
                        }
                    }
                }
            }
            if problems.is_empty() && found.is_empty() {
                let message = "the file has no parameters".to_owned();
                problems.push(problem(0..0, message, "a table [unitek] expected"));
            }
        }
    }
    if problems.is_empty() {
        return Ok(found);
    }
    problems.sort_by_key(|problem| problem.span.start);
    Err(Problems::new(&source.name, source.text.clone(), problems))
}

/// A line of a file. The error says whether the key is wrong, and why.
fn entry(key: &str, value: &DeValue<'_>) -> Result<(&'static Register, Data), (bool, String)> {
    let register = register(key).map_err(|why| (true, why))?;
    if !is_parameter(register) {
        let message = format!(
            "register {:02X} ({}) is no parameter ({})",
            register.number, register.name, register.access
        );
        return Err((true, message));
    }
    let digits = register.width.bits() as usize / 4;
    let wrong = || (false, format!("{key} needs {digits} digits"));
    let text = value.as_str().ok_or_else(wrong)?;
    let plain = text.len() == digits && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let raw = u32::from_str_radix(text, 16).ok().filter(|_| plain);
    raw.map(|raw| (register, Data::of(register, raw)))
        .ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<(&'static Register, Data)>, Vec<String>> {
        let source = Source::from_bytes("p.toml".to_owned(), text.into()).expect("a text");
        parse(&source).map_err(|problems| {
            let all = problems.all().iter();
            all.map(|problem| format!("{}: {}", problem.span.start, problem.message))
                .collect()
        })
    }

    #[test]
    fn files_and_their_mistakes() {
        let good = read("[unitek]\n0x2C = \"000A\"\n0x35 = \"00010064\"\n").expect("good");
        assert_eq!(good.len(), 2);
        assert_eq!(good[1].1, Data::Long(0x0001_0064));
        for (text, part) in [
            ("[nd21]\n", "1: there is no table `nd21`"),
            ("[unitek]\n", "0: the file has no parameters"),
            (
                "[unitek]\n0x30 = \"0000\"\n",
                "9: register 30 (SPEED_ACTUAL) is no parameter (RO)",
            ),
            ("[unitek]\n0x2C = \"A\"\n", "16: 0x2C needs 4 digits"),
            ("[unitek]\n0x2C = 10\n", "16: 0x2C needs 4 digits"),
            (
                "[unitek]\nSPEED_KPP = \"000A\"\n",
                "did you mean `SPEED_KP`?",
            ),
            ("[unitek\n", "unclosed table"),
        ] {
            let problems = read(text).expect_err(text);
            assert!(problems[0].contains(part), "{text}: {problems:?}");
        }
    }
}
