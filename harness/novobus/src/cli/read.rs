//! `drivebench read`: cells of drives, with their units and bits.

use super::{axes, rig};
use crate::driver::cell::{CellFound, find};
use crate::language::argument::{MemoryKind, cells};
use harness_bench::command::drive::ReadArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::reading::{CellReading, show};
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{HEX, WatchedCell};
use serde_json::{Value, json};

/// Reads cells and shows them.
pub(crate) fn read(arguments: &ReadArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    let look = Use::look("read");
    rig::on(&arguments.rig, look, output, |bench, output| {
        let drives = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
        let mut found = Vec::new();
        for axis in drives {
            let units = bench.units(axis)?;
            for cell in &cells {
                found.push(find(&bench.bus, (axis, units), cell)?);
            }
        }
        show(&found, arguments.format, output)
    })
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
