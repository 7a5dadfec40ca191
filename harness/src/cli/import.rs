//! `drivebench import`, `diff`, `dissector`, `dbc` and `gsd`: captures that are read, and what helps to read them elsewhere.

use super::args::{DiffArguments, ImportArguments, ReadingArguments, UartChoice};
use super::trace::{ShownRun, fits_bus, fits_output, show};
use crate::bus::SharedLine;
use crate::bus_name::BusName;
use crate::buses::novobus::capture::diff::{ComparedRun, diff as compare};
use crate::buses::novobus::capture::judge::{Judged, judge};
use crate::buses::novobus::capture::scenario::{JudgeOptions, scenario};
use crate::buses::{carried, carrying, named, report_of};
use crate::capture::frame_diff::frame_diff;
use crate::capture::{
    Capture, CaptureError, Carries, Imported, JudgedFrames, ReadSettings, is_capture, read_files,
};
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::play::play_entry;
use crate::counted::counted;
use crate::library::Entry;
use crate::regular;
use crate::report::pcapng::name as link_label;
use crate::scenario::files::sources;
use crate::scenario::run::AtMismatch;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How far times may be off where a log has none.
const NO_TIMES: Span = Span::from_millis(86_400_000);

/// Prints the dissector.
pub(crate) fn dissector(bus: BusName, output: &mut Output) -> std::io::Result<Exit> {
    output.result(&(named(bus).dissector)())?;
    Ok(Exit::Passed)
}

/// Prints the file that describes this number of drives: a DBC of frames on CAN, the GSD of slaves on PROFIBUS DP.
pub(crate) fn description(
    (carries, drives): (Carries, u16),
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
    if let Some(format) = arguments.format {
        let shown = ShownRun {
            title: &title,
            traces: &capture.traces,
            report: report_of(&capture.traces),
            rate: capture.rate,
            records: &[],
        };
        if !fits_output(format, &arguments.showing, output)
            || !fits_bus(format, &capture.traces, output)
        {
            return Ok(Exit::Usage);
        }
        let written = show(&shown, format, &arguments.showing, output)?;
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
    if let Some(line) = carrying(Carries::of(&capture.traces)) {
        let setup = setup.as_ref();
        return of_shared_line(line, (&imported, &title, setup), arguments, output);
    }
    if !arguments.judge.is_empty() {
        output.complain("`--judge` names slaves or drives of a line that they share; of a ring all drives are judged");
        return Ok(Exit::Usage);
    }
    let options = JudgeOptions {
        title: &title,
        setup: setup.as_ref(),
        tolerance: span(arguments.tolerance),
    };
    if arguments.scenario {
        return as_scenario(capture, &options, arguments, output);
    }
    let judged = match judge(capture, &options) {
        Ok(judged) => Judged {
            verdict: settled(judged.verdict, &imported, output),
            ..judged
        },
        Err(error) => {
            output.complain(&format!("{}: {error}", path.display()));
            return Ok(Exit::Usage);
        }
    };
    let line = format!(
        "{} {title}: {} on {} in {}\n",
        output.verdict(judged.verdict).trim_end_matches(' '),
        counted(capture.bytes(), "byte"),
        counted(
            capture
                .traces
                .iter()
                .map(|t| t.channels.len())
                .sum::<usize>(),
            "link"
        ),
        capture.end(),
    );
    output.result(&line)?;
    output.say(&damaged(capture));
    output.say(&details(&judged));
    Ok(Exit::of(&[judged.verdict], false))
}

/// Where bytes arrived damaged: it is a cable or a sender, and no drive that receives them.
fn damaged(capture: &Capture) -> String {
    let mut text = String::new();
    for (ring, trace) in capture.traces.iter().enumerate() {
        for link in &trace.channels {
            let bad = |own: &&LineByte| own.error.is_some() || own.received.is_none();
            let count = link.octets().iter().filter(bad).count();
            if count > 0 {
                // Writing to a String cannot fail.
                let _infallible = writeln!(
                    text,
                    "  note: {} damaged over {}: by the cable there, or by the sender in front of it",
                    counted(count, "byte"),
                    link_label(ring, link)
                );
            }
        }
    }
    text
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

/// A verdict on a capture of which a part may be missing; says why it is another one.
fn settled(verdict: Verdict, imported: &Imported, output: &mut Output) -> Verdict {
    let (verdict, why) = imported.settle(verdict);
    if let Some(why) = why {
        output.say(&format!("  note: {why}\n"));
    }
    verdict
}

/// Reports what came of judging a shared line.
fn told(
    judged: &JudgedFrames,
    ((count, what), end): ((usize, &str), Instant),
    title: &str,
    output: &mut Output,
) -> std::io::Result<Exit> {
    output.result(&format!(
        "{} {title}: {} in {}, {} of {} compared\n",
        output.verdict(judged.verdict).trim_end_matches(' '),
        counted(count, what),
        end,
        judged.compared,
        counted(judged.replies, "reply"),
    ))?;
    for line in &judged.differences {
        output.result(&format!("  {line}\n"))?;
    }
    for remark in &judged.remarks {
        output.say(&format!("  note: {remark}\n"));
    }
    Ok(Exit::of(&[judged.verdict], false))
}

/// Judges what a shared line carried, or makes a scenario of it.
fn of_shared_line(
    line: &SharedLine,
    (imported, title, setup): (&Imported, &str, Option<&Source>),
    arguments: &ImportArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let (path, capture) = (title, &imported.capture);
    if !arguments.scenario {
        // Times of a log are those of the bus unless the user says how far they are off; a log without times has an order alone.
        let tolerance = match (capture.timed, arguments.tolerance) {
            (false, _) => NO_TIMES,
            (true, None) => Span::ZERO,
            (true, given) => span(given),
        };
        return match (line.judged)(&capture.traces, setup, (&arguments.judge, tolerance)) {
            Ok(judged) => {
                let verdict = settled(judged.verdict, imported, output);
                let judged = JudgedFrames { verdict, ..judged };
                told(
                    &judged,
                    (line.report.counted(&capture.traces), capture.end()),
                    title,
                    output,
                )
            }
            Err(error) => {
                output.complain(&format!("{path}: {error}"));
                Ok(Exit::Usage)
            }
        };
    }
    if arguments.tolerance.is_some() {
        output.complain(
            "--tolerance changes nothing in a scenario of frames or telegrams: each is sent at its own time; leave it out",
        );
        return Ok(Exit::Usage);
    }
    if !capture.timed {
        output.complain(&format!(
            "{path}: a scenario sends at the times of the log, and it has none; log with times, as `candump -L` does"
        ));
        return Ok(Exit::Usage);
    }
    match (line.replayed)(&capture.traces, title, setup) {
        Ok(text) => write_scenario(&text, arguments, output),
        Err(error) => {
            output.complain(&format!("{path}: {error}"));
            Ok(Exit::Usage)
        }
    }
}

/// Reads the files of a capture, and says what was found and not read in them.
fn read(paths: &[PathBuf], reading: &ReadingArguments, output: &mut Output) -> Option<Imported> {
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
            let names = paths.iter().map(|own| own.display().to_string());
            let names: Vec<_> = names.collect();
            output.complain(&format!("{}: {error}", names.join(", ")));
            None
        }
    }
}

fn as_scenario(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    arguments: &ImportArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let text = match scenario(capture, options) {
        Ok(text) => text,
        Err(error) => {
            output.complain(&format!("{}: {error}", options.title));
            return Ok(Exit::Usage);
        }
    };
    write_scenario(&text, arguments, output)
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

/// What there is to say about a judgement, for people.
fn details(judged: &Judged) -> String {
    let mut text = String::new();
    if judged.adopted > 0 {
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "  note: {} taken to hold the first value that the drives reported",
            counted(judged.adopted, "cell")
        );
    }
    if judged.unforeseen > 0 {
        let _infallible = writeln!(
            text,
            "  note: {} not compared: data that changes by itself, and its checking bytes",
            counted(judged.unforeseen, "byte")
        );
    }
    for remark in &judged.remarks {
        let _infallible = writeln!(text, "  note: {remark}");
    }
    if let Some((ring, drive)) = judged.located {
        let ring = if ring == 0 { "" } else { " of ring 2" };
        let _infallible = writeln!(
            text,
            "  note: the ring spells out drive {drive}{ring}: it saw a fault first"
        );
    }
    if judged.verdict != Verdict::Passed || judged.links.differ > 0 {
        let shown = judged.links.show("capture", "model");
        let right = match judged.verdict {
            Verdict::Passed => {
                "what the master received is right; what a link between drives carried is not that of the model:\n"
            }
            _ => "",
        };
        let _infallible = write!(text, "\n{right}{shown}");
    }
    text
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
    let traces = [&left.traces[..], &right.traces[..]];
    let shown = [&names[0][..], &names[1]];
    let [one, other] = traces.map(carried);
    if one != other {
        output.complain(&format!(
            "one side has {one} and the other {other}; two of one kind expected"
        ));
        return Ok(Exit::Usage);
    }
    let tolerance = span(arguments.tolerance);
    let compared = report_of(traces[0]).and_then(|own| own.difference(traces, tolerance, shown));
    if let Some((same, text)) = compared {
        output.result(&text)?;
        return Ok(if same { Exit::Passed } else { Exit::Failed });
    }
    if Carries::of(&left.traces) == Carries::Frames {
        let summary = frame_diff(&left, &right, span(arguments.tolerance));
        output.result(&summary.show([&names[0], &names[1]]))?;
        return Ok(match summary.same() {
            true => Exit::Passed,
            false => Exit::Failed,
        });
    }
    let summary = compare(
        ComparedRun {
            name: &names[0],
            capture: &left,
        },
        ComparedRun {
            name: &names[1],
            capture: &right,
        },
        span(arguments.tolerance),
    );
    output.result(&summary.show(&names[0], &names[1]).to_string())?;
    Ok(if summary.same() {
        Exit::Passed
    } else {
        Exit::Failed
    })
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
        return read.map(|own| own.capture);
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
    let rate = entry.plan.as_ref().map(|plan| plan.rate);
    Some(Capture {
        rate: rate.unwrap_or_default(),
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

fn span(tolerance: Option<Duration>) -> Span {
    // Times of a capture are cut off to nanoseconds.
    let nanos = tolerance.map_or(2, |time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    Span::from_nanos(nanos)
}
