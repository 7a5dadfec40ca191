//! A bus in a few hundred lines: valves on frames. It is the example of the page "A fourth bus" in CONTRIBUTING.md, and no part of the program.
//! The tests in `harness/drivebench/src/cli/toy_tests.rs` take it from the text of a scenario to the table and the page of HTML.
//!
//! | file | what it has | trait |
//! |---|---|---|
//! | `valve.rs` | what a frame says; the simulated device, with one deviation | `Station` |
//! | `bench.rs` | the bus as a scenario sees it | `Line`, `Link` |
//! | `language.rs` | the words of a scenario | `Language`, `Settle` |
//! | `report.rs` | the table, and text while a frame arrives | `SegmentReport`, `LiveText` |
//! | `lib.rs` | what the program asks of a bus | `Bus` |
#![forbid(unsafe_code)]

mod bench;
mod language;
mod report;
mod valve;

use harness_bench::bus::Bus;
use harness_bench::bus_name::BusName;
use harness_bench::capture::Carries;
use harness_bench::command::deviations::DeviationRow;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::fuzz::comes_back;
use harness_bench::manual::Manual;
use harness_bench::scenario::settled::settle;
use harness_sim::deviation::Deviation;

/// Valves. What the bus does not have yet answers with a sentence that says so.
pub static BUS: Bus = Bus {
    // A bus of the product has a name of its own in `harness/bench/src/bus_name.rs`.
    name: BusName::DEFAULT,
    manual: Manual {
        bus: BusName::DEFAULT,
        title: "Valves",
        document: "valves",
        tables: "table = []\n",
        errata: "erratum = []\n",
        open: Vec::new,
    },
    carries: Carries::Frames,
    example: "a-valve-opens",
    settle: settle::<language::Valves>,
    comes_back: comes_back::<language::Valves>,
    cell_names: Vec::new,
    cells: |_, output| {
        output.complain("a valve holds nothing but its place; `? valve 1 at 50` looks at it");
        Ok(Exit::NothingSelected)
    },
    deviations: || {
        let about = "the valve confirms a move and stays where it is";
        let sticks = DeviationRow::of(&Deviation::new("sticks", "2.1", about, ()));
        [vec![sticks], Vec::new()]
    },
    dissector: || "-- there is no dissector of valves yet\n".to_owned(),
    sim: |_, _, _| Err(Failure::refused("valves are not served yet")),
    simulates: &[],
    live: |_, _| Box::new(report::ValveText),
    report: &report::ValveReport,
    judged: |_, _| Err("captures of valves are not judged".to_owned()),
    replayed: |_, _| Err("captures of valves are not replayed".to_owned()),
    fuzz: (&[], &[]),
    rigs: None,
    rings: None,
    shared: None,
    campaigns: Vec::new,
    campaign: |_| None,
    embedding: None,
};
