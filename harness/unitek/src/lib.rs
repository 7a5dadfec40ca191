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
use harness_bench::campaign::line::LineCampaign;
use harness_bench::capture::Carries;
use harness_bench::scenario::settled;
use harness_sim::unitek::fuzz;

/// UNITEK DS/BAMOCAR on CAN.
pub static BUS: Bus = Bus {
    name: BusName::Unitek,
    manual: manual::MANUAL,
    carries: Carries::Frames,
    example: "unitek-ex-11-speed-routine",
    settle: settled::settle::<language::Unitek>,
    cell_names: || cli::cells::names().map(str::to_owned).collect(),
    cells: cli::cells::cells,
    deviations: cli::deviations::rows,
    dissector: dissector::dissector,
    sim: |arguments, _, output| cli::sim::sim(arguments, output),
    live: |_, _| Box::new(report::table::FrameText),
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(rig::COMMANDS),
    shared: Some(SharedLine {
        port: &rig::PORT,
        report: &report::FrameReport,
        description: dbc::dbc,
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
