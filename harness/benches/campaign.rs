//! How long a case of a campaign takes: a ring is disturbed, read, repaired and compared.
//!
//! `cases` plays each case on a copy of the ring, from the start. `ring` is the baseline: the same ring is copied and carries the same
//! bytes, without a check. `shared` plays the same cases as a campaign does: they share what they have in common.

use divan::counter::ItemsCount;
use harness::buses::novobus::campaign::find::find;
use harness::buses::novobus::campaign::{Campaign, CaseFaults};
use harness::buses::novobus::simulate::bench;
use harness::link::Octets;
use std::path::Path;

const CAMPAIGNS: [&str; 3] = [
    "9.6-single-bits",
    "9.7-single-bits",
    "9.8-driver-single-bits",
];

/// Step between the cases that are played, so that links and bytes of all kinds are among them.
const STRIDE: usize = 97;

fn main() {
    divan::main();
}

fn load(name: &str) -> (Campaign, Vec<CaseFaults>) {
    let campaign = find(Path::new(name)).expect("a built-in campaign");
    let cases = campaign.cases.iter().step_by(STRIDE).take(32);
    let cases = cases.copied().collect();
    (campaign, cases)
}

#[divan::bench(args = CAMPAIGNS)]
fn cases(bencher: divan::Bencher<'_, '_>, name: &str) {
    let (campaign, cases) = load(name);
    bencher
        .counter(ItemsCount::new(cases.len()))
        .bench_local(|| {
            let classes = cases.iter().map(|case| campaign.play(case));
            classes.filter(Result::is_ok).count()
        });
}

#[divan::bench(args = CAMPAIGNS)]
fn shared(bencher: divan::Bencher<'_, '_>, name: &str) {
    let (campaign, cases) = load(name);
    bencher
        .counter(ItemsCount::new(cases.len()))
        .bench_local(|| {
            let mut player = campaign.player();
            let classes = cases.iter().map(|case| player.play(case));
            classes.filter(Result::is_ok).count()
        });
}

#[divan::bench(args = CAMPAIGNS[..2].iter())]
fn ring(bencher: divan::Bencher<'_, '_>, name: &str) {
    let (campaign, cases) = load(name);
    let mut start = bench(&campaign.entry.plan);
    start.stop_recording();
    let said: Vec<Vec<u8>> = cases
        .iter()
        .map(|case| {
            let (_, said) = campaign.play(case).expect("a class");
            said.into_iter().flat_map(|said| said.bytes).collect()
        })
        .collect();
    bencher
        .counter(ItemsCount::new(cases.len()))
        .bench_local(|| {
            for bytes in &said {
                let mut link = start.clone();
                let end = link.send_octets(0, bytes);
                link.run_until(end);
                while link.receive_octet(0).is_some() {}
            }
        });
}
