//! `drivebench params`: the parameters of a drive in a file and back.

use super::drive::{LoadArguments, ParamsArguments, ParamsCommand};
use super::drives::CommandDrives;
use super::exit::Exit;
use super::failure::Failure;
use super::file;
use super::held::HeldDrives;
use super::output::Output;
use super::port_bench::{PortBench, on, single};
use super::rig_name::Use;
use crate::counted::counted;
use crate::rig::session::RigSession;
use crate::scenario::problem::{Problem, Problems, TextSpan};
use crate::scenario::source::Source;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// What is wrong with a line of a file.
pub enum EntryMistake {
    Key(String),
    Value(String),
}

/// Reads all parameters of a drive and returns the lines of a file.
type Lines<D> = fn(&mut RigSession<D>, <D as HeldDrives>::Drive) -> Result<Vec<String>, Failure>;

/// Reads parameters of a drive and returns those that differ, each with a line that shows both values.
type Compare<D, P> =
    fn(&mut RigSession<D>, <D as HeldDrives>::Drive, &[P]) -> Result<Vec<(P, String)>, Failure>;

/// Writes parameters into a drive, and stores them if the last argument says so. If one of them is denied, nothing is written.
type Write<D, P> =
    fn(&mut RigSession<D>, <D as HeldDrives>::Drive, &[P], bool) -> Result<(), Failure>;

/// The parameters of the drives of a bus: how they stand in a file, and what is done with them.
pub struct ParameterFile<D: HeldDrives, P> {
    /// The table of the file.
    pub table: &'static str,
    /// How the first line of a file ends: what its keys and values are.
    pub about: &'static str,
    /// What is expected as a key, and as a value.
    pub expected: [&'static str; 2],
    /// A line of a file.
    pub entry: fn(&str, &DeValue<'_>) -> Result<P, EntryMistake>,
    /// The message for a key of the file that has no table below it.
    pub no_table: fn(&str) -> String,
    pub read: Lines<D>,
    pub compare: Compare<D, P>,
    /// Whether a parameter is ever loaded; `never_loaded` says why the others are not.
    pub is_loaded: fn(&P) -> bool,
    pub never_loaded: &'static str,
    pub write: Write<D, P>,
    /// The end of the message about what was written.
    pub written: &'static str,
    /// Why `--store` is refused.
    pub stores_nothing: Option<&'static str>,
}

/// Runs `params`.
///
/// # Errors
/// [`Failure`].
pub(super) fn params<D: CommandDrives>(
    bench: PortBench<'_, D>,
    command: &ParamsCommand,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match command {
        ParamsCommand::Save(arguments) => save(bench, arguments, output),
        ParamsCommand::Diff(arguments) => diff(bench, arguments, output),
        ParamsCommand::Load(arguments) => load(bench, arguments, output),
    }
}

fn save<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let look = Use::look("params save");
    on(bench, &arguments.rig, look, output, |session, output| {
        let drive = single(&arguments.drive, session)?;
        let lines = (D::PARAMETERS.read)(session, drive)?;
        let named = D::named(&[drive]);
        let ParameterFile { table, about, .. } = D::PARAMETERS;
        let mut text = format!(
            "# Parameters of {} {named}{about}.\n# Behind: name and value.\n\n[{table}]\n",
            table.to_uppercase()
        );
        for line in &lines {
            text.push_str(&format!("{}\n", line.trim_end()));
        }
        file::write(&arguments.file, &text)?;
        let path = arguments.file.display();
        let count = counted(lines.len(), "parameter");
        output.say(&format!("{count} of {named} in {path}\n"));
        Ok(Exit::Passed)
    })
}

fn diff<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &ParamsArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let wanted = read_file::<D>(arguments)?;
    let look = Use::look("params diff");
    on(bench, &arguments.rig, look, output, |session, output| {
        let drive = single(&arguments.drive, session)?;
        Ok(match differing::<D>(session, drive, &wanted, output)?[..] {
            [] => Exit::Passed,
            _ => Exit::Failed,
        })
    })
}

/// Writes the parameters of a file that differ into a drive.
fn load<D: CommandDrives>(
    bench: PortBench<'_, D>,
    arguments: &LoadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let LoadArguments { params, yes, .. } = arguments;
    let wanted = read_file::<D>(params)?;
    if let Some(why) = D::PARAMETERS.stores_nothing.filter(|_| arguments.store) {
        return Err(Failure::refused(why));
    }
    let as_what = Use {
        purpose: "params load",
        moves: *yes,
        holds: arguments.hold.hold || !yes,
    };
    on(bench, &params.rig, as_what, output, |session, output| {
        let drive = single(&params.drive, session)?;
        let mut orders = differing::<D>(session, drive, &wanted, output)?;
        let all = orders.len();
        if let Some(exit) = unwritten(&D::named(&[drive]), all, arguments, output)? {
            return Ok(exit);
        }
        orders.retain(D::PARAMETERS.is_loaded);
        (D::PARAMETERS.write)(session, drive, &orders, arguments.store)?;
        let kept = all - orders.len();
        if kept > 0 {
            let why = D::PARAMETERS.never_loaded;
            output.complain(&format!("{kept} of them {why}"));
        }
        let count = counted(orders.len(), "parameter");
        output.say(&format!("{count} {}\n", D::PARAMETERS.written));
        Ok(match kept {
            0 => Exit::Passed,
            _ => Exit::Failed,
        })
    })
}

/// The exit code of a load that has nothing to write; `None` where it goes on.
///
/// # Errors
/// `--yes` is missing: nothing is written.
pub fn unwritten(
    named: &str,
    count: usize,
    arguments: &LoadArguments,
    output: &mut Output,
) -> Result<Option<Exit>, Failure> {
    if count == 0 && !arguments.store {
        output.result(&format!("{named}: nothing to change\n"))?;
        return Ok(Some(Exit::Passed));
    }
    if arguments.yes {
        return Ok(None);
    }
    let store = if arguments.store {
        ", and the EEPROM"
    } else {
        ""
    };
    Err(Failure::refused(format!(
        "{named}: {} would change{store}; nothing was written, add --yes to write",
        counted(count, "parameter")
    )))
}

/// Shows the parameters that differ from those of a file, and returns them.
fn differing<D: CommandDrives>(
    session: &mut RigSession<D>,
    drive: D::Drive,
    wanted: &[D::Parameter],
    output: &mut Output,
) -> Result<Vec<D::Parameter>, Failure> {
    let differing = (D::PARAMETERS.compare)(session, drive, wanted)?;
    let (differing, lines): (Vec<_>, Vec<_>) = differing.into_iter().unzip();
    output.result(&lines.concat())?;
    Ok(differing)
}

fn read_file<D: CommandDrives>(arguments: &ParamsArguments) -> Result<Vec<D::Parameter>, Failure> {
    let source = Source::read(&arguments.file).map_err(|error| Failure::File(error.into()))?;
    Ok(D::PARAMETERS.parse(&source)?)
}

impl<D: HeldDrives, P> ParameterFile<D, P> {
    /// The parameters of a file.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn parse(&self, source: &Source) -> Result<Vec<P>, Problems> {
        let Self {
            table, expected, ..
        } = self;
        let (found, problems) = entries(source, table, self.no_table, |key, value| {
            let (span, message, expected) = match (self.entry)(key.get_ref(), value.get_ref()) {
                Ok(entry) => return Ok(entry),
                Err(EntryMistake::Key(why)) => (key.span(), why, expected[0]),
                Err(EntryMistake::Value(why)) => (value.span(), why, expected[1]),
            };
            Err(Problem::new(place(span), message, expected))
        });
        checked(source, found, problems)
    }
}

/// What was read of a file, unless it has mistakes.
///
/// # Errors
/// They, in the order of the file.
pub fn checked<T>(source: &Source, read: T, mut problems: Vec<Problem>) -> Result<T, Problems> {
    if problems.is_empty() {
        return Ok(read);
    }
    problems.sort_by_key(|problem| problem.span.start);
    Err(Problems::new(&source.name, source.text.clone(), problems))
}

/// The entries of the only table that a file has, and the mistakes of the file. `no_table` is the message for a key that has no table below it.
pub fn entries<P>(
    source: &Source,
    table: &str,
    no_table: fn(&str) -> String,
    mut entry: impl FnMut(&Spanned<DeString<'_>>, &Spanned<DeValue<'_>>) -> Result<P, Problem>,
) -> (Vec<P>, Vec<Problem>) {
    let (mut problems, mut found) = (Vec::new(), Vec::new());
    let a_table = format!("a table [{table}] expected");
    match DeTable::parse(&source.text) {
        Err(error) => {
            let span = place(error.span().unwrap_or(0..0));
            problems.push(Problem::new(span, error.message(), "TOML expected here"));
        }
        Ok(parsed) => {
            for (name, value) in parsed.get_ref() {
                let message = match value.get_ref() {
                    DeValue::Table(entries) if name.get_ref() == table => {
                        for (key, value) in entries {
                            match entry(key, value) {
                                Ok(entry) => found.push(entry),
                                Err(problem) => problems.push(problem),
                            }
                        }
                        continue;
                    }
                    DeValue::Table(_) => format!("there is no table `{}`", name.get_ref()),
                    _ => no_table(name.get_ref()),
                };
                problems.push(Problem::new(place(name.span()), message, &a_table));
            }
        }
    }
    if problems.is_empty() && found.is_empty() {
        let span = TextSpan::default();
        problems.push(Problem::new(span, "the file has no parameters", &a_table));
    }
    (found, problems)
}

/// The place of a range of bytes.
pub const fn place(range: Range<usize>) -> TextSpan {
    TextSpan {
        start: range.start,
        end: range.end,
    }
}
