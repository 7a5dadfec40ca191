//! `drivebench import`, `diff`, `dissector`, `dbc` and `gsd`: captures that are read, and what helps to read them elsewhere.

use super::args::{DiffArguments, ImportArguments, ReadingArguments, UartChoice};
use super::trace::{fits_bus, fits_output, show};
use crate::bus_name::BusName;
use crate::buses::{carrier, carrying, named, report_of};
use crate::capture::{
    Capture, CaptureError, Carries, ImportedCapture, JudgeOptions, JudgedCapture, ReadSettings,
    is_capture, read_files,
};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::play::play_entry;
use crate::library::Entry;
use crate::regular;
use crate::scenario::files::sources;
use crate::scenario::run::AtMismatch;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::shown::ShownRun;
use harness_proto::time::Span;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Prints the dissector.
pub(crate) fn dissector(bus: BusName, output: &mut Output) -> std::io::Result<Exit> {
    output.result(&(named(bus).dissector)())?;
    Ok(Exit::Passed)
}

/// Prints the file that describes this number of drives: a DBC of frames on CAN, the GSD of slaves on PROFIBUS DP.
pub(crate) fn description(
    carries: Carries,
    drives: u16,
    output: &mut Output,
) -> std::io::Result<Exit> {
    if let Some(line) = carrying(carries) {
        output.result(&(line.description)(drives))?;
    }
    Ok(Exit::Passed)
}

/// Reads a capture and judges it, shows it or makes a scenario of it.
pub(crate) fn import(arguments: &ImportArguments, output: &mut Output) -> std::io::Result<Exit> {
    let Some(imported) = read(&arguments.files, &arguments.reading, output) else {
        return Ok(Exit::Usage);
    };
    let capture = &imported.capture;
    let Some(path) = arguments.files.first() else {
        return Ok(Exit::Usage);
    };
    let title = title(path);
    let bus = carrier(Carries::of(&capture.traces));
    if let Some(format) = arguments.format {
        let shown = ShownRun {
            title: &title,
            traces: &capture.traces,
            rate: capture.rate,
            records: &[],
        };
        if !fits_output(format, &arguments.showing, output)
            || !fits_bus(format, &capture.traces, output)
        {
            return Ok(Exit::Usage);
        }
        let written = show(bus.report, &shown, format, &arguments.showing, output)?;
        return Ok(if written {
            Exit::Passed
        } else {
            Exit::RigError
        });
    }
    let setup = match arguments.setup.as_deref().map(Source::read).transpose() {
        Ok(setup) => setup,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::Usage);
        }
    };
    if is_silent(capture) && !arguments.scenario {
        return nothing(&title, output);
    }
    let options = JudgeOptions {
        title: &title,
        setup: setup.as_ref(),
        tolerance: arguments.tolerance.map(span),
        stations: &arguments.judge,
    };
    let done =
        match arguments.scenario {
            true => (bus.replayed)(capture, &options)
                .map(|text| write_scenario(&text, arguments, output)),
            false => (bus.judged)(capture, &options)
                .map(|judged| tell(&judged, &imported, &title, output)),
        };
    done.unwrap_or_else(|error| {
        output.complain(&format!("{}: {error}", path.display()));
        Ok(Exit::Usage)
    })
}

/// Reports what came of judging a capture, of which a part may be missing.
fn tell(
    judged: &JudgedCapture,
    imported: &ImportedCapture,
    title: &str,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (verdict, why) = imported.settle(judged.verdict);
    if let Some(why) = why {
        output.say(&format!("  note: {why}\n"));
    }
    output.result(&format!(
        "{} {title}: {}\n",
        output.verdict(verdict).trim_end_matches(' '),
        judged.about
    ))?;
    for line in &judged.differences {
        output.result(&format!("  {line}\n"))?;
    }
    for remark in &judged.remarks {
        output.say(&format!("  note: {remark}\n"));
    }
    output.say(&judged.shown);
    Ok(Exit::of(&[verdict], false))
}

/// A capture in which nothing was carried.
fn nothing(title: &str, output: &mut Output) -> std::io::Result<Exit> {
    let verdict = Verdict::Inconclusive;
    let shown = output.verdict(verdict);
    output.result(&format!(
        "{} {title}: no byte and no frame is in it, and nothing was compared\n",
        shown.trim_end_matches(' ')
    ))?;
    Ok(Exit::of(&[verdict], false))
}

/// Reads the files of a capture, and says what was found and not read in them.
fn read(
    paths: &[PathBuf],
    reading: &ReadingArguments,
    output: &mut Output,
) -> Option<ImportedCapture> {
    let settings = ReadSettings {
        rate: reading.line,
        uart: match reading.uart {
            Some(UartChoice::Given(uart)) => Some(uart),
            Some(UartChoice::Auto) | None => None,
        },
        samples: reading.samples,
        links: reading.link.clone(),
    };
    match read_files(paths, &settings) {
        Ok(imported) => {
            for note in &imported.notes {
                output.say(&format!("  note: {note}\n"));
            }
            Some(imported)
        }
        // It names its file.
        Err(error @ CaptureError::File(..)) => {
            output.complain(&error.to_string());
            None
        }
        Err(error) => {
            let names = paths.iter().map(|path| path.display().to_string());
            let names: Vec<_> = names.collect();
            output.complain(&format!("{}: {error}", names.join(", ")));
            None
        }
    }
}

fn write_scenario(
    text: &str,
    arguments: &ImportArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let Some(path) = &arguments.showing.output else {
        output.result(text)?;
        return Ok(Exit::Passed);
    };
    match regular::write(path, |mut out| {
        out.write_all(text.as_bytes()).and_then(|()| out.flush())
    }) {
        Ok(()) => Ok(Exit::Passed),
        Err(error) => {
            output.complain(&format!("failed to write {}: {error}", path.display()));
            Ok(Exit::RigError)
        }
    }
}

/// Compares two captures or runs.
pub(crate) fn diff(arguments: &DiffArguments, output: &mut Output) -> std::io::Result<Exit> {
    let left = side(&arguments.left, arguments, output);
    let right = side(&arguments.right, arguments, output);
    let (Some(left), Some(right)) = (left, right) else {
        return Ok(Exit::Usage);
    };
    if is_silent(&left) && is_silent(&right) {
        output.complain("nothing was compared: no byte and no frame is on either side");
        return Ok(Exit::Incomplete);
    }
    let names = [title(&arguments.left), title(&arguments.right)];
    let [one, other] = [&left, &right].map(|capture| report_of(&capture.traces));
    if one.carries() != other.carries() {
        output.complain(&format!(
            "one side has {} and the other {}; two of one kind expected",
            one.carries(),
            other.carries()
        ));
        return Ok(Exit::Usage);
    }
    let tolerance = JudgeOptions {
        tolerance: arguments.tolerance.map(span),
        ..JudgeOptions::default()
    };
    let shown = [&names[0][..], &names[1]];
    let (same, text) = one.difference([&left, &right], tolerance.tolerance(), shown);
    output.result(&text)?;
    Ok(if same { Exit::Passed } else { Exit::Failed })
}

/// Whether nothing was carried.
fn is_silent(capture: &Capture) -> bool {
    let mut channels = capture.traces.iter().flat_map(|trace| &trace.channels);
    channels.all(|channel| channel.octets().is_empty() && channel.frames().is_empty())
}

/// A capture, or a scenario that is played.
fn side(path: &Path, arguments: &DiffArguments, output: &mut Output) -> Option<Capture> {
    if is_capture(path) {
        let read = read(&[path.to_owned()], &arguments.reading, output);
        return read.map(|read| read.capture);
    }
    let sources = match sources(&[path.to_owned()]) {
        Ok(sources) => sources,
        Err(error) => {
            output.library_error(&error);
            return None;
        }
    };
    let Ok([source]) = <[_; 1]>::try_from(sources) else {
        output.complain("a capture or one scenario is expected, not a folder");
        return None;
    };
    let entry = match Entry::new(source, None) {
        Ok(entry) => entry,
        Err(problems) => {
            output.mistakes(&problems);
            return None;
        }
    };
    Some(Capture {
        rate: entry.rate(),
        traces: play_entry(&entry, AtMismatch::GoOn).traces,
        listened: None,
        timed: true,
    })
}

/// The name of a file without its folders.
fn title(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

fn span(tolerance: Duration) -> Span {
    Span::from_nanos(u64::try_from(tolerance.as_nanos()).unwrap_or(u64::MAX))
}
