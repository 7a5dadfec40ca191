//! What is read of NORDAC inverters: process words and parameters, with their units.

use crate::driver::{Driver, Error, percent};
use crate::value::{Cell, ReplyWord, shown};
use harness_bench::command::reading::CellReading;
use harness_bench::command::watch::{HEX, WatchedCell, decimal};
use harness_proto::nordac::PkwError;
use serde_json::{Value, json};

#[derive(Clone, Copy, Debug)]
pub(crate) struct ReadCell {
    pub(super) slave: u8,
    pub(super) cell: Cell,
    /// A word, or a number in steps of the parameter's unit.
    pub(super) number: i64,
}

impl ReadCell {
    /// The digits as they travel.
    fn raw(&self) -> String {
        match self.cell {
            Cell::Word(_) => format!("{:04X}", self.word()),
            Cell::Parameter(_) => self.number.to_string(),
        }
    }

    fn word(&self) -> u16 {
        u16::try_from(self.number).unwrap_or_default()
    }

    /// Its value without its unit, and the unit.
    fn digits(&self) -> (String, &'static str) {
        match self.cell {
            Cell::Word(ReplyWord::Actual) => (decimal(percent(self.word())), "%"),
            Cell::Word(_) => (self.raw(), HEX),
            Cell::Parameter(parameter) => {
                let unit = parameter.parameter.unit_of(parameter.index.element);
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
            Cell::Parameter(parameter) => shown(&parameter, self.number),
        }
    }
}

/// Reads cells of a slave. Of many, those that need the PosiCon option are left out where it is not there, and so are double words where the
/// PPO type carries none.
pub(super) fn find(
    driver: &mut Driver<'_>,
    slave: u8,
    cells: &[Cell],
) -> Result<Vec<ReadCell>, Error> {
    let mut found = Vec::new();
    let mut absent = false;
    for &cell in cells {
        let number = match cell {
            Cell::Word(word) => word.of(&driver.cycle(slave)?).into(),
            Cell::Parameter(parameter) if absent && parameter.parameter.needs_posicon() => continue,
            Cell::Parameter(parameter) => match driver.read(slave, &parameter) {
                Err(Error::Refused { error, .. })
                    if cells.len() > 1 && parameter.parameter.needs_posicon() =>
                {
                    absent |= error == PkwError::Number;
                    continue;
                }
                other => other?,
            },
        };
        found.push(ReadCell {
            slave,
            cell,
            number,
        });
    }
    Ok(found)
}

impl CellReading for ReadCell {
    const COLUMNS: &'static [&'static str] = &["slave", "PNU", "name", "raw", "value", "section"];
    const LIST: &'static str = "cells";

    fn row(&self) -> Vec<String> {
        let (number, name, section) = match self.cell {
            Cell::Word(word) => (word.name().to_owned(), "", "3.2"),
            Cell::Parameter(named) => {
                let row = named.parameter;
                (named.to_string(), row.name, row.section)
            }
        };
        vec![
            self.slave.to_string(),
            number,
            name.to_owned(),
            self.raw(),
            self.words(),
            section.to_owned(),
        ]
    }

    fn object(&self) -> Value {
        let mut object = json!({
            "slave": self.slave,
            "raw": self.number,
            "value": self.words(),
        });
        match self.cell {
            Cell::Word(word) => object["word"] = json!(word.name()),
            Cell::Parameter(parameter) => {
                object["parameter"] = json!(parameter.to_string());
                object["name"] = json!(parameter.parameter.name);
                object["unit"] = json!(parameter.parameter.unit_of(parameter.index.element).name);
                object["section"] = json!(parameter.parameter.section);
            }
        }
        object
    }

    fn watched(&self) -> WatchedCell {
        let words = self.words();
        let (digits, unit) = self.digits();
        WatchedCell {
            drive: self.slave.to_string(),
            name: self.cell.name(),
            words: match words.is_empty() {
                true => self.raw(),
                false => words,
            },
            digits,
            unit,
        }
    }
}
