//! `drivebench cells`: the drive's memory, cell by cell (ND21 14.2.1, 14.2.2).

use harness_bench::command::args::CellsArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::output::Output;
use harness_proto::nd21::cells::{Cell, CellAccess, RAM};
use harness_proto::nd21::eeprom::EEPROM;

/// The printed names of the cells that can be read, first those of the RAM.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    let all = RAM.iter().chain(EEPROM);
    let used = all.filter(|cell| cell.access != CellAccess::Reserved);
    used.map(|cell| cell.printed)
}

/// Shows the cells.
pub(crate) fn cells(arguments: &CellsArguments, output: &mut Output) -> std::io::Result<Exit> {
    let (table, digits) = if arguments.eeprom {
        (EEPROM, 2)
    } else {
        (RAM, 4)
    };
    let lines = table.iter().map(|cell| line(cell, digits));
    arguments.show(lines, ("cell", None), output)
}

/// Address, size, access, name, unit, section, meaning; `R` and the mask of the bits that are read only.
fn line(cell: &Cell, digits: usize) -> String {
    let access = match (cell.access, cell.read_only_bits) {
        (CellAccess::Reserved, _) => "reserved".to_owned(),
        (CellAccess::Read, _) => "read".to_owned(),
        (CellAccess::Write, 0) => "write".to_owned(),
        (CellAccess::Write, mask) => format!("write R{mask:02X}"),
    };
    let unit = cell.scale.map_or("", |scale| scale.unit());
    format!(
        "{:0digits$X} {:>3} {access:9} {:16} {unit:17} {:9} {}",
        cell.address, cell.size, cell.printed, cell.section, cell.english
    )
}
