//! NORDAC *vector* inverters on PROFIBUS DP: their words in a scenario, simulated slaves, tables and pictures.
#![forbid(unsafe_code)]

mod campaign;
mod capture;
#[cfg(test)]
mod captured_levels_tests;
#[cfg(test)]
mod captured_tests;
mod cli;
mod deviations;
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
use harness_bench::campaign::line::LineCampaign;
use harness_bench::capture::Carries;
use harness_bench::scenario::settled;
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
    cell_names: || cli::cells::names().collect(),
    cells: cli::cells::cells,
    deviations: deviations::rows,
    dissector: dissector::dissector,
    sim: |arguments, _, output| cli::sim::sim(arguments, output),
    live: |_, _| Box::<report::live::TelegramText>::default(),
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(rig::COMMANDS),
    shared: Some(SharedLine {
        port: &rig::PORT,
        report: &report::TelegramReport,
        description: |_| GSD.to_owned(),
        replayed: capture::scenario,
        judged: capture::judged,
        campaigns: campaign::names,
        campaign: |name| {
            Some(campaign::find(name)?.map(|own| -> Box<dyn LineCampaign> { Box::new(own) }))
        },
    }),
};

/// The buses of a rig's file in tests.
#[cfg(test)]
static BUSES: harness_bench::rig::buses::RigBuses =
    harness_bench::rig::buses::RigBuses::alone(&rig::PORT);
