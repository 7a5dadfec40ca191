//! `drivebench watch` on NORDAC inverters: process words and parameters, again and again.

use super::bench::driver;
use super::read::{Found, find};
use crate::buses::commands::{MOST_LINES, Use, WatchArguments, WatchForm};
use crate::buses::nordac::rig::Session;
use crate::buses::nordac::value::{Cell, cells};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::port_bench::{on, select};
use crate::rig::Rig;
use harness_proto::time::Span;

/// Shows values, a line each time.
pub(super) fn watch(
    rig: &Rig,
    arguments: &WatchArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells).map_err(Failure::refused)?;
    if arguments.every == Span::ZERO
        || arguments.length.units() / arguments.every.units() > MOST_LINES
    {
        return Err(Failure::refused(format!(
            "--every must be longer than nothing, and --for at most {MOST_LINES} times as long"
        )));
    }
    let as_what = Use::look("watch");
    on(rig, &arguments.rig, as_what, output, |session, output| {
        show(arguments, &cells, session, output)
    })
}

fn show(
    arguments: &WatchArguments,
    cells: &[Cell],
    session: &mut Session,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let slaves = select(std::slice::from_ref(&arguments.drives), session)?;
    let again = arguments.format == WatchForm::Text && output.full_screen;
    let mut driver = driver(session);
    for slave in &slaves {
        driver.start(*slave, None)?;
    }
    let start = driver.now();
    let end = start + arguments.length;
    let mut next = start;
    let mut headed = false;
    loop {
        let at = driver.now().since(start);
        let mut found = Vec::new();
        for slave in &slaves {
            found.extend(find(&mut driver, *slave, cells)?);
        }
        let line = match arguments.format {
            WatchForm::Text => line(at, &found),
            WatchForm::Csv => {
                if !headed {
                    output.result(&heading(&found))?;
                    headed = true;
                }
                row(at, &found)
            }
        };
        match again {
            true => output.result(&format!("\r\x1b[K{line}"))?,
            false => output.result(&format!("{line}\n"))?,
        }
        let now = driver.now();
        // If reading takes longer than the given period, it is repeated as often as possible.
        next = (next + arguments.every).max(now);
        if next > end {
            break;
        }
        driver.run(next.since(now))?;
    }
    if again {
        output.result("\n")?;
    }
    Ok(Exit::Passed)
}

/// Time, and of each slave the names and values.
fn line(at: Span, found: &[Found]) -> String {
    let mut line = format!("{:>12}", at.to_string());
    let mut slave = None;
    for found in found {
        if slave != Some(found.slave) {
            slave = Some(found.slave);
            line.push_str(&format!("  slave {}", found.slave));
        }
        let (name, words) = (found.cell.name(), found.words());
        match words.is_empty() {
            true => line.push_str(&format!("  {name} {}", found.number)),
            false => line.push_str(&format!("  {name} {words}")),
        }
    }
    line
}

fn heading(found: &[Found]) -> String {
    let columns = found
        .iter()
        .map(|own| format!(",{} {}", own.slave, own.cell.name()));
    format!("time_ms{}\n", columns.collect::<String>())
}

/// Time and raw numbers.
fn row(at: Span, found: &[Found]) -> String {
    let columns = found.iter().map(|own| format!(",{}", own.number));
    format!("{:.3}{}", at.as_millis_f64(), columns.collect::<String>())
}
