//! NOVOBUS: what the bench knows of this bus alone (ND21 8 to 11).
#![forbid(unsafe_code)]

pub(crate) mod calm;
pub mod campaign;
pub mod capture;
pub(crate) mod choice;
pub(crate) mod cli;
pub mod driver;
pub mod drives;
pub mod explore;
pub mod gate;
pub mod guard;
pub mod language;
pub mod link;
pub(crate) mod locate;
pub(crate) mod manual;
pub mod qualify;
pub mod report;
pub mod rig;
pub(crate) mod section;
pub mod serve;
pub mod simulate;
pub mod stream;
pub mod top;
pub mod twin;

use harness_bench::bus::Bus;
use harness_bench::bus_name::BusName;
use harness_bench::capture::{Carries, ends};
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
    cell_names: || cli::cells::names().map(str::to_owned).collect(),
    cells: cli::cells::cells,
    deviations: cli::deviations::rows,
    dissector: || report::DISSECTOR.to_owned(),
    sim: cli::sim::rings,
    live: |place, drives| {
        let (_, from, to) = ends(&place.name).unwrap_or_default();
        let rate = Rate::from_bits_per_second(place.bits_per_second).unwrap_or_default();
        Box::new(report::live::LinkText::new(from, to, rate, drives))
    },
    fuzz: (&fuzz::TARGETS, &fuzz::NOTING),
    rigs: Some(cli::COMMANDS),
    shared: None,
};
