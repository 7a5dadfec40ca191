//! Scenarios over sockets and pseudo terminals against rings that another process serves: the same files, the
//! same verdicts as on the simulator.

mod ring;

use harness::library::{Entry, sources};
use harness::link::StreamLink;
use harness::port::{PortSettings, open};
use harness::scenario::run::{AtFinding, Outcome, play_over_bus};
use harness::scenario::verdict::Verdict;
use harness_proto::line::Rate;
use harness_sim::drive::Model;
use ring::Served;
use std::collections::BTreeMap;
use std::sync::Arc;

fn link(served: &Served) -> StreamLink {
    let wires = served
        .endpoints
        .iter()
        .zip(&served.sizes)
        .map(|(endpoint, size)| {
            let settings = PortSettings {
                endpoint: endpoint.clone(),
                rate: Rate::default(),
                marks: served.marks,
                low_latency: false,
            };
            let wire = open(&settings).unwrap_or_else(|error| panic!("{endpoint}: {error}"));
            (wire, *size)
        });
    StreamLink::new(wires.collect(), Vec::new(), Rate::default(), Arc::default())
}

fn play_on(link: &mut StreamLink, entry: &Entry) -> Outcome {
    let plan = entry.plan.as_ref().expect("novobus");
    play_over_bus(plan, link, AtFinding::Stop)
}

/// Every built-in scenario, by its model and the sizes of its rings.
fn by_rings() -> BTreeMap<(&'static str, Vec<u8>), Vec<Entry>> {
    let mut all: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for source in sources(&[]).expect("the built-in scenarios") {
        let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
        let plan = entry.plan.as_ref().expect("novobus");
        if plan.rate == Rate::default() {
            let sizes = plan.rings.iter().map(|ring| ring.drives()).collect();
            let model = if plan.model(0, 0) == Model::Plain {
                "plain"
            } else {
                "nd21"
            };
            all.entry((model, sizes)).or_default().push(entry);
        }
    }
    all
}

fn all_that_fit(transport: &str, marks: bool) {
    let mut verdicts: BTreeMap<Verdict, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for ((model, sizes), entries) in by_rings() {
        let served = Served::start(model, &sizes, transport, marks, &[]);
        let mut link = link(&served);
        for entry in entries {
            let started = std::time::Instant::now();
            let outcome = play_on(&mut link, &entry);
            *verdicts.entry(outcome.verdict).or_default() += 1;
            if outcome.verdict != Verdict::Skipped {
                eprintln!(
                    "{:?} {} {:?}",
                    outcome.verdict,
                    entry.name,
                    started.elapsed()
                );
            }
            if !matches!(outcome.verdict, Verdict::Passed | Verdict::Skipped) {
                wrong.push(format!(
                    "{}: {:?} {:?}",
                    entry.name, outcome.verdict, outcome.finding
                ));
            }
        }
    }
    eprintln!("{verdicts:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn over_a_socket_with_marks() {
    all_that_fit("tcp", true);
}
