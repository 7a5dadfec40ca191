//! `drivebench watch` on UNITEK drives: the values of registers, again and again.

use super::read::{Found, find};
use crate::buses::commands::{MOST_LINES, Use, WatchArguments, WatchForm};
use crate::buses::unitek::rig::{Axis, Session};
use crate::buses::unitek::value::{hex, registers};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::port_bench::{on, select};
use crate::rig::Rig;
use harness_proto::time::Span;
use harness_proto::unitek::Register;

/// Shows values, a line each time.
pub(super) fn watch(
    rig: &Rig,
    arguments: &WatchArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let registers = registers(&arguments.cells).map_err(Failure::refused)?;
    if arguments.every == Span::ZERO
        || arguments.length.units() / arguments.every.units() > MOST_LINES
    {
        return Err(Failure::refused(format!(
            "--every must be longer than nothing, and --for at most {MOST_LINES} times as long"
        )));
    }
    on(
        rig,
        &arguments.rig,
        Use::look("watch"),
        output,
        |session, output| show(arguments, &registers, session, output),
    )
}

fn show(
    arguments: &WatchArguments,
    registers: &[&'static Register],
    session: &mut Session,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let drives = select(std::slice::from_ref(&arguments.drives), session)?;
    let again = arguments.format == WatchForm::Text && output.full_screen;
    if arguments.format == WatchForm::Csv {
        output.result(&heading(&drives, registers))?;
    }
    let start = session.driver().now();
    let end = start + arguments.length;
    let mut next = start;
    loop {
        let at = session.driver().now().since(start);
        let found = find(session, &drives, registers)?;
        let line = match arguments.format {
            WatchForm::Text => line(at, &found),
            WatchForm::Csv => row(at, &found),
        };
        match again {
            true => output.result(&format!("\r\x1b[K{line}"))?,
            false => output.result(&format!("{line}\n"))?,
        }
        let now = session.driver().now();
        // If reading takes longer than the given period, it is repeated as often as possible.
        next = (next + arguments.every).max(now);
        if next > end {
            break;
        }
        session.driver().run(next.since(now))?;
    }
    if again {
        output.result("\n")?;
    }
    Ok(Exit::Passed)
}

/// Time, and of each drive the names and values.
fn line(at: Span, found: &[Found]) -> String {
    let mut line = format!("{:>12}", at.to_string());
    let mut axis = None;
    for found in found {
        if axis != Some(found.axis) {
            axis = Some(found.axis);
            line.push_str(&format!("  drive {}", found.axis.node));
        }
        let words = found.words();
        let value = if words.is_empty() {
            hex(found.reply.data)
        } else {
            words
        };
        line.push_str(&format!("  {} {value}", found.register().name));
    }
    line
}

fn heading(drives: &[Axis], registers: &[&'static Register]) -> String {
    let mut line = "time_ms".to_owned();
    for axis in drives {
        for register in registers {
            line.push_str(&format!(",{} {}", axis.node, register.name));
        }
    }
    line + "\n"
}

/// Time and raw numbers.
fn row(at: Span, found: &[Found]) -> String {
    let mut line = format!("{:.3}", at.as_millis_f64());
    for found in found {
        line.push_str(&format!(",{}", found.reply.number()));
    }
    line
}
