//! Cells and values that stand outside a scenario, on a command line or in a file of parameters:
//! in the same words.

use super::plan::{in_memory, number_bytes};
use crate::language::parse::value::{bytes, eeprom_place, place, value};
use crate::language::scale::dimension_of;
use crate::language::syntax::{CellPlace, Written};
use harness_bench::scenario::expression::{self, Scope};
use harness_bench::scenario::parse::words::equals;
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::quantity::{self, Dimension};
use harness_bench::scenario::scanner::Scanner;
use harness_proto::nd21::cells::{Cell, CellAccess};
use harness_proto::nd21::units::{self, Scale};

/// Maximum number of bytes read from an address on.
const MAX_LENGTH: i64 = 256;

/// Which of a drive's memories.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MemoryKind {
    /// RAM, ROM and registers, by their addresses (ND21 10.1).
    Ram,
    /// The EEPROM, behind its controller (ND21 14.10.5).
    Eeprom,
}

/// A cell, or a number of bytes from an address on.
#[derive(Clone, Debug)]
pub(crate) struct MemoryRange {
    pub memory: MemoryKind,
    /// How many bytes.
    pub size: u16,
    /// The scale of the number that these bytes are, if the manual gives one.
    pub scale: Option<Scale>,
    place: CellPlace,
}

impl MemoryRange {
    /// All of a cell of the tables.
    #[must_use]
    pub(crate) fn of(memory: MemoryKind, cell: &'static Cell) -> Self {
        Self {
            memory,
            size: cell.size,
            scale: cell.scale,
            place: CellPlace {
                name: cell.printed.to_owned(),
                address: cell.address,
                offset: None,
                cell: Some(cell),
                named: true,
                span: TextSpan::default(),
            },
        }
    }

    /// The same number of bytes at another place.
    #[must_use]
    pub(crate) fn moved(&self, memory: MemoryKind, address: u16) -> Self {
        let mut moved = self.clone();
        moved.memory = memory;
        moved.place.address = address;
        moved
    }

    /// The name or the address as written; what is reached through the EEPROM has `EE_` or `ee:` in front.
    #[must_use]
    pub(crate) fn name(&self) -> String {
        let name = &self.place.name;
        if self.memory == MemoryKind::Ram || name.starts_with("EE_") {
            name.clone()
        } else {
            format!("ee:{name}")
        }
    }

    /// The address of the first byte.
    #[must_use]
    pub(crate) fn address(&self) -> u16 {
        self.place.address
    }

    /// The cell that begins there, if one does.
    #[must_use]
    pub(crate) fn cell(&self) -> Option<&'static Cell> {
        self.place.cell
    }

    /// Refuses what a master cannot write: outside the memory (ND21 10.2), or called read only (14.2).
    fn writable(&self) -> Result<(), Problem> {
        let name = self.name();
        let span = self.place.span;
        if let Some(cell) = self.cell().filter(|cell| cell.access == CellAccess::Read) {
            let message = format!("`{name}` is read only (ND21 {})", cell.section);
            return Err(Problem::new(
                span,
                message,
                "a cell that can be written expected here",
            ));
        }
        let last = u32::from(self.address()) + u32::from(self.size) - 1;
        let ram = harness_proto::novobus::memory::RAM;
        let inside = u32::from(*ram.start())..=u32::from(*ram.end());
        if self.memory == MemoryKind::Ram
            && !(inside.contains(&self.address().into()) && inside.contains(&last))
        {
            let message = format!("`{name}` cannot be written: it is outside the RAM");
            return Err(Problem::new(
                span,
                message,
                "FD80 to FF7F expected here (ND21 10.2)",
            ));
        }
        Ok(())
    }

    /// The bytes of a value of drives with these scales.
    ///
    /// # Errors
    /// The cell cannot hold the value.
    pub(crate) fn bytes(
        &self,
        value: &Written,
        units: units::DriveUnits,
    ) -> Result<Vec<u8>, Problem> {
        let Written::Bytes(pattern) = value else {
            return number_bytes(self.scale, value, units);
        };
        let bytes = pattern.expand_known(Scope::default(), usize::from(self.size) + 1)?;
        // The word of the whole turns can be written without the angle behind it.
        let cell = self.cell().map_or(0, |cell| usize::from(cell.size));
        if bytes.len() == usize::from(self.size) || bytes.len() == cell {
            return Ok(bytes);
        }
        let s = |n: usize| if n == 1 { "" } else { "s" };
        Err(Problem::new(
            pattern.span,
            format!(
                "{} byte{} where `{}` has {}",
                bytes.len(),
                s(bytes.len()),
                self.name(),
                self.size
            ),
            format!("{} byte{} expected here", self.size, s(self.size.into())),
        ))
    }
}

/// Cells as written: `nist`, `EE_pole`, `FF0C`, `FF0C:2`, `ee:47`, `ee:nMax`.
///
/// # Errors
/// All that are no cells.
pub(crate) fn cells(texts: &[String]) -> Result<Vec<MemoryRange>, Problems> {
    each(texts, location)
}

/// Cells with the values that they are to get: `nsoll=1500rpm`, `nsoll=0x161E`, `Status=80`. A cell with a unit takes a number with a
/// unit, or bytes that are marked as such; any other cell takes hexadecimal bytes.
///
/// # Errors
/// All that are none, or that cannot be written.
pub(crate) fn assignments(texts: &[String]) -> Result<Vec<(MemoryRange, Written)>, Problems> {
    each(texts, |scanner| {
        let text = scanner.rest();
        let location = location(scanner)?;
        let name = text.strip_suffix(scanner.rest()).unwrap_or_default();
        location.writable()?;
        equals(scanner)?;
        let value = own_value(scanner, location.place.scale(), &location, name)?;
        Ok((location, value))
    })
}

/// The value of a cell outside a scenario, where `1500` could be meant as a number and would be read as bytes.
fn own_value(
    scanner: &mut Scanner<'_>,
    scale: Option<Scale>,
    location: &MemoryRange,
    name: &str,
) -> Result<Written, Problem> {
    let start = scanner.here();
    if scanner.eat("0x") {
        return bytes(scanner).map(Written::Bytes);
    }
    let digits = scanner.clone().chunk().value.to_owned();
    let bare = !digits.is_empty()
        && digits.bytes().all(|digit| digit.is_ascii_hexdigit())
        && !quantity::ahead(scanner)
        && quantity::ambiguous(scanner).is_none();
    let cell = location.cell().and_then(|cell| cell.number());
    let unit = location.scale.or(cell).and_then(dimension_of);
    let Some(unit) = unit.filter(|_| bare).map(Dimension::unit) else {
        return value(scanner, scale, &location.place);
    };
    let number = match digits.bytes().all(|digit| digit.is_ascii_digit()) {
        true => format!("{digits}{unit}"),
        false => format!("100{unit}"),
    };
    scanner.chunk();
    let problem = Problem::new(
        scanner.since(start),
        format!("`{digits}` has no unit, and `{name}` has one"),
        "a number with its unit, or bytes behind 0x, expected here",
    );
    Err(problem.help(format!(
        "write `{name}={number}` for a number with its unit, `{name}=0x{digits}` for the bytes"
    )))
}

/// The bytes of all these values.
///
/// # Errors
/// All that their cells cannot hold.
pub(crate) fn encode(
    texts: &[String],
    assignments: &[(MemoryRange, Written)],
    units: units::DriveUnits,
) -> Result<Vec<Vec<u8>>, Problems> {
    let found = assignments
        .iter()
        .map(|(location, value)| location.bytes(value, units));
    gather(texts, found)
}

/// The value of a cell as it stands in a file, at `offset` of it.
///
/// # Errors
/// It is none.
pub(crate) fn value_at(
    text: &str,
    offset: usize,
    location: &MemoryRange,
) -> Result<Written, Problem> {
    let mut scanner = Scanner::new(text, offset);
    let value = own_value(&mut scanner, location.scale, location, &location.name())?;
    scanner.expect_end()?;
    Ok(value)
}

fn location(scanner: &mut Scanner<'_>) -> Result<MemoryRange, Problem> {
    let start = scanner.here();
    let prefixed = scanner.eat("ee:");
    let (memory, place) = if prefixed || scanner.rest().starts_with("EE_") {
        (MemoryKind::Eeprom, eeprom_place(scanner)?)
    } else {
        (MemoryKind::Ram, place(scanner)?)
    };
    let of_cell = place.cell.and_then(|cell| cell.scale);
    let mut scales = [place.scale(), of_cell].into_iter().flatten();
    let size = if scanner.eat(":") {
        let here = scanner.here();
        let length = expression::plain(scanner)?;
        let fits = u16::try_from(length).ok();
        fits.filter(|_| (1..=MAX_LENGTH).contains(&length))
            .ok_or_else(|| {
                let message = format!("{length} bytes cannot be read at once");
                let expected = format!("1 to {MAX_LENGTH} expected here");
                Problem::new(scanner.since(here), message, expected)
            })?
    } else {
        match (place.named, place.scale(), place.cell) {
            (false, ..) | (true, None, None) => 1,
            (true, Some(scale), _) => scale.size(),
            (true, None, Some(cell)) => cell.size,
        }
    };
    let place = CellPlace {
        span: scanner.since(start),
        ..place
    };
    match memory {
        MemoryKind::Ram => in_memory(&place, usize::from(size))?,
        MemoryKind::Eeprom if place.address + size > 0x100 => {
            return Err(Problem::new(
                place.span,
                "the bytes go beyond the EEPROM",
                "the EEPROM has the addresses 00 to FF (ND21 14.2.2)",
            ));
        }
        MemoryKind::Eeprom => {}
    }
    Ok(MemoryRange {
        memory,
        size,
        scale: scales.find(|scale| scale.size() == size),
        place,
    })
}

/// Reads each of several texts as a whole.
fn each<T>(
    texts: &[String],
    read: impl Fn(&mut Scanner<'_>) -> Result<T, Problem>,
) -> Result<Vec<T>, Problems> {
    let mut offset = 0;
    let found = texts.iter().map(|text| {
        let mut scanner = Scanner::new(text, offset);
        offset += text.len() + 1;
        let found = read(&mut scanner)?;
        scanner.expect_end()?;
        Ok(found)
    });
    gather(texts, found)
}

/// All that was found, or everything that is wrong; each text is shown as a line.
fn gather<T>(
    texts: &[String],
    found: impl Iterator<Item = Result<T, Problem>>,
) -> Result<Vec<T>, Problems> {
    let mut all = Vec::new();
    let mut problems = Vec::new();
    for found in found {
        match found {
            Ok(found) => all.push(found),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() {
        return Ok(all);
    }
    let text = texts.join("\n").into();
    Err(Problems::new("command line", text, problems))
}
