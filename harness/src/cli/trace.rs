//! `drivebench trace`.

use super::args::{TraceArguments, TraceFormat, TraceLayout, TraceOutput};
use super::run::details;
use crate::buses::novobus::report::plot::plots;
use crate::buses::novobus::report::svg::{RowPlacing, SvgOptions, svg};
use crate::buses::novobus::report::table::{LEGEND, TablePart, table, wires};
use crate::buses::novobus::report::vcd::{self, Signals};
use crate::buses::novobus::report::{csv, json};
use crate::capture::Carries;
use crate::capture::runs::bits_per_second;
use crate::command::exit::Exit;
use crate::command::output::{Output, unless_closed};
use crate::command::page::writable;
use crate::command::play::play_entry;
use crate::library::Entry;
use crate::regular;
use crate::report::pcapng;
use crate::scenario::files::sources;
use crate::scenario::run::{AtMismatch, CellRecord};
use crate::scenario::verdict::Verdict;
use crate::traffic::{SegmentReport, SharedForm};
use clap::ValueEnum as _;
use harness_proto::line::Rate;
use harness_sim::record::Trace;
use std::io::{BufWriter, Write};
use std::ops::Range;

/// Lines about damaged bytes shown below a table.
const WIRES: usize = 20;

/// Plays a scenario and prints every byte.
pub(crate) fn trace(arguments: &TraceArguments, output: &mut Output) -> std::io::Result<Exit> {
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
    let showing = &arguments.showing;
    if !fits_output(arguments.format, showing, output) {
        return Ok(Exit::Usage);
    }
    let played = play_entry(&entry, AtMismatch::GoOn);
    if !fits_bus(arguments.format, &played.traces, output) {
        return Ok(Exit::Usage);
    }
    let shown = ShownRun {
        title: &entry.scenario.title,
        traces: &played.traces,
        report: entry.report(),
        rate: entry
            .plan
            .as_ref()
            .map(|plan| plan.rate)
            .unwrap_or_default(),
        records: &played.outcome.records,
    };
    if !show(&shown, arguments.format, showing, output)? {
        return Ok(Exit::RigError);
    }
    output.say(&details(&entry, &played.outcome, &played.traces));
    Ok(match played.outcome.verdict {
        // It shows what there is, also where nothing is judged.
        Verdict::Inconclusive => Exit::Passed,
        verdict => Exit::of(&[verdict], false),
    })
}

/// A run that is to be shown.
pub(crate) struct ShownRun<'s> {
    pub(crate) title: &'s str,
    pub(crate) traces: &'s [Trace],
    /// How the bus shows them; `None` for a ring.
    pub(crate) report: Option<&'static dyn SegmentReport>,
    pub(crate) rate: Rate,
    pub(crate) records: &'s [CellRecord],
}

/// Whether a form can go where it is to go: into a file that can be written, and what is no text not to a terminal.
pub(crate) fn fits_output(format: TraceFormat, showing: &TraceOutput, output: &mut Output) -> bool {
    if format == TraceFormat::Pcapng && showing.output.is_none() && output.terminal {
        output.complain(
            "pcapng is not a text, and standard output is a terminal; add `--output FILE`, or send it on with `|` or `>`",
        );
        return false;
    }
    let path = showing.output.as_ref();
    path.is_none_or(|path| writable(path, output).is_ok())
}

/// Shows a run. Returns false after reporting that the file could not be written.
pub(crate) fn show(
    shown: &ShownRun<'_>,
    format: TraceFormat,
    showing: &TraceOutput,
    output: &mut Output,
) -> std::io::Result<bool> {
    let Some(path) = &showing.output else {
        let out = BufWriter::new(std::io::stdout().lock());
        unless_closed(write(shown, format, showing, out))?;
        return Ok(true);
    };
    match regular::write(path, |out| write(shown, format, showing, out)) {
        Ok(()) => Ok(true),
        Err(error) => {
            output.complain(&format!("failed to write {}: {error}", path.display()));
            Ok(false)
        }
    }
}

fn write(
    shown: &ShownRun<'_>,
    format: TraceFormat,
    showing: &TraceOutput,
    mut out: impl Write,
) -> std::io::Result<()> {
    let rows = showing.rows.map(|rows| rows.first - 1..rows.last);
    if let Some(report) = shown.report {
        let signals = signals(showing);
        return of_shared_line((report, shown.traces), (format, signals), rows, out);
    }
    match format {
        TraceFormat::Json => json::write(shown.traces, shown.records, out),
        TraceFormat::Csv => csv::write(shown.traces, out),
        TraceFormat::Vcd => vcd::write(shown.traces, shown.rate, signals(showing), out),
        TraceFormat::Pcapng => pcapng::write(shown.traces, shown.rate, out),
        TraceFormat::Svg => {
            let options = SvgOptions {
                title: shown.title,
                id: "ring",
                scale: match showing.time {
                    TraceLayout::Index => RowPlacing::Index,
                    TraceLayout::True => RowPlacing::Time,
                },
                rate: shown.rate,
                rows,
            };
            out.write_all(svg(shown.traces, &options).as_bytes())?;
            out.flush()
        }
        // `fits_bus` has refused it.
        TraceFormat::Candump => Ok(()),
        TraceFormat::Table => {
            for trace in shown.traces {
                let part = TablePart {
                    rows: rows.clone(),
                    ..TablePart::default()
                };
                let wires = wires(trace, WIRES);
                write!(out, "{}\n{LEGEND}{wires}", table(trace, &part))?;
            }
            out.write_all(plots(shown.records).as_bytes())?;
            out.flush()
        }
    }
}

fn signals(showing: &TraceOutput) -> Signals {
    match showing.lines_only {
        true => Signals::Lines,
        false => Signals::All,
    }
}

/// Writes what a shared line carried. Other forms have been refused by [`fits_bus`].
fn of_shared_line(
    (report, traces): (&dyn SegmentReport, &[Trace]),
    (format, signals): (TraceFormat, Signals),
    wanted: Option<Range<usize>>,
    mut out: impl Write,
) -> std::io::Result<()> {
    let mut write = |form| report.write(traces, form, &mut out);
    match format {
        TraceFormat::Vcd => vcd::write_shared(traces, bits_per_second(traces), signals, out),
        TraceFormat::Json => write(SharedForm::Json),
        TraceFormat::Candump => write(SharedForm::Candump),
        TraceFormat::Csv => write(SharedForm::Csv),
        TraceFormat::Pcapng => write(SharedForm::Pcapng),
        _ => {
            for trace in traces {
                let text = report.rows(trace, wanted.clone(), None);
                out.write_all(text.as_bytes())?;
            }
            out.flush()
        }
    }
}

/// Whether a form can show what was carried. One that cannot is reported.
pub(crate) fn fits_bus(format: TraceFormat, traces: &[Trace], output: &mut Output) -> bool {
    const OF_RINGS: [TraceFormat; 2] = [TraceFormat::Svg, TraceFormat::Vcd];
    let name = format.to_possible_value();
    let name = name.as_ref().map_or("", |value| value.get_name());
    let why = match (Carries::of(traces), format) {
        (Carries::Frames, format) if OF_RINGS.contains(&format) => {
            format!("`--format {name}` shows bytes of a ring, and this bus carries frames; use table, json, csv, candump or pcapng")
        }
        (Carries::Line, TraceFormat::Svg) => {
            format!("`--format {name}` shows bytes of a ring, and the stations of this bus share one line; use table, json, csv, vcd or pcapng")
        }
        (Carries::Line | Carries::Link, TraceFormat::Candump) => {
            "`--format candump` shows frames of CAN, and this bus carries bytes; use table, json or csv".to_owned()
        }
        _ => return true,
    };
    output.complain(&why);
    false
}
