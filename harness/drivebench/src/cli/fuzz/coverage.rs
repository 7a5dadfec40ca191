//! `drivebench fuzz coverage`: the matrix of protocol transitions, what reaches it, and what the inputs of each target reach.

use crate::command::args::TableFormat;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::fuzz::coverage::{Coverage, CoverageError, Sum};
use clap::Args;
use harness_sim::novobus::transitions::{CELLS, Transition, why_unreachable};
use serde::Serialize;
use std::path::PathBuf;

/// For `fuzz coverage`.
#[derive(Clone, Debug, Args)]
pub struct CoverageArguments {
    /// Output format.
    #[arg(long, value_enum, default_value_t = TableFormat::Table)]
    pub format: TableFormat,
    /// Play the inputs of this folder, which has one folder per target, instead of the built-in ones.
    #[arg(long, value_name = "FOLDER")]
    pub corpus: Option<PathBuf>,
}

/// One cell, for tools.
#[derive(Serialize)]
struct Cell {
    state: &'static str,
    event: &'static str,
    corpus: bool,
    hardware: bool,
    /// Why nothing can reach it; missing where something can.
    #[serde(skip_serializing_if = "Option::is_none")]
    unreachable: Option<&'static str>,
}

/// One input, for tools.
#[derive(Serialize)]
struct Input<'a> {
    name: &'a str,
    reached: usize,
}

/// Everything, for tools.
#[derive(Serialize)]
struct Table<'a> {
    schema: u8,
    cells: usize,
    reachable: usize,
    reached_by_corpus: usize,
    reached_on_hardware: usize,
    percent: f64,
    inputs: Vec<Input<'a>>,
    targets: &'a [Sum],
    transitions: Vec<Cell>,
}

impl<'a> Table<'a> {
    fn new(coverage: &'a Coverage) -> Self {
        let cell = |cell: Transition| Cell {
            state: cell.state.name(),
            event: cell.event.name(),
            corpus: coverage.corpus.contains(cell),
            hardware: coverage.hardware.contains(cell),
            unreachable: why_unreachable(cell).map(|rule| rule.reason),
        };
        let input = |file: &'a crate::fuzz::coverage::InputReach| Input {
            name: &file.name,
            reached: file.reached.count(),
        };
        Self {
            schema: 1,
            cells: CELLS,
            reachable: Transition::reachable().count(),
            reached_by_corpus: coverage.corpus.count(),
            reached_on_hardware: coverage.hardware.count(),
            percent: Coverage::percent(&coverage.corpus),
            inputs: coverage.files.iter().map(input).collect(),
            targets: &coverage.targets,
            transitions: Transition::all().map(cell).collect(),
        }
    }
}

/// Plays the inputs and shows what they reach.
pub(crate) fn coverage(
    arguments: &CoverageArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let played = match &arguments.corpus {
        Some(folder) => Coverage::of_folder(folder),
        None => Coverage::committed(),
    };
    let coverage = match played {
        Ok(coverage) => coverage,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(match error {
                CoverageError::Rule { .. } => Exit::Failed,
                CoverageError::Empty => Exit::NothingSelected,
                _ => Exit::Usage,
            });
        }
    };
    match arguments.format {
        TableFormat::Table => output.result(&coverage.page())?,
        TableFormat::Json => {
            let text = serde_json::to_string(&Table::new(&coverage))?;
            output.result(&(text + "\n"))?;
        }
    }
    Ok(if coverage.missing().is_empty() {
        Exit::Passed
    } else {
        Exit::Failed
    })
}
