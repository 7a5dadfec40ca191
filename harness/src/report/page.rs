//! The page that a scenario leaves: verdict, table and plots. Snapshots of scenarios are such pages.

use crate::buses::novobus::report::plot::plots;
use crate::buses::novobus::report::table::{LEGEND, TablePart, table, wires};
use crate::library::Entry;
use crate::scenario::run::Outcome;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// Rows of a table that a page holds at most.
const ROWS: usize = 120;

/// Columns of a table that a page holds at most.
const COLUMNS: usize = 20;

/// Lines of bytes where a link had another one than its neighbours, at most.
const WIRES: usize = 20;

/// The page of a scenario that was played, with what each ring's links carried.
#[must_use]
pub fn page(entry: &Entry, outcome: &Outcome, traces: &[Trace]) -> String {
    let mut page = format!("{}\n", entry.scenario.title);
    // Writing to a String cannot fail.
    for source in &entry.scenario.sources {
        let _infallible = writeln!(page, "pins {}", source.text);
    }
    let _infallible = writeln!(page, "{} after {}", outcome.verdict, outcome.took);
    for remark in &outcome.remarks {
        let _infallible = writeln!(page, "note: {remark}");
    }
    let mut legend = true;
    for trace in traces {
        if let Some(report) = entry.report() {
            let rows = report.rows(trace, None, Some(ROWS));
            let _infallible = write!(page, "\n{rows}");
            legend = false;
            continue;
        }
        let part = TablePart {
            at_most: Some(ROWS),
            columns_at_most: Some(COLUMNS),
            ..TablePart::default()
        };
        let _infallible = write!(page, "\n{}{}", table(trace, &part), wires(trace, WIRES));
    }
    if legend {
        let _infallible = write!(page, "\n{LEGEND}");
    }
    page.push_str(&plots(&outcome.records));
    page
}
