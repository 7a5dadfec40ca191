//! The page that a scenario leaves: verdict, table and plots. Snapshots of scenarios are such pages.

use crate::library::Entry;
use crate::report::plot::plots;
use crate::scenario::run::Outcome;
use crate::shown::TablePart;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// Rows of a table that a page holds at most.
const ROWS: usize = 120;

/// Columns of a table that a page holds at most.
const COLUMNS: usize = 20;

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
    let report = entry.report;
    let part = TablePart {
        at_most: Some(ROWS),
        columns_at_most: Some(COLUMNS),
        ..TablePart::default()
    };
    for trace in traces {
        let (rows, damaged) = (report.rows(trace, &part), report.damaged(trace));
        let _infallible = write!(page, "\n{rows}{damaged}");
    }
    if !report.legend().is_empty() {
        let _infallible = write!(page, "\n{}", report.legend());
    }
    page.push_str(&plots(&outcome.records));
    page
}
