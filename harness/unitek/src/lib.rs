//! UNITEK DS/BAMOCAR on CAN: what the bench knows of this bus alone.
#![forbid(unsafe_code)]

pub mod campaign;
pub mod capture;
pub mod cli;
pub mod dbc;
pub mod dissector;
pub mod driver;
pub mod explore;
pub mod gate;
pub mod judge;
pub mod language;
mod live;
pub mod manual;
pub mod report;
pub mod rig;
pub mod safe_state;
pub mod serve;
#[cfg(test)]
mod serve_tests;
pub mod simulate;
pub mod value;
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
    shared: Some(SharedLine {
        port: &rig::PORT,
        commands: rig::COMMANDS,
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
