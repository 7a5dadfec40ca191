//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.
#![forbid(unsafe_code)]

mod campaign;
mod capture;
mod cli;
mod dbc;
mod dissector;
mod driver;
mod explore;
mod gate;
mod judge;
mod language;
mod live;
mod manual;
mod report;
mod rig;
mod safe_state;
mod serve;
#[cfg(test)]
mod serve_tests;
mod simulate;
mod value;
mod whereabouts;

use harness_bench::bus::{Bus, SharedLine};
use harness_bench::bus_name::BusName;
use harness_bench::campaign::line;
use harness_bench::capture::{Carries, judged_frames, replayed_frames};
use harness_bench::command::deviations::DeviationRow;
use harness_bench::fuzz::comes_back;
use harness_bench::scenario::settled;
use harness_bench::shown::SegmentReport as _;
use harness_sim::unitek::deviation::{DEVIATIONS, MASTER_DEVIATIONS};
use harness_sim::unitek::fuzz;

/// UNITEK DS/BAMOCAR on CAN.
pub static BUS: Bus = Bus {
    name: BusName::Unitek,
    manual: manual::MANUAL,
    carries: Carries::Frames,
    example: "unitek-ex-11-speed-routine",
    settle: settled::settle::<language::Unitek>,
    comes_back: comes_back::<language::Unitek>,
    cell_names: || cli::cells::names().map(str::to_owned).collect(),
    cells: cli::cells::cells,
    deviations: || {
        [
            DeviationRow::all(&DEVIATIONS),
            DeviationRow::all(&MASTER_DEVIATIONS),
        ]
    },
    dissector: dissector::dissector,
    sim: |arguments, _, output| cli::sim::sim(arguments, output),
    simulates: &simulate::Bench::CAPABILITIES,
    live: |_, _| Box::new(report::table::FrameText),
    report: &report::FrameReport,
    judged: |capture, options| {
        let (count, what) = report::FrameReport.counted(&capture.traces);
        judged_frames(capture::judged, count, what, capture, options)
    },
    replayed: |capture, options| replayed_frames(capture::scenario, capture, options),
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(rig::COMMANDS),
    campaigns: line::line_names::<campaign::Frames>,
    campaign: line::found::<campaign::Frames>,
    embedding: None,
    rings: None,
    shared: Some(SharedLine {
        port: &rig::PORT,
        description: dbc::dbc,
    }),
};

/// The buses of a rig's file in tests.
#[cfg(test)]
static BUSES: harness_bench::rig::buses::RigBuses =
    harness_bench::rig::buses::RigBuses::alone(&rig::PORT);
