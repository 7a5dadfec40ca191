//! `drivebench watch`: the values of cells, again and again.

use super::args::{WatchArguments, WatchForm};
use super::axes;
use super::rig::{self, OpenBench, Use};
use crate::buses::novobus::driver::Axis;
use crate::buses::novobus::driver::cell::{CellFound, find};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::scenario::argument::{MemoryRange, cells};
use harness_proto::nd21::units::DriveUnits;
use harness_proto::time::Span;

/// Maximum number of lines of one command.
pub(crate) const MOST: u64 = 1_000_000;

/// Shows values, a line each time.
pub(crate) fn watch(arguments: &WatchArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    if arguments.every == Span::ZERO || arguments.length.units() / arguments.every.units() > MOST {
        return Err(Failure::refused(format!(
            "--every must be longer than nothing, and --for at most {MOST} times as long"
        )));
    }
    let look = Use::look("watch");
    rig::on(&arguments.rig, look, output, |bench, output| {
        show(arguments, &cells, bench, output)
    })
}

fn show(
    arguments: &WatchArguments,
    cells: &[MemoryRange],
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axes = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
    let drives = axes
        .into_iter()
        .map(|axis| Ok((axis, bench.units(axis)?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    let again = arguments.format == WatchForm::Text && output.full_screen;
    if arguments.format == WatchForm::Csv {
        output.result(&heading(&drives, cells))?;
    }
    let start = bench.bus.now();
    let end = start + arguments.length;
    let mut next = start;
    loop {
        let at = bench.bus.now().since(start);
        let found = look(bench, &drives, cells)?;
        bench.bus.keep();
        let line = match arguments.format {
            WatchForm::Text => line(at, &found),
            WatchForm::Csv => row(at, &found),
        };
        if again {
            output.result(&format!("\r\x1b[K{line}"))?;
        } else {
            output.result(&format!("{line}\n"))?;
        }
        next += arguments.every;
        let now = bench.bus.now();
        // If reading takes longer than the given period, it is repeated as often as possible.
        next = next.max(now);
        if next > end {
            break;
        }
        bench.bus.run(next.since(now));
    }
    if again {
        output.result("\n")?;
    }
    Ok(Exit::Passed)
}

fn look<'a>(
    bench: &OpenBench,
    drives: &[(Axis, DriveUnits)],
    cells: &'a [MemoryRange],
) -> Result<Vec<CellFound<'a>>, Failure> {
    let mut found = Vec::new();
    for drive in drives {
        for cell in cells {
            found.push(find(&bench.bus, *drive, cell)?);
        }
    }
    Ok(found)
}

/// Time, and of each drive the names and values.
fn line(at: Span, found: &[CellFound<'_>]) -> String {
    let mut line = format!("{:>12}", at.to_string());
    let mut axis = None;
    for found in found {
        if axis != Some(found.axis) {
            axis = Some(found.axis);
            line.push_str(&format!("  drive {}", found.axis));
        }
        let words = found.words();
        let value = if words.is_empty() { found.raw() } else { words };
        line.push_str(&format!("  {} {value}", found.location.name()));
    }
    line
}

fn heading(drives: &[(Axis, DriveUnits)], cells: &[MemoryRange]) -> String {
    let mut line = "time_ms".to_owned();
    for (axis, _) in drives {
        for cell in cells {
            let unit = cell.scale.map_or("", |scale| scale.unit());
            let name = format!("{axis} {} {unit}", cell.name());
            line.push_str(&format!(",{}", name.trim_end()));
        }
    }
    line + "\n"
}

fn row(at: Span, found: &[CellFound<'_>]) -> String {
    let mut line = format!("{:.3}", at.as_millis_f64());
    for found in found {
        let value = match found.location.scale {
            None => found.raw(),
            Some(_) => match found.number() {
                serde_json::Value::Null => String::new(),
                serde_json::Value::String(text) => text,
                number => number.to_string(),
            },
        };
        line.push_str(&format!(",{value}"));
    }
    line
}
