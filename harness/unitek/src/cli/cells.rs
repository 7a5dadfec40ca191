//! `drivebench cells --bus unitek`: the registers of the drive.

use harness_bench::command::args::CellsArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::output::Output;
use harness_proto::unitek::units::usual;
use harness_proto::unitek::{ALIASES, REGISTERS, Register};

pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    REGISTERS.iter().map(|register| register.name)
}

/// Shows the registers that have the filter in their name, number or meaning.
pub(crate) fn cells(arguments: &CellsArguments, output: &mut Output) -> std::io::Result<Exit> {
    let kept = "a UNITEK drive keeps its RW registers in its EEPROM";
    let lines = REGISTERS.iter().map(line);
    arguments.show(lines, ("register", Some(kept)), output)
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
    format!(
        "{:02X} {} {:>2}{sign} {:16} {unit:5} {:10} {} {}{aliases}",
        register.number,
        register.access,
        register.width.bits(),
        register.name,
        register.origin,
        register.label,
        register.meaning
    )
}
