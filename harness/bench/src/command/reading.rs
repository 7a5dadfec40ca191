//! What was read of a cell, and how `read` shows it on every bus.

use super::drive::OutputForm;
use super::exit::Exit;
use super::failure::Failure;
use super::output::{Output, columns};
use super::watch::WatchedCell;
use serde_json::{Value, json};

/// What was read of a cell of a drive.
pub trait CellReading {
    /// The heading of the table.
    const COLUMNS: &'static [&'static str];
    /// The name of the list in JSON.
    const LIST: &'static str;

    /// Its row of the table.
    fn row(&self) -> Vec<String>;

    /// Its object in JSON.
    fn object(&self) -> Value;

    /// As `watch` shows it.
    fn watched(&self) -> WatchedCell;
}

/// Shows what was read.
///
/// # Errors
/// [`Failure::Output`].
pub fn show<R: CellReading>(
    found: &[R],
    form: OutputForm,
    output: &mut Output,
) -> Result<Exit, Failure> {
    match form {
        OutputForm::Text => {
            let rows: Vec<_> = found.iter().map(R::row).collect();
            output.result(&output.fitted(&columns(R::COLUMNS, &rows)))?;
        }
        OutputForm::Json => {
            let list: Vec<_> = found.iter().map(R::object).collect();
            output.result(&format!("{}\n", json!({"schema": 1, (R::LIST): list})))?;
        }
    }
    Ok(Exit::Passed)
}
