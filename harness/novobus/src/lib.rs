//! NOVOBUS: what the bench knows of this bus alone (ND21 8 to 11).
#![forbid(unsafe_code)]

mod calm;
mod campaign;
mod capture;
mod choice;
mod cli;
mod driver;
mod drives;
mod embed;
mod explore;
mod gate;
mod guard;
mod language;
mod link;
mod locate;
mod manual;
mod qualify;
mod report;
mod rig;
mod section;
mod serve;
mod simulate;
mod stream;
#[cfg(test)]
mod tests;
mod top;
mod twin;

use harness_bench::bus::Bus;
use harness_bench::bus_name::BusName;
use harness_bench::capture::{Carries, ends};
use harness_bench::fuzz::comes_back;
use harness_bench::scenario::settled;
use harness_proto::line::Rate;
use harness_sim::novobus::fuzz;

/// NOVOBUS.
pub static BUS: Bus = Bus {
    name: BusName::Novobus,
    manual: manual::MANUAL,
    carries: Carries::Link,
    example: "9.8-check-sequence",
    settle: settled::settle::<language::Novobus>,
    comes_back: comes_back::<language::Novobus>,
    cell_names: || cli::cells::names().map(str::to_owned).collect(),
    cells: cli::cells::cells,
    deviations: cli::deviations::rows,
    dissector: || report::DISSECTOR.to_owned(),
    sim: cli::sim::rings,
    simulates: &link::SimulatedLink::CAPABILITIES,
    live: |place, drives| {
        let (_, from, to) = ends(&place.name).unwrap_or_default();
        let rate = Rate::from_bits_per_second(place.bits_per_second).unwrap_or_default();
        Box::new(report::live::LinkText::new(from, to, rate, drives))
    },
    report: &report::ring::RingReport,
    judged: capture::told::judged,
    replayed: capture::told::replayed,
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(cli::COMMANDS),
    rings: Some(rig::RINGS),
    shared: None,
    campaigns: campaign::find::names,
    campaign: campaign::find::found,
    embedding: Some(embed::EMBEDDING),
};
