//! `drivebench params`: the parameters of a drive are saved, loaded and compared.

use super::axes;
use super::params_file::{self, FileParameter, parameters};
use super::rig::{self, OpenBench};
use crate::driver::Axis;
use crate::driver::cell::{self, CellFound, find, hex};
use crate::language::argument::{MemoryKind, MemoryRange};
use harness_bench::command::drive::{LoadArguments, ParamsArguments, ParamsCommand};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::file;
use harness_bench::command::output::Output;
use harness_bench::command::params::unwritten;
use harness_bench::command::rig_name::Use;
use harness_bench::counted::counted;
use harness_bench::rig::state::utc;
use harness_bench::scenario::source::Source;
use harness_proto::nd21::cells::CellAccess;
use harness_proto::nd21::eeprom::eeprom_of;
use harness_proto::nd21::units::{Date, DriveUnits};
use harness_proto::nd21::{PARAMETERS, ee};
use std::time::SystemTime;

/// Runs one of the commands.
pub(crate) fn params(command: &ParamsCommand, output: &mut Output) -> Result<Exit, Failure> {
    match command {
        ParamsCommand::Save(arguments) => {
            let look = Use::look("params save");
            rig::on(&arguments.rig, look, output, |bench, output| {
                save(arguments, bench, output)
            })
        }
        ParamsCommand::Load(arguments) => {
            let holds = arguments.hold.hold || !arguments.yes;
            let what = Use::new("params load", arguments.yes, holds);
            compare(&arguments.params, what, output, |comparison, output| {
                load(arguments, comparison, output)
            })
        }
        ParamsCommand::Diff(arguments) => {
            let look = Use::look("params diff");
            compare(arguments, look, output, |comparison, output| {
                diff(arguments, comparison, output)
            })
        }
    }
}

fn save(
    arguments: &ParamsArguments,
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axis = axes::single(&arguments.drive, &bench.bus.axes())?;
    let units = bench.units(axis)?;
    let locations = parameters();
    let found = locations
        .iter()
        .map(|location| find(&bench.bus, (axis, units), location))
        .collect::<Result<Vec<_>, _>>()?;
    let serial = bench.bus.identity(axis)?.serial_number;
    let serial = serial.map_or("unknown".to_owned(), |number| format!("{number:06}"));
    let drive = format!("drive {axis}, serial number {serial}");
    file::write(&arguments.file, &params_file::text(&drive, &found))?;
    let path = arguments.file.display();
    output.result(&format!(
        "{drive}: {} parameters saved in {path}\n",
        found.len()
    ))?;
    Ok(Exit::Passed)
}

/// A drive and the file that it is compared with.
struct Comparison<'b> {
    bench: &'b OpenBench,
    axis: Axis,
    /// What the scales depend on now, and when the file is loaded.
    units: [DriveUnits; 2],
    entries: Vec<(FileParameter, Vec<u8>)>,
}

/// Reads the file, opens the bench, and does something with both.
fn compare(
    arguments: &ParamsArguments,
    what: Use,
    output: &mut Output,
    act: impl FnOnce(&Comparison<'_>, &mut Output) -> Result<Exit, Failure>,
) -> Result<Exit, Failure> {
    let source = Source::read(&arguments.file).map_err(|error| Failure::File(error.into()))?;
    rig::on(&arguments.rig, what, output, |bench, output| {
        act(&Comparison::new(arguments, &source, bench, output)?, output)
    })
}

impl<'b> Comparison<'b> {
    fn new(
        arguments: &ParamsArguments,
        source: &Source,
        bench: &'b OpenBench,
        output: &mut Output,
    ) -> Result<Self, Failure> {
        let axis = axes::single(&arguments.drive, &bench.bus.axes())?;
        let now = bench.units(axis)?;
        let (entries, then) = params_file::read(source, now)?;
        let all = parameters().len();
        if entries.len() < all {
            output.say(&format!(
                "note: {} has {} of {all} parameters; the others are left as they are\n",
                source.name,
                entries.len()
            ));
        }
        let entries = entries
            .into_iter()
            .map(|entry| {
                let held = cell::read(&bench.bus, axis, &entry.location)?;
                Ok((entry, held))
            })
            .collect::<Result<_, Failure>>()?;
        Ok(Self {
            bench,
            axis,
            units: [now, then],
            entries,
        })
    }

    /// What differs: the parameter, in the drive and in the file.
    fn differences(&self) -> impl Iterator<Item = (&FileParameter, [String; 2])> {
        let differing = self
            .entries
            .iter()
            .filter(|(entry, held)| entry.bytes != *held);
        differing.map(|(entry, held)| {
            let words = |bytes: &[u8], units| {
                let location = &entry.location;
                let bytes = bytes.to_vec();
                CellFound {
                    axis: self.axis,
                    location,
                    bytes,
                    units,
                }
                .text()
            };
            let [now, then] = self.units;
            (entry, [words(held, now), words(&entry.bytes, then)])
        })
    }
}

fn diff(
    arguments: &ParamsArguments,
    comparison: &Comparison<'_>,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axis = comparison.axis;
    let mut count = 0;
    for (entry, [held, wanted]) in comparison.differences() {
        let name = entry.location.name();
        output.result(&format!("{name}: drive {axis} {held}, file {wanted}\n"))?;
        count += 1;
    }
    let path = arguments.file.display();
    let all = comparison.entries.len();
    let (words, exit) = match count {
        0 => ("are equal".to_owned(), Exit::Passed),
        n => (format!("differ in {n}"), Exit::Failed),
    };
    output.result(&format!(
        "drive {axis} and {path} {words} ({all} parameters)\n"
    ))?;
    Ok(exit)
}

fn load(
    arguments: &LoadArguments,
    comparison: &Comparison<'_>,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let (bench, axis) = (comparison.bench, comparison.axis);
    let mut changes = Vec::new();
    for (entry, [held, wanted]) in comparison.differences() {
        let name = entry.location.name();
        if let Some(section) = read_only(&entry.location) {
            output.say(&format!(
                "note: {name} is read only (ND21 {section}) and stays {held}; the file has {wanted}\n"
            ));
            continue;
        }
        output.result(&format!("{name}: {held} -> {wanted}\n"))?;
        changes.push(entry);
    }
    let count = changes.len();
    if let Some(exit) = unwritten(&axes::named(&[axis]), count, arguments, output)? {
        return Ok(exit);
    }
    let mode = bench.bus.state(axis)?.mode();
    if mode == "go" {
        output.say(&format!(
            "drive {axis} is in go: its motor can turn while its parameters change\n"
        ));
    }
    for entry in &changes {
        cell::write(&bench.bus, axis, &entry.location, &entry.bytes)?;
    }
    verify(bench, axis, &changes, "the RAM", |entry| {
        Some(entry.location.clone())
    })?;
    let mut words = format!(
        "drive {axis}: {} written and read back",
        counted(count, "parameter")
    );
    if arguments.store {
        store(comparison)?;
        words.push_str(", all stored in the EEPROM");
    }
    output.result(&format!("{words}\n"))?;
    Ok(Exit::Passed)
}

/// The section that calls a cell read only.
fn read_only(location: &MemoryRange) -> Option<&'static str> {
    let cell = location
        .cell()
        .filter(|cell| cell.access == CellAccess::Read)?;
    Some(cell.section)
}

/// Reads back what was written.
fn verify(
    bench: &OpenBench,
    axis: Axis,
    entries: &[&FileParameter],
    place: &str,
    home: impl Fn(&FileParameter) -> Option<MemoryRange>,
) -> Result<(), Failure> {
    let mut wrong = Vec::new();
    for entry in entries {
        let Some(home) = home(entry) else { continue };
        let held = cell::read(&bench.bus, axis, &home)?;
        if held != entry.bytes {
            wrong.push(format!(
                "{} holds {} where {} was written",
                entry.location.name(),
                hex(&held),
                hex(&entry.bytes)
            ));
        }
    }
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Failure::drive(format!(
        "drive {axis}: in {place} {}",
        wrong.join("; ")
    )))
}

/// Stores the parameters: FF60-FF7F as a whole (ProgParam, 14.10.5.4), the others of the file byte by byte, and
/// the date of the change, as 14.8.4 wants it.
fn store(comparison: &Comparison<'_>) -> Result<(), Failure> {
    let (bench, axis) = (comparison.bench, comparison.axis);
    bench.bus.ram_to_eeprom(axis)?;
    let written = comparison.entries.iter().map(|(entry, _)| entry);
    let written: Vec<_> = written
        .filter(|entry| read_only(&entry.location).is_none())
        .collect();
    for entry in &written {
        if entry.location.address() < PARAMETERS
            && let Some(home) = home(entry)
        {
            cell::write(&bench.bus, axis, &home, &entry.bytes)?;
        }
    }
    if let Some(today) = today() {
        let address = ee::PROG_DATUM;
        for (address, byte) in (address..).zip(today.to_raw().to_be_bytes()) {
            bench.bus.write_eeprom(axis, address, byte)?;
        }
    }
    verify(bench, axis, &written, "the EEPROM", home)
}

/// Where a parameter is in the EEPROM.
fn home(entry: &FileParameter) -> Option<MemoryRange> {
    let address = eeprom_of(entry.location.address())?;
    Some(entry.location.moved(MemoryKind::Eeprom, address.into()))
}

/// The day (UTC); `None` if the clock is outside the range of the drive's date.
fn today() -> Option<Date> {
    let now = utc(SystemTime::now());
    let [year, month, day] = [now.get(..4)?, now.get(5..7)?, now.get(8..10)?];
    Date::new(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?)
}
