//! `drivebench watch` on a ring: the values of cells, again and again.

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::Axis;
use crate::driver::cell::find;
use crate::language::argument::{MemoryRange, cells};
use harness_bench::command::drive::WatchArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::reading::CellReading as _;
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{WatchBench, WatchedCell, watch as show};
use harness_bench::counted::counted;
use harness_proto::nd21::units::DriveUnits;
use harness_proto::time::{Instant, Span};

/// Shows values, a line each time.
pub(crate) fn watch(arguments: &WatchArguments, output: &mut Output) -> Result<Exit, Failure> {
    let cells = cells(&arguments.cells)?;
    let look = Use::look("watch");
    show(arguments, output, |readings, output| {
        rig::on(&arguments.rig, look, output, |bench, output| {
            let axes = axes::select(std::slice::from_ref(&arguments.drives), &bench.bus.axes())?;
            let drives = axes
                .into_iter()
                .map(|axis| Ok((axis, bench.units(axis)?)))
                .collect::<Result<Vec<_>, Failure>>()?;
            let mut watched = WatchedCells {
                bench,
                drives: &drives,
                cells: &cells,
            };
            let ended = readings.show(&mut watched, output);
            match bench.bus.corrected_errors() {
                0 => {}
                errors => output.say(&format!(
                    "{} on the bus corrected (ND21 11.5)\n",
                    counted(errors, "error")
                )),
            }
            ended
        })
    })
}

struct WatchedCells<'a> {
    bench: &'a OpenBench,
    drives: &'a [(Axis, DriveUnits)],
    cells: &'a [MemoryRange],
}

impl WatchBench for WatchedCells<'_> {
    const DRIVE: &'static str = "drive";

    fn now(&mut self) -> Instant {
        self.bench.bus.now()
    }

    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure> {
        let mut found = Vec::new();
        for drive in self.drives {
            for cell in self.cells {
                found.push(find(&self.bench.bus, *drive, cell)?.watched());
            }
        }
        self.bench.bus.keep();
        Ok(found)
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        self.bench.bus.run(time);
        Ok(())
    }
}
