//! `drivebench read`: cells of drives, with their units and bits.

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::cell::{CellFound, find};
use crate::language::argument::{MemoryKind, MemoryRange, cells};
use harness_bench::command::drive::{OutputForm, ReadArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::{Output, columns};
use harness_bench::command::rig_name::Use;
use serde_json::json;

/// Reads cells and shows them.
pub(crate) fn read(arguments: &ReadArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    let look = Use::look("read");
    rig::on(&arguments.rig, look, output, |bench, output| {
        show(arguments, &cells, bench, output)
    })
}

fn show(
    arguments: &ReadArguments,
    cells: &[MemoryRange],
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let drives = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
    let mut found = Vec::new();
    for axis in drives {
        let units = bench.units(axis)?;
        for cell in cells {
            found.push(find(&bench.bus, (axis, units), cell)?);
        }
    }
    match arguments.format {
        OutputForm::Text => output.result(&output.fitted(&table(&found)))?,
        OutputForm::Json => {
            let cells: Vec<_> = found.iter().map(object).collect();
            output.result(&format!("{}\n", json!({"schema": 1, "cells": cells})))?;
        }
    }
    Ok(Exit::Passed)
}

/// Drive, name, address, bytes, value or bits, section and meaning.
fn table(found: &[CellFound<'_>]) -> String {
    let row = |found: &CellFound<'_>| {
        let cell = found.location.cell();
        [
            found.axis.to_string(),
            found.location.name(),
            address(found),
            found.raw(),
            found.words(),
            cell.map_or(String::new(), |cell| cell.section.to_owned()),
            cell.map_or(String::new(), |cell| cell.english.to_owned()),
        ]
    };
    let heading = [
        "drive", "cell", "address", "raw", "value", "section", "meaning",
    ];
    columns(&heading, &found.iter().map(row).collect::<Vec<_>>())
}

fn address(found: &CellFound<'_>) -> String {
    let address = found.location.address();
    match found.location.memory {
        MemoryKind::Ram => format!("{address:04X}"),
        MemoryKind::Eeprom => format!("ee:{address:02X}"),
    }
}

fn object(found: &CellFound<'_>) -> serde_json::Value {
    let memory = match found.location.memory {
        MemoryKind::Ram => "ram",
        MemoryKind::Eeprom => "eeprom",
    };
    json!({
        "axis": found.axis.to_string(),
        "name": found.location.name(),
        "memory": memory,
        "address": format!("{:04X}", found.location.address()),
        "raw": found.raw(),
        "value": found.number(),
        "unit": found.unit(),
        "bits": found.bits(),
        "section": found.location.cell().map(|cell| cell.section),
    })
}
