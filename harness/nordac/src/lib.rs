//! NORDAC *vector* inverters on PROFIBUS DP: their words in a scenario, simulated slaves, tables and pictures.
#![forbid(unsafe_code)]

mod campaign;
mod capture;
#[cfg(test)]
mod captured_levels_tests;
#[cfg(test)]
mod captured_tests;
mod cli;
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
mod stream;
mod value;

use harness_bench::bus::{Bus, SharedLine};
use harness_bench::bus_name::BusName;
use harness_bench::campaign::line;
use harness_bench::capture::{Carries, judged_frames, replayed_frames};
use harness_bench::command::deviations::DeviationRow;
use harness_bench::fuzz::comes_back;
use harness_bench::scenario::settled;
use harness_bench::shown::SegmentReport as _;
use harness_sim::nordac::deviation::{DEVIATIONS, MASTER_DEVIATIONS};
use harness_sim::nordac::fuzz;

/// The GSD file: the unit master file of the manual.
const GSD: &str = include_str!("nordac.gsd");

/// NORDAC *vector* on PROFIBUS DP.
pub static BUS: Bus = Bus {
    name: BusName::Nordac,
    manual: manual::MANUAL,
    carries: Carries::Line,
    example: "nordac-3.3-start-up",
    settle: settled::settle::<language::Nordac>,
    comes_back: comes_back::<language::Nordac>,
    cell_names: || cli::cells::names().collect(),
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
    live: |_, _| Box::<report::live::TelegramText>::default(),
    report: &report::TelegramReport,
    judged: |capture, options| {
        let (count, what) = report::TelegramReport.counted(&capture.traces);
        judged_frames(capture::judged, count, what, capture, options)
    },
    replayed: |capture, options| replayed_frames(capture::scenario, capture, options),
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(rig::COMMANDS),
    campaigns: line::line_names::<campaign::Telegrams>,
    campaign: line::found::<campaign::Telegrams>,
    embedding: None,
    rings: None,
    shared: Some(SharedLine {
        port: &rig::PORT,
        description: |_| GSD.to_owned(),
    }),
};

/// The buses of a rig's file in tests.
#[cfg(test)]
static BUSES: harness_bench::rig::buses::RigBuses =
    harness_bench::rig::buses::RigBuses::alone(&rig::PORT);
