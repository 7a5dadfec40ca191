//! Exploring: cases and their texts, runs that repeat and go on, findings that become small and are kept.

mod findings;
mod masters;
mod rings;
mod runs;
mod texts;
mod witness;

use crate::explore::{
    Case, CaseScope, Difference, Finding, FuzzRun, FuzzSettings, OnSim, Pool, Rehearsal, RingScope,
    RingSetup, Spice, Swarm, Tried,
};
use crate::language::syntax::Header;
use harness_bench::explore::Planted;
use harness_bench::explore::{Bounds, ExploreError, Progress, RunEnd, Target, Watcher};
use harness_proto::novobus::guard::Limits;

/// The seed of every random test: `DRIVEBENCH_SEED`, or always the same.
fn seed() -> u64 {
    let seed = std::env::var("DRIVEBENCH_SEED").ok();
    seed.and_then(|seed| seed.parse().ok()).unwrap_or(38_400)
}

fn repeat(test: &str) -> String {
    format!(
        "repeat with: DRIVEBENCH_SEED={} cargo test -p harness-novobus {test}",
        seed()
    )
}

/// Everything on a simulated ring of plain drives.
fn scope(drives: u8) -> CaseScope {
    scope_of(drives, None)
}

/// The same with a second ring.
fn scope_of(drives: u8, second: Option<u8>) -> CaseScope {
    let (first, second) = RingScope::both(drives, second, |_, _| true);
    let behind = [Spice::Motion, Spice::Eeprom];
    let all = Spice::NAMES.iter().map(|(_, spice)| *spice);
    CaseScope {
        first,
        second,
        spices: all.filter(|spice| !behind.contains(spice)).collect(),
        limits: Limits::unlimited(),
        spare_eeprom: false,
    }
}

fn planted(drive: u8, name: &str) -> RingSetup {
    RingSetup {
        header: Header::default(),
        deviates: vec![Planted {
            ring: 0,
            drive,
            name: name.to_owned(),
        }],
    }
}

fn about(setup: &RingSetup, seed: u64) -> FuzzSettings {
    FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: "sim:3".to_owned(),
        drives: 3,
        second: None,
        ports: false,
        seed,
        confirm: 2,
        of: 3,
        setup: setup.clone(),
        spices: Vec::new(),
    }
}

/// Keeps the findings of a run.
#[derive(Default)]
struct FindingList {
    findings: Vec<Finding>,
}

impl Watcher<Case> for FindingList {
    fn round(&mut self, _: u64, _: &Swarm) {}

    fn found(&mut self, finding: &Finding, _: &str) {
        self.findings.push(finding.clone());
    }

    fn progress(&mut self, _: &Progress, _: &Pool) {}
}

fn bounds(cases: u64, findings: usize) -> Bounds {
    Bounds {
        cases,
        wire: None,
        findings,
        every: 50,
    }
}

/// A run on a ring of three; what was found, and after how many cases it ended.
fn explore(setup: &RingSetup, seed: u64, bounds: &Bounds) -> (Vec<Finding>, FuzzRun, RunEnd) {
    let mut campaign = FuzzRun::new(about(setup, seed), scope(3));
    let mut heard = FindingList::default();
    let mut target = OnSim::new(setup.clone());
    let end = campaign.run(&mut target, None, bounds, &mut heard);
    (heard.findings, campaign, end.expect("a simulated ring"))
}
