//! A file of parameters: the manual's names with their values, in TOML.
//!
//! ```toml
//! [nd21]
//! nMax      = "2999.9 rpm"  # FF68 14.5.3.2  maximum speed
//! "nRampe+" = "off"         # FF6C 14.5.4    acceleration ramp
//! ```

use crate::driver::cell::{CellFound, hex};
use crate::language::argument::{MemoryKind, MemoryRange, value_at};
use crate::language::syntax::Written;
use harness_bench::command::params::{checked, entries, place};
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_proto::nd21::cells::{Cell, CellAccess, RAM};
use harness_proto::nd21::eeprom::LINKS;
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange};
use std::ops::Range;
use toml::de::DeValue;

/// The table with the parameters.
const TABLE: &str = "nd21";

/// The parameters FF60-FF7F, and the cells that are loaded from the EEPROM at reset (14.2.2, 13.1.4, 14.6.6).
pub(crate) fn parameters() -> Vec<MemoryRange> {
    let cells = LINKS.iter().flat_map(|link| {
        let linked = link.ram..link.ram + u16::from(link.size);
        RAM.iter().filter(move |cell| {
            linked.contains(&cell.address) && cell.access != CellAccess::Reserved
        })
    });
    cells
        .map(|cell: &'static Cell| MemoryRange::of(MemoryKind::Ram, cell))
        .collect()
}

/// A value as it stands in a file: a number with its unit where that gives back the same bytes.
pub(crate) fn value(found: &CellFound<'_>) -> String {
    // `180 V per 1000 rpm` is written `180 V`.
    let shown = found.value();
    let text = shown.split(" per ").next().unwrap_or_default();
    let written = value_at(text, 0, found.location);
    let same = written.and_then(|written| found.location.bytes(&written, found.units));
    if same.is_ok_and(|bytes| bytes == found.bytes) {
        text.to_owned()
    } else if value_at(&hex(&found.bytes), 0, found.location).is_ok() {
        hex(&found.bytes)
    } else {
        format!("0x{}", hex(&found.bytes))
    }
}

/// The text of a file with what was found in a drive.
pub(crate) fn text(drive: &str, found: &[CellFound<'_>]) -> String {
    let key = |name: &str| {
        let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.chars().all(bare) {
            name.to_owned()
        } else {
            format!("\"{name}\"")
        }
    };
    let mut text = format!(
        "# Parameters of an ND21: {drive}.\n\
         # A number stands with its unit; other values are bytes, hexadecimal, the first at the lower address;\n\
         # \"off\" is a limit that is switched off. Behind: address, section of the manual, meaning.\n\n[{TABLE}]\n"
    );
    for found in found {
        let name = found.location.name();
        let value = format!("\"{}\"", value(found));
        let cell = found.location.cell();
        let section = cell.map_or("", |cell| cell.section);
        let meaning = cell.map_or("", |cell| cell.english);
        let fixed = match cell.map(|cell| cell.access) {
            Some(CellAccess::Read) => " (read only)",
            _ => "",
        };
        text.push_str(&format!(
            "{:16} = {value:16} # {:04X} {section:8} {meaning}{fixed}\n",
            key(&name),
            found.location.address()
        ));
    }
    text
}

/// A parameter as a file has it.
pub(crate) struct FileParameter {
    pub(crate) location: MemoryRange,
    pub(crate) bytes: Vec<u8>,
}

/// The parameters of a file for a drive, and what their scales depend on when they are loaded; in the order of
/// [`parameters`].
pub(crate) fn read(
    source: &Source,
    drive: DriveUnits,
) -> Result<(Vec<FileParameter>, DriveUnits), Problems> {
    let known = parameters();
    let names: Vec<_> = known
        .iter()
        .filter_map(|location| location.cell())
        .map(|cell| cell.printed)
        .collect();
    let no_table = |key: &str| format!("`{key}` is no table");
    let (mut written, mut problems) = entries(source, TABLE, no_table, |key, value| {
        let (span, name) = (place(key.span()), key.get_ref());
        let Some(at) = names.iter().position(|known| known == name) else {
            let message = format!("`{name}` is not a parameter");
            let expected = "a name of FF60-FF7F or of a cell with a home in the EEPROM (ND21 14.2)";
            return Err(Problem::new(span, message, expected).did_you_mean(name, &names));
        };
        let value = entry(&source.text, value.span(), value.get_ref(), &known[at])?;
        Ok((at, (known[at].clone(), value, span)))
    });
    written.sort_by_key(|(at, _)| *at);
    let written: Vec<_> = written
        .into_iter()
        .map(|(_, parameter)| parameter)
        .collect();
    let units = units(&written, drive);
    let mut read = Vec::new();
    for (location, value, span) in written {
        match location.bytes(&value, units) {
            Ok(bytes) if bytes.len() == usize::from(location.size) => {
                read.push(FileParameter { location, bytes });
            }
            Ok(_) => problems.push(Problem::new(
                span,
                "too few bytes",
                "all of them expected here",
            )),
            Err(problem) => problems.push(problem),
        }
    }
    checked(source, (read, units), problems)
}

/// With the range of speeds that the file itself sets (14.3.2).
fn units(written: &[(MemoryRange, Written, TextSpan)], drive: DriveUnits) -> DriveUnits {
    let version = written
        .iter()
        .find(|(location, ..)| location.address() == ram::SW_VERSION2)
        .and_then(|(location, value, _)| location.bytes(value, drive).ok());
    match version.as_deref() {
        Some([byte]) => DriveUnits {
            range: SpeedRange::from_sw_version2(*byte),
            ..drive
        },
        _ => drive,
    }
}

fn entry(
    text: &str,
    range: Range<usize>,
    value: &DeValue<'_>,
    location: &MemoryRange,
) -> Result<Written, Problem> {
    let whole = place(range.clone());
    let DeValue::String(value) = value else {
        let message = format!("a value of `{}` is a text", location.name());
        let expected = "quotes expected around it, as in \"1500 rpm\" or \"06\"";
        return Err(Problem::new(whole, message, expected));
    };
    // Between simple quotes the text is as it stands in the file.
    let inner = text.get(range.start + 1..range.end.saturating_sub(1));
    if inner == Some(value.as_ref()) {
        return value_at(value, range.start + 1, location);
    }
    value_at(value, 0, location).map_err(|problem| Problem {
        span: whole,
        ..problem
    })
}
