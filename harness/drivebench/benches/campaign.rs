//! How long a case of a campaign takes: a ring is disturbed, read, repaired and compared.
//!
//! `shared` plays cases as a campaign does: they share what they have in common. `alone` is the baseline: the scenario of each case, on a ring
//! of its own.

use divan::counter::ItemsCount;
use harness::buses::novobus::BUS;
use harness::campaign::Campaign;
use harness::library::Entry;
use harness::scenario::run::AtMismatch;
use harness::scenario::source::Source;
use std::path::Path;

const CAMPAIGNS: [&str; 3] = [
    "9.6-single-bits",
    "9.7-single-bits",
    "9.8-driver-single-bits",
];

/// Step between the cases that are played, so that links and bytes of all kinds are among them.
const STRIDE: usize = 97;

/// How many are played.
const CASES: usize = 32;

fn main() {
    divan::main();
}

fn load(name: &str) -> Box<dyn Campaign> {
    let found = (BUS.campaign)(Path::new(name)).expect("a built-in campaign");
    let mut campaign = found.expect("a campaign");
    campaign.keep(&|place| place.is_multiple_of(STRIDE) && place / STRIDE < CASES);
    campaign
}

#[divan::bench(args = CAMPAIGNS)]
fn shared(bencher: divan::Bencher<'_, '_>, name: &str) {
    let campaign = load(name);
    bencher
        .counter(ItemsCount::new(campaign.cases()))
        .bench_local(|| campaign.run(1, &|_| {}).map(|played| played.cases()));
}

#[divan::bench(args = CAMPAIGNS[..2].iter())]
fn alone(bencher: divan::Bencher<'_, '_>, name: &str) {
    let campaign = load(name);
    let entries = campaign.names().into_iter().map(|case| {
        let text = campaign.scenario(&case).expect("a case");
        let source = Source::from_bytes(case, text.into_bytes()).expect("a text");
        Entry::new(source, None).expect("a scenario")
    });
    let entries: Vec<_> = entries.collect();
    bencher
        .counter(ItemsCount::new(entries.len()))
        .bench_local(|| {
            for entry in &entries {
                let mut link = entry.settled.simulate();
                entry.settled.play(&mut *link, AtMismatch::GoOn);
            }
        });
}
