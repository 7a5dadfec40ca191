//! `drivebench trace`.

use super::args::{Format, TraceArguments};
use super::exit::Exit;
use super::output::{Output, unless_closed};
use super::run::{details, play_entry};
use crate::library::{Entry, sources};
use crate::report::json;
use crate::report::plot::plots;
use crate::report::table::{LEGEND, Part, table, wires};
use crate::scenario::run::AtFinding;
use harness_sim::trace::Trace;
use std::io::BufWriter;

/// Lines about damaged bytes shown below a table.
const WIRES: usize = 20;

/// Plays a scenario and prints every byte.
pub(super) fn trace(arguments: &TraceArguments, output: &mut Output) -> std::io::Result<Exit> {
    let sources = match sources(std::slice::from_ref(&arguments.file)) {
        Ok(sources) => sources,
        Err(error) => {
            output.library_error(&error);
            return Ok(Exit::Usage);
        }
    };
    let Ok([source]) = <[_; 1]>::try_from(sources) else {
        output.complain(
            "one scenario is expected, not a folder; `drivebench list` shows what there is",
        );
        return Ok(Exit::Usage);
    };
    let entry = match Entry::new(source, arguments.ring) {
        Ok(entry) => entry,
        Err(problems) => {
            output.mistakes(&problems);
            return Ok(Exit::Usage);
        }
    };
    let played = play_entry(&entry, AtFinding::GoOn);
    let records = &played.outcome.records;
    match arguments.format {
        Format::Json => {
            let out = BufWriter::new(std::io::stdout().lock());
            unless_closed(json::write(&played.traces, records, out))?;
        }
        Format::Table => {
            for trace in &played.traces {
                output.result(&render(trace, arguments))?;
            }
            output.result(&plots(records))?;
        }
    }
    output.say(&details(&entry, &played.outcome, &played.traces));
    Ok(Exit::of(&[played.outcome.verdict], false))
}

fn render(trace: &Trace, arguments: &TraceArguments) -> String {
    let part = Part {
        rows: arguments.rows.map(|rows| rows.first - 1..rows.last),
        ..Part::default()
    };
    let wires = wires(trace, WIRES);
    format!("{}\n{LEGEND}{wires}", table(trace, &part))
}
