//! The conditions of interlocks in a rig's file: cells and inputs of an ND21, and the mistakes that can stand there.

use crate::language::scale::dimension_of;
use harness_bench::file::schema::PathStep;
use harness_bench::file::values::ValueError;
use harness_bench::rig::check::RigCheck;
use harness_bench::rig::file::{Interlock, Level};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::quantity::parse as quantity;
use harness_proto::nd21::cells::{Cell, RAM, cell};
use harness_proto::nd21::io::Input;

/// What must hold; `None` only where the file was not checked.
#[must_use]
pub(crate) fn condition(interlock: &Interlock) -> Option<InterlockCondition> {
    if let Some(name) = &interlock.input {
        return Some(InterlockCondition::Input {
            input: Input::from_name(name)?,
            level: interlock.level?,
        });
    }
    let cell = cell(interlock.cell.as_deref()?)?;
    let bound = |text: &Option<String>| {
        text.as_deref()
            .and_then(|text| self::bound(cell, text).ok())
    };
    Some(InterlockCondition::Cell {
        cell,
        min: bound(&interlock.min),
        max: bound(&interlock.max),
    })
}

/// What an interlock looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum InterlockCondition {
    /// The value of a cell stays within bounds, in the unit of its scale.
    Cell {
        cell: &'static Cell,
        /// The least.
        min: Option<f64>,
        /// The most.
        max: Option<f64>,
    },
    /// An input stays at a level.
    Input { input: Input, level: Level },
}

/// A bound of an interlock, in the unit of its cell's scale.
fn bound(cell: &Cell, text: &str) -> Result<f64, ValueError> {
    let wrong = |message: String, expected: &str| ValueError {
        message,
        expected: expected.to_owned(),
    };
    let Some(dimension) = cell.scale.and_then(dimension_of) else {
        return text.trim().parse::<i32>().map(f64::from).map_err(|_| {
            wrong(
                format!("`{text}` is not a whole number"),
                "the cell has no unit: a whole number in quotes expected here",
            )
        });
    };
    let unit = cell.scale.map_or("", |scale| scale.unit());
    let expected = format!("a number in {unit} expected here");
    let value = quantity(text).map_err(|problem| wrong(problem.message, &expected))?;
    if value.unit.dimension() == dimension {
        Ok(value.value.to_f64())
    } else {
        let message = format!("`{}` is not a unit of {}", value.unit.name, cell.printed);
        Err(wrong(message, &expected))
    }
}

/// One entry of `[[interlock]]`.
pub(super) fn check(rig: &mut RigCheck<'_>, path: &[PathStep<'_>], interlock: &Interlock) {
    let at = |key| [path, &[PathStep::Key(key)]].concat();
    rig.drive(&at("drive"), interlock.ring, interlock.drive);
    let bounds = [("min", &interlock.min), ("max", &interlock.max)];
    match (&interlock.cell, &interlock.input) {
        (Some(name), None) => {
            let Some(cell) = cell(name) else {
                let known: Vec<_> = RAM.iter().map(|cell| cell.printed).collect();
                let place = rig.place(&at("cell"));
                let problem = Problem::new(
                    place,
                    format!("there is no cell `{name}`"),
                    "the name of a RAM cell expected here (`drivebench cells`)",
                );
                rig.problems.push(problem.did_you_mean(name, &known));
                return;
            };
            if interlock.min.is_none() && interlock.max.is_none() {
                rig.wrong(
                    &at("cell"),
                    "nothing bounds this cell",
                    "`min`, `max` or both expected beside it",
                );
            }
            if interlock.level.is_some() {
                rig.wrong(
                    &at("level"),
                    "`level` is for inputs",
                    "`min` or `max` expected in its place",
                );
            }
            let mut values = Vec::new();
            for (key, text) in bounds {
                let Some(text) = text else { continue };
                match bound(cell, text) {
                    Ok(value) => values.push(value),
                    Err(error) => rig.wrong(&at(key), error.message, error.expected),
                }
            }
            if values.len() == 2 && values[0] > values[1] {
                rig.wrong(
                    &at("min"),
                    "`min` is above `max`",
                    "a smaller value expected here",
                );
            }
        }
        (None, Some(name)) => {
            if Input::from_name(name).is_none() {
                let known = Input::ALL.map(Input::name);
                let problem = Problem::new(
                    rig.place(&at("input")),
                    format!("there is no input `{name}`"),
                    format!("one of {} expected here", known.join(", ")),
                );
                rig.problems.push(problem.did_you_mean(name, &known));
            }
            if interlock.level.is_none() {
                rig.wrong(
                    &at("input"),
                    "the level that the input must hold is missing",
                    "`level` expected beside it",
                );
            }
            for (key, text) in bounds {
                if text.is_some() {
                    rig.wrong(
                        &at(key),
                        format!("`{key}` is for cells"),
                        "`level` expected in its place",
                    );
                }
            }
        }
        _ => rig.wrong(
            path,
            "an interlock looks at one thing",
            "either `cell` or `input` expected in here",
        ),
    }
}
