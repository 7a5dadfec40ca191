//! `drivebench watch` on NORDAC inverters: process words and parameters, again and again.

use super::bench::{Master, driver};
use super::read::{Found, find};
use crate::rig::Inverters;
use crate::value::{Cell, cells};
use harness_bench::command::drive::WatchArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{WatchBench, WatchedCell, watch as show};
use harness_proto::time::{Instant, Span};

/// Shows values, a line each time.
pub(super) fn watch(
    bench: PortBench<'_, Inverters>,
    arguments: &WatchArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells).map_err(Failure::refused)?;
    let as_what = Use::look("watch");
    show(arguments, output, |readings, output| {
        on(bench, &arguments.rig, as_what, output, |session, output| {
            let slaves = select(std::slice::from_ref(&arguments.drives), session)?;
            let mut driver = driver(session);
            for slave in &slaves {
                driver.join(*slave)?;
            }
            let mut watched = WatchedSlaves {
                driver,
                slaves: &slaves,
                cells: &cells,
            };
            readings.show(&mut watched, output)
        })
    })
}

struct WatchedSlaves<'a> {
    driver: Master<'a>,
    slaves: &'a [u8],
    cells: &'a [Cell],
}

impl WatchBench for WatchedSlaves<'_> {
    const DRIVE: &'static str = "slave";

    fn now(&mut self) -> Instant {
        self.driver.now()
    }

    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure> {
        let mut found = Vec::new();
        for slave in self.slaves {
            found.extend(find(&mut self.driver, *slave, self.cells)?);
        }
        Ok(found.iter().map(watched_cell).collect())
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        Ok(self.driver.run(time)?)
    }
}

fn watched_cell(found: &Found) -> WatchedCell {
    let words = found.words();
    let (digits, unit) = found.digits();
    WatchedCell {
        drive: found.slave.to_string(),
        name: found.cell.name(),
        words: match words.is_empty() {
            true => found.raw(),
            false => words,
        },
        digits,
        unit,
    }
}
