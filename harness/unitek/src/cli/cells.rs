//! `drivebench cells --bus unitek`: the registers of the drive.

use harness_bench::command::args::CellsArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::output::Output;
use harness_proto::unitek::units::usual;
use harness_proto::unitek::{ALIASES, REGISTERS, Register};

/// The names of all registers.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    REGISTERS.iter().map(|register| register.name)
}

/// Shows the registers that have the filter in their name, number or meaning.
pub(crate) fn cells(arguments: &CellsArguments, output: &mut Output) -> std::io::Result<Exit> {
    if arguments.eeprom {
        output.complain(
            "--eeprom is for the bus novobus; a UNITEK drive keeps its RW registers in its EEPROM",
        );
        return Ok(Exit::Usage);
    }
    let filter = arguments.filter.as_deref().unwrap_or_default();
    let filter = filter.to_lowercase();
    let lines = REGISTERS.iter().map(line);
    let wanted: String = lines
        .filter(|line| line.to_lowercase().contains(&filter))
        .collect();
    if wanted.is_empty() {
        output.complain(
            "no register has this text in it; `drivebench cells --bus unitek` shows all of them",
        );
        return Ok(Exit::NothingSelected);
    }
    output.result(&output.fitted(&wanted))?;
    Ok(Exit::Passed)
}

/// Number, access, bits and sign, name, unit, origin, label, meaning and other spellings.
fn line(register: &Register) -> String {
    let unit = usual(register.unit).map_or("", |unit| unit.name());
    let sign = if register.signed { "s" } else { "u" };
    let aliases = ALIASES
        .iter()
        .filter(|(_, number)| *number == register.number);
    let aliases: Vec<_> = aliases.map(|(alias, _)| *alias).collect();
    let aliases = match aliases.is_empty() {
        true => String::new(),
        false => format!(" (also {})", aliases.join(", ")),
    };
    let line = format!(
        "{:02X} {} {:>2}{sign} {:16} {unit:5} {:10} {} {}{aliases}",
        register.number,
        register.access,
        register.width.bits(),
        register.name,
        register.origin,
        register.label,
        register.meaning
    );
    format!("{}\n", line.trim_end())
}
