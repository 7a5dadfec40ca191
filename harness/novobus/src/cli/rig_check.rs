//! `drivebench rig check`: a bench is opened, its drives are counted and read, its line is measured.

use crate::driver::{Error, SpelledOut, SpellingCause};
use crate::rig::figures::{Figures, RingFigures, WrongParity, measure};
use crate::rig::session;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::{Failure, exit_of_trouble};
use harness_bench::command::output::Output;
use harness_bench::command::progress::progress_bar;
use harness_bench::command::rig_commands::unusable;
use harness_bench::command::rig_failure::tell_end;
use harness_bench::counted::counted;
use harness_bench::rig::{Rig, UseOptions};
use harness_proto::time::Span;
use serde_json::json;
use std::fmt::Write as _;

/// Opens a bench and says what it shows.
pub(crate) fn check(
    rig: &Rig,
    options: &UseOptions,
    for_tools: bool,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let session = session::open(rig, options).map_err(unusable)?;
    let all = rig.rings().map(|(_, ring)| usize::from(ring.drives)).sum();
    let bar = progress_bar(all, output.progress);
    let measured = measure(session, &mut |axis| {
        bar.set_message(format!("drive {axis}"));
        bar.inc(1);
    });
    bar.finish_and_clear();
    let (measured, end) = measured;
    let ended = |exit, output: &mut Output| match &end {
        Some(end) => tell_end(end, exit, output),
        None => exit,
    };
    let figures = match measured {
        Ok(figures) => figures,
        Err(error) => {
            output.complain(&format!("failed to read the drives: {error}"));
            let exit = match &error {
                Error::Link(trouble) => exit_of_trouble(trouble),
                _ => Exit::RigError,
            };
            return Ok(ended(exit, output));
        }
    };
    let text = match for_tools {
        false => text(rig, &figures),
        true => format!("{:#}\n", object(rig, &figures)),
    };
    let mut exit = match output.result(&text) {
        Ok(()) => Exit::Passed,
        Err(error) => output.unwritable(&error),
    };
    for ring in figures.rings.iter().filter(|ring| ring.lost > 0) {
        output.complain(&format!(
            "{} of {} telegrams to no drive did not come back as they must (ND21 9.3)",
            ring.lost,
            ring.lost + ring.rounds.len()
        ));
        exit = Exit::RigError;
    }
    for drive in &figures.drives {
        if let Some(contradiction) = &drive.contradiction {
            output.complain(&format!("drive {}: {contradiction}", drive.axis));
            exit = Exit::RigError;
        }
    }
    Ok(ended(exit, output))
}

fn ms(span: Span) -> String {
    format!("{:.3}", span.as_millis_f64())
}

fn text(rig: &Rig, figures: &Figures) -> String {
    let mut text = String::new();
    for ((number, ring), found) in rig.rings().zip(&figures.rings) {
        let drives = found.size.drives();
        let port = ring.endpoint.port.as_ref();
        let port = port.map_or(String::new(), |port| format!(" {port}"));
        // Writing to a String cannot fail.
        let _infallible = writeln!(
            text,
            "ring {number} ({}{port}, {} baud 8O1): {}",
            ring.endpoint.transport.name(),
            ring.endpoint.line.baud(),
            counted(drives, "drive")
        );
        let _infallible = writeln!(text, "  {}", line_of(found));
        let _infallible = writeln!(
            text,
            "  rate test: SYNCO without a gap comes back at {} bit/s{}",
            found.rate.bits_per_second(),
            late_of(found)
        );
        if let Some(own) = found.wrong_parity {
            let port = ring.endpoint.port.as_deref().unwrap_or("the port");
            let noticed = "a byte sent with a wrong parity bit was noticed".to_owned();
            let line = own.obstacle(port).unwrap_or(noticed);
            let _infallible = writeln!(text, "  {line}");
        }
    }
    for (ring, SpelledOut { drive, why }) in &figures.reported {
        let cause = match why {
            SpellingCause::FaultOrSilence => {
                "a fault in front of it, or no byte for 10 ms, before the check (ND21 9.7, 9.9)"
            }
            SpellingCause::Fault | SpellingCause::MissedMaster => {
                "a fault in front of it before the check (ND21 9.7)"
            }
        };
        let _infallible = writeln!(
            text,
            "ring {}: drive {drive} had spelled out its address: {cause}",
            ring + 1
        );
    }
    let corrected = figures.corrected;
    let _infallible = writeln!(text, "errors corrected while drives were read: {corrected}");
    for drive in &figures.drives {
        let serial = drive.identity.serial_number;
        let serial = serial.map_or("no serial number".to_owned(), |n| format!("serial {n:06}"));
        let error = drive.state.error_in_words();
        let _infallible = writeln!(
            text,
            "drive {}: {serial}, EE_Version {:02X}, {} h, in {}{}",
            drive.axis,
            drive.identity.ee_version,
            drive.identity.hours.0,
            drive.state.mode(),
            error.map_or(String::new(), |error| format!(", {error}"))
        );
    }
    text
}

fn late_of(ring: &RingFigures) -> String {
    ring.late.map_or(String::new(), |late| {
        format!(", and the last one of 256 came {} ms late", ms(late))
    })
}

fn line_of(ring: &RingFigures) -> String {
    let nominal = ms(ring.nominal);
    let errors = ring.line_errors;
    match ring.spread() {
        None => {
            format!("nothing came round, {nominal} ms by the rule of 8.2; {errors} line errors")
        }
        Some([least, middle, most]) => format!(
            "a byte takes {nominal} ms round the ring (ND21 8.2); measured {} to {}, {} in the middle; {errors} line errors",
            ms(least),
            ms(most),
            ms(middle)
        ),
    }
}

fn object(rig: &Rig, figures: &Figures) -> serde_json::Value {
    let rings: Vec<_> = figures
        .rings
        .iter()
        .map(|ring| {
            let spread = ring.spread().map(|spread| spread.map(Span::as_millis_f64));
            json!({
                "drives": ring.size.drives(),
                "rate": ring.rate.bits_per_second(),
                "late_ms": ring.late.map(Span::as_millis_f64),
                "nominal_ms": ring.nominal.as_millis_f64(),
                "least_ms": spread.map(|spread| spread[0]),
                "middle_ms": spread.map(|spread| spread[1]),
                "most_ms": spread.map(|spread| spread[2]),
                "lost": ring.lost,
                "line_errors": ring.line_errors,
                "wrong_parity": ring.wrong_parity.map(|found| found == WrongParity::Noticed),
            })
        })
        .collect();
    let drives: Vec<_> = figures
        .drives
        .iter()
        .map(|drive| {
            json!({
                "axis": drive.axis.to_string(),
                "serial_number": drive.identity.serial_number,
                "ee_version": format!("{:02X}", drive.identity.ee_version),
                "hours": drive.identity.hours.0,
                "mode": drive.state.mode(),
                "error": drive.state.error_in_words(),
                "contradiction": drive.contradiction,
            })
        })
        .collect();
    json!({
        "schema": 1, "rig": rig.id(), "rings": rings, "corrected": figures.corrected, "drives": drives,
    })
}
