//! `drivebench read` and `watch`: cells of drives, with their units and bits.

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::Axis;
use crate::driver::cell::{CellFound, find};
use crate::language::argument::{MemoryKind, MemoryRange, cells};
use harness_bench::command::axes::Axes;
use harness_bench::command::drive::{ReadArguments, WatchArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::reading::{CellReading, show};
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{HEX, WatchBench, WatchedCell, watch as show_again};
use harness_bench::counted::counted;
use harness_proto::nd21::units::DriveUnits;
use harness_proto::time::{Instant, Span};
use serde_json::{Value, json};

/// Reads cells and shows them.
pub(crate) fn read(arguments: &ReadArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    let look = Use::look("read");
    rig::on(&arguments.rig, look, output, |bench, output| {
        let read = ReadCells::of(bench, &arguments.drives, &cells)?;
        show(&read.found()?, arguments.format, output)
    })
}

/// Shows values, a line each time.
pub(crate) fn watch(arguments: &WatchArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    let look = Use::look("watch");
    show_again(arguments, output, |readings, output| {
        rig::on(&arguments.rig, look, output, |bench, output| {
            let mut read = ReadCells::of(bench, &arguments.drives, &cells)?;
            let ended = readings.show(&mut read, output);
            match bench.bus.corrected_errors() {
                0 => {}
                errors => output.say(&format!(
                    "{} on the bus corrected (ND21 11.5)\n",
                    counted(errors, "error")
                )),
            }
            ended
        })
    })
}

/// The cells of drives that a command reads.
struct ReadCells<'a> {
    bench: &'a OpenBench,
    drives: Vec<(Axis, DriveUnits)>,
    cells: &'a [MemoryRange],
}

impl<'a> ReadCells<'a> {
    fn of(bench: &'a OpenBench, wanted: &Axes, cells: &'a [MemoryRange]) -> Result<Self, Failure> {
        let axes = axes::select(std::slice::from_ref(wanted), &bench.bus.axes())?;
        let drives = axes.into_iter();
        let drives = drives.map(|axis| Ok((axis, bench.units(axis)?)));
        Ok(Self {
            bench,
            drives: drives.collect::<Result<_, Failure>>()?,
            cells,
        })
    }

    fn found(&self) -> Result<Vec<CellFound<'a>>, Failure> {
        let mut found = Vec::new();
        for drive in &self.drives {
            for cell in self.cells {
                found.push(find(&self.bench.bus, *drive, cell)?);
            }
        }
        Ok(found)
    }
}

impl WatchBench for ReadCells<'_> {
    const DRIVE: &'static str = "drive";

    fn now(&mut self) -> Instant {
        self.bench.bus.now()
    }

    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure> {
        let found = self.found()?;
        self.bench.bus.keep();
        Ok(found.iter().map(CellReading::watched).collect())
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        self.bench.bus.run(time);
        Ok(())
    }
}

fn address(found: &CellFound<'_>) -> String {
    let address = found.location.address();
    match found.location.memory {
        MemoryKind::Ram => format!("{address:04X}"),
        MemoryKind::Eeprom => format!("ee:{address:02X}"),
    }
}

impl CellReading for CellFound<'_> {
    const COLUMNS: &'static [&'static str] = &[
        "drive", "cell", "address", "raw", "value", "section", "meaning",
    ];
    const LIST: &'static str = "cells";

    fn row(&self) -> Vec<String> {
        let cell = self.location.cell();
        vec![
            self.axis.to_string(),
            self.location.name(),
            address(self),
            self.raw(),
            self.words(),
            cell.map_or(String::new(), |cell| cell.section.to_owned()),
            cell.map_or(String::new(), |cell| cell.english.to_owned()),
        ]
    }

    fn object(&self) -> Value {
        let memory = match self.location.memory {
            MemoryKind::Ram => "ram",
            MemoryKind::Eeprom => "eeprom",
        };
        json!({
            "axis": self.axis.to_string(),
            "name": self.location.name(),
            "memory": memory,
            "address": format!("{:04X}", self.location.address()),
            "raw": self.raw(),
            "value": self.number(),
            "unit": self.unit(),
            "bits": self.bits(),
            "section": self.location.cell().map(|cell| cell.section),
        })
    }

    fn watched(&self) -> WatchedCell {
        let words = self.words();
        let (digits, unit) = match self.location.scale {
            None => (self.raw(), HEX),
            Some(scale) => {
                let digits = match self.number() {
                    Value::Null => String::new(),
                    Value::String(text) => text,
                    number => number.to_string(),
                };
                (digits, scale.unit())
            }
        };
        WatchedCell {
            drive: self.axis.to_string(),
            name: self.location.name().to_string(),
            words: if words.is_empty() { self.raw() } else { words },
            digits,
            unit,
        }
    }
}
