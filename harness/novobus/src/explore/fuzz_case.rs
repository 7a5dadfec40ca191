//! The ring's conversations as the engine explores them.

use super::case::{Act, Case};
use super::confirm::judged_again;
use super::confirm::on_ring;
use super::generate::{CaseScope, Generator};
use super::html::reached;
use super::judge::Judge;
use super::mutate::mutate;
use super::on_sim::OnSim;
use super::oracle::Difference;
use super::play::MasterView;
use super::promote::{INPUTS, input};
use super::setup::{RingSetup, planted_line};
use super::text::{Surroundings, text};
use super::tour::tour;
use super::{AttemptRecord, Spice};
use crate::explore::{Finding, FuzzSettings, KeptRun, Pool, Rehearsal, Swarm};
use crate::language::Novobus;
use crate::manual::MANUAL;
use crate::report::ring::RingReport;
use harness_bench::counted::counted;
use harness_bench::explore::{
    Confirmation, Dice, ExploreError, FuzzCase, JudgedAgain, Target, played_again,
};
use harness_bench::html::Html;
use harness_bench::manual::Manual;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::settled::{BenchSize, Settled, settle};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::ScenarioHead;
use harness_bench::shown::SegmentReport;
use harness_proto::novobus::address::RingSize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Maximum number of attempts of a finding.
const MOST_ATTEMPTS: usize = 1_000;

impl FuzzCase for Case {
    const MANUAL: Manual = MANUAL;
    const REPORT: &'static dyn SegmentReport = &RingReport;

    type Scope = CaseScope;
    type Setup = RingSetup;
    type Spice = Spice;
    type Seen = MasterView;
    type Difference = Difference;
    type Attempt = AttemptRecord;
    type Act = Act;

    fn swarm(seed: u64, round: u64, scope: &CaseScope) -> Swarm {
        let needed = (&Spice::COMMANDS[..], Spice::ReadByte);
        Swarm::drawn(seed, round, &scope.spices, needed)
    }

    fn tour(scope: &CaseScope, about: &FuzzSettings) -> Vec<Self> {
        let rings = std::iter::once(&scope.first).chain(&scope.second);
        let rings = rings.filter(|_| about.ports);
        in_turns(rings.map(|ring| tour(scope, ring, about.seed)).collect())
    }

    fn made(
        scope: &CaseScope,
        swarm: &Swarm,
        (tour, number): (&[Self], u64),
        pool: &Pool,
        dice: &mut Dice,
    ) -> Self {
        let ring = usize::from(scope.second.is_some() && dice.percent(50));
        let ring_scope = scope.ring(ring);
        let maker = Generator::new(scope, ring_scope, swarm, dice);
        // Every third case is left to chance.
        let of_tour = (number % 3 < 2).then_some(number / 3 * 2 + number % 3);
        let of_tour = of_tour.and_then(|number| tour.get(usize::try_from(number).ok()?));
        if let Some(case) = of_tour {
            let mut case = case.clone();
            maker.keep_in_step(&mut case);
            return case;
        }
        let old = dice.percent(60).then(|| pool.pick(ring, dice)).flatten();
        let other = pool.pick(ring, dice);
        match old {
            Some(old) => mutate(old, other, &maker, dice),
            None => maker.case(dice),
        }
    }

    fn is_of(&self, about: &FuzzSettings) -> bool {
        let drives = match self.ring() {
            0 => Some(about.drives),
            _ => about.second,
        };
        drives == Some(self.drives)
    }

    fn lane(&self) -> usize {
        self.ring()
    }

    fn kind(finding: &Finding) -> String {
        finding.difference.kind()
    }

    fn scenario(
        finding: &Finding,
        title: &str,
        source: Option<&str>,
        deviating: bool,
    ) -> Result<String, ExploreError> {
        let (case, setup) = (&finding.case, &finding.setup);
        let source = source.map(|source| vec![source.to_owned()]);
        let header = match deviating {
            true => setup.with_deviations(),
            false => setup.header.clone(),
        };
        let seen = setup.model_answers(case)?;
        let any = match finding.ports {
            true => unknowable(case, &seen),
            false => Vec::new(),
        };
        let timed = finding.difference.byte.filter(|_| finding.difference.time);
        let mut remarks = vec![finding.difference.about.clone()];
        for planted in &setup.deviates {
            remarks.push(format!("found on {}", planted_line(planted)));
        }
        let page = Surroundings {
            title,
            sources: &source.unwrap_or_else(|| sources(finding)),
            header: &header,
            remarks: &remarks,
            seen: &seen,
            any: &any,
            timed: timed.and_then(|byte| byte.checked_sub(1)),
        };
        Ok(text(case, &page))
    }

    fn deviates(setup: &RingSetup) -> bool {
        !setup.deviates.is_empty()
    }

    fn input(finding: &Finding, title: &str) -> Option<(&'static str, String)> {
        Some((INPUTS, input(&finding.case, title)))
    }

    fn again(
        finding: &Finding,
        about: &FuzzSettings,
        known: &BTreeMap<String, u8>,
    ) -> Result<JudgedAgain, ExploreError> {
        if about.ports {
            return Ok(match judged_again(finding, about, known)? {
                None => JudgedAgain::Unknown,
                Some(again) if again == *finding => JudgedAgain::Same,
                Some(again) => JudgedAgain::Differs(format!(
                    "the file has \"{}\", its attempts give \"{}\"",
                    told(finding),
                    told(&again)
                )),
            });
        }
        let mut target = OnSim::new(finding.setup.clone());
        played_again(finding, about, known, &mut target)
    }

    fn settled(source: &Source) -> Result<(ScenarioHead, Arc<dyn Settled>), Problems> {
        settle::<Novobus>(source, BenchSize::Own)
    }

    fn planted(setup: &RingSetup) -> Vec<String> {
        setup.deviates.iter().map(planted_line).collect()
    }

    fn reached(kept: &KeptRun) -> Result<Option<(String, Html)>, ExploreError> {
        reached(kept).map(Some)
    }

    fn is_sound(finding: &Finding) -> bool {
        finding.case.is_kept()
            && finding.attempts.len() <= MOST_ATTEMPTS
            && finding.attempts.iter().all(AttemptRecord::is_sound)
    }

    fn confirm(
        confirmation: &mut Confirmation<'_>,
        finding: &mut Finding,
        rehearsal: &Rehearsal,
        before: Option<&[Act]>,
        target: &mut dyn Target<Case>,
    ) -> Result<(), ExploreError> {
        on_ring(confirmation, finding, rehearsal, before, target)
    }
}

/// A finding in a line.
fn told(finding: &Finding) -> String {
    let Finding { seen_again, of, .. } = finding;
    let sent = counted(finding.case.bytes().len(), "byte");
    format!(
        "{}; seen again {seen_again} of {of} times; {sent} sent",
        finding.difference.about
    )
}

/// The tables of the manual that it is about, as the catalogue names them.
pub(super) fn sources(finding: &Finding) -> Vec<String> {
    let table = MANUAL.table_of(&finding.difference.section, "9.1");
    table.into_iter().collect()
}

/// Bytes that drives may answer in more than one way: what they hold and measure, and the checking bytes over it.
fn unknowable(case: &Case, seen: &MasterView) -> Vec<usize> {
    let Ok(size) = RingSize::new(u64::from(case.drives)) else {
        return Vec::new();
    };
    let mut any = Judge::new(case.ring(), size, true).foresee(case).open;
    any.retain(|index| *index < seen.received.len());
    any
}

/// Interleaves the cases of several tours.
fn in_turns(tours: Vec<Vec<Case>>) -> Vec<Case> {
    let longest = tours.iter().map(Vec::len).max().unwrap_or(0);
    let at = |index: usize| {
        tours
            .iter()
            .filter_map(move |tour| tour.get(index).cloned())
    };
    (0..longest).flat_map(at).collect()
}
