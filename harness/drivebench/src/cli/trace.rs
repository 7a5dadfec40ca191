//! `drivebench trace`.

use super::args::{TraceArguments, TraceFormat, TraceLayout, TraceOutput};
use super::run::details;
use crate::capture::Carries;
use crate::command::exit::Exit;
use crate::command::output::{Output, unless_closed};
use crate::command::page::writable;
use crate::command::play::play_entry;
use crate::library::Entry;
use crate::regular;
use crate::report::plot::plots;
use crate::report::vcd::Signals;
use crate::scenario::files::sources;
use crate::scenario::run::AtMismatch;
use crate::scenario::verdict::Verdict;
use crate::shown::{FileForm, RowPlacing, SegmentReport, ShownRun, TablePart};
use clap::ValueEnum as _;
use harness_sim::record::Trace;
use std::io::{BufWriter, Write};

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
        rate: entry.rate(),
        records: &played.outcome.records,
    };
    if !show(entry.report, &shown, arguments.format, showing, output)? {
        return Ok(Exit::RigError);
    }
    output.say(&details(&entry, &played.outcome, &played.traces));
    Ok(match played.outcome.verdict {
        // It shows what there is, also where nothing is judged.
        Verdict::Inconclusive => Exit::Passed,
        verdict => Exit::of(&[verdict], false),
    })
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
    report: &dyn SegmentReport,
    shown: &ShownRun<'_>,
    format: TraceFormat,
    showing: &TraceOutput,
    output: &mut Output,
) -> std::io::Result<bool> {
    let Some(path) = &showing.output else {
        let out = BufWriter::new(std::io::stdout().lock());
        unless_closed(write(report, shown, format, showing, out))?;
        return Ok(true);
    };
    match regular::write(path, |out| write(report, shown, format, showing, out)) {
        Ok(()) => Ok(true),
        Err(error) => {
            output.complain(&format!("failed to write {}: {error}", path.display()));
            Ok(false)
        }
    }
}

fn write(
    report: &dyn SegmentReport,
    shown: &ShownRun<'_>,
    format: TraceFormat,
    showing: &TraceOutput,
    mut out: impl Write,
) -> std::io::Result<()> {
    let rows = showing.rows.map(|rows| rows.first - 1..rows.last);
    let form = match format {
        TraceFormat::Json => FileForm::Json,
        TraceFormat::Csv => FileForm::Csv,
        TraceFormat::Pcapng => FileForm::Pcapng,
        TraceFormat::Candump => FileForm::Candump,
        TraceFormat::Vcd if showing.lines_only => FileForm::Vcd(Signals::Lines),
        TraceFormat::Vcd => FileForm::Vcd(Signals::All),
        TraceFormat::Svg => {
            let placing = match showing.time {
                TraceLayout::Index => RowPlacing::Index,
                TraceLayout::True => RowPlacing::Time,
            };
            FileForm::Svg(placing, rows)
        }
        TraceFormat::Table => {
            let part = TablePart {
                rows,
                ..TablePart::default()
            };
            for trace in shown.traces {
                let (rows, damaged) = (report.rows(trace, &part), report.damaged(trace));
                match report.legend() {
                    "" => write!(out, "{rows}{damaged}")?,
                    legend => write!(out, "{rows}\n{legend}{damaged}")?,
                }
            }
            out.write_all(plots(shown.records).as_bytes())?;
            return out.flush();
        }
    };
    report.write(shown, form, &mut out)
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
