//! `drivebench read` on NORDAC inverters: process words and parameters, with their units.

use super::bench::driver;
use crate::driver::{Driver, Error, percent};
use crate::rig::Inverters;
use crate::value::{Cell, ReplyWord, cells, shown};
use harness_bench::command::drive::{OutputForm, ReadArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::output::columns;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{HEX, decimal};
use harness_proto::nordac::PkwError;
use serde_json::json;

/// What was read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    pub(super) slave: u8,
    pub(super) cell: Cell,
    /// A word, or a number in steps of the parameter's unit.
    pub(super) number: i64,
}

impl Found {
    /// The digits as they travel.
    pub(super) fn raw(&self) -> String {
        match self.cell {
            Cell::Word(_) => format!("{:04X}", self.word()),
            Cell::Parameter(_) => self.number.to_string(),
        }
    }

    fn word(&self) -> u16 {
        u16::try_from(self.number).unwrap_or_default()
    }

    /// Its value without its unit, and the unit.
    pub(super) fn digits(&self) -> (String, &'static str) {
        match self.cell {
            Cell::Word(ReplyWord::Actual) => (decimal(percent(self.word())), "%"),
            Cell::Word(_) => (self.raw(), HEX),
            Cell::Parameter(own) => {
                let unit = own.parameter.unit_of(own.index.element);
                let text = unit.show(self.number).to_string();
                let digits = text.strip_suffix(unit.name).unwrap_or(&text).trim_end();
                (digits.to_owned(), unit.name)
            }
        }
    }

    /// Its meaning.
    pub(super) fn words(&self) -> String {
        match self.cell {
            Cell::Word(word) => word.words(self.word()),
            Cell::Parameter(own) => shown(&own, self.number),
        }
    }
}

/// Reads cells and shows them.
pub(super) fn read(
    bench: PortBench<'_, Inverters>,
    arguments: &ReadArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells).map_err(Failure::refused)?;
    let as_what = Use::look("read");
    on(bench, &arguments.rig, as_what, output, |session, output| {
        let slaves = select(std::slice::from_ref(&arguments.drives), session)?;
        let mut driver = driver(session);
        let mut found = Vec::new();
        for slave in slaves {
            driver.join(slave)?;
            found.extend(find(&mut driver, slave, &cells)?);
        }
        match arguments.format {
            OutputForm::Text => output.result(&output.fitted(&table(&found)))?,
            OutputForm::Json => {
                let cells: Vec<_> = found.iter().map(object).collect();
                output.result(&format!("{}\n", json!({"schema": 1, "cells": cells})))?;
            }
        }
        Ok(Exit::Passed)
    })
}

/// Reads cells of a slave. Of many, those that need the PosiCon option are left out where it is not there, and so are double words where the
/// PPO type carries none.
pub(super) fn find(
    driver: &mut Driver<'_>,
    slave: u8,
    cells: &[Cell],
) -> Result<Vec<Found>, Error> {
    let mut found = Vec::new();
    let mut absent = false;
    for &cell in cells {
        let number = match cell {
            Cell::Word(word) => word.of(&driver.cycle(slave)?).into(),
            Cell::Parameter(own) if absent && own.parameter.needs_posicon() => continue,
            Cell::Parameter(own) => match driver.read(slave, &own) {
                Err(Error::Refused { error, .. })
                    if cells.len() > 1 && own.parameter.needs_posicon() =>
                {
                    absent |= error == PkwError::Number;
                    continue;
                }
                other => other?,
            },
        };
        found.push(Found {
            slave,
            cell,
            number,
        });
    }
    Ok(found)
}

/// Slave, number, name, raw, value and section of the manual.
fn table(found: &[Found]) -> String {
    let row = |found: &Found| {
        let (number, name, section) = match found.cell {
            Cell::Word(word) => (word.name().to_owned(), "", "3.2"),
            Cell::Parameter(own) => (own.to_string(), own.parameter.name, own.parameter.section),
        };
        [
            found.slave.to_string(),
            number,
            name.to_owned(),
            found.raw(),
            found.words(),
            section.to_owned(),
        ]
    };
    let heading = ["slave", "PNU", "name", "raw", "value", "section"];
    columns(&heading, &found.iter().map(row).collect::<Vec<_>>())
}

fn object(found: &Found) -> serde_json::Value {
    let mut object = json!({
        "slave": found.slave,
        "raw": found.number,
        "value": found.words(),
    });
    match found.cell {
        Cell::Word(word) => object["word"] = json!(word.name()),
        Cell::Parameter(own) => {
            object["parameter"] = json!(own.to_string());
            object["name"] = json!(own.parameter.name);
            object["unit"] = json!(own.parameter.unit_of(own.index.element).name);
            object["section"] = json!(own.parameter.section);
        }
    }
    object
}
