//! Conversations as the engine explores them.

use super::generate::Maker;
use super::{LineAct, LineBus, LineScope, LineSetup, LineTalk, OnLine, Seen};
use crate::explore::smaller::{Shrinkable, fewer};
use crate::explore::{
    Dice, Differing as _, ExploreError, Finding, FuzzCase, FuzzSettings, JudgedAgain, Planted,
    Pool, Swarm, is_first, played_again,
};
use crate::manual::Manual;
use crate::scenario::problem::Problems;
use crate::scenario::settled::{BenchSize, Settled, settle};
use crate::scenario::source::Source;
use crate::scenario::syntax::ScenarioHead;
use crate::shown::SegmentReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Nothing: simulated drives do the same again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoAttempt {}

impl<B: LineBus> FuzzCase for LineTalk<B> {
    const MANUAL: Manual = B::MANUAL;
    const REPORT: &'static dyn SegmentReport = B::REPORT;

    type Scope = LineScope<B>;
    type Setup = LineSetup;
    type Spice = B::Spice;
    type Seen = Seen<B>;
    type Difference = B::Difference;
    type Attempt = NoAttempt;
    type Act = LineAct<B::What>;

    fn swarm(seed: u64, round: u64, scope: &LineScope<B>) -> Swarm<B::Spice> {
        let has = |spice: &&B::Spice| scope.spices.contains(spice);
        let least = B::NEEDED.iter().find(has).unwrap_or(&B::NEEDED[0]);
        Swarm::drawn(seed, round, &scope.spices, (B::NEEDED, *least))
    }

    fn tour(_: &LineScope<B>, _: &FuzzSettings<Self>) -> Vec<Self> {
        Vec::new()
    }

    fn made(
        scope: &LineScope<B>,
        swarm: &Swarm<B::Spice>,
        _: (&[Self], u64),
        pool: &Pool<Self>,
        dice: &mut Dice,
    ) -> Self {
        let maker = Maker::new(scope, swarm);
        let old = dice.percent(40).then(|| pool.pick(0, dice)).flatten();
        let other = pool.pick(0, dice);
        match old {
            Some(old) => maker.mutated(old, other, dice),
            None => maker.case(dice),
        }
    }

    fn is_of(&self, _: &FuzzSettings<Self>) -> bool {
        // The drives stand in the setup, with which every case is played.
        true
    }

    fn lane(&self) -> usize {
        0
    }

    /// On deviating drives without the values of open points with which the model explains most: those are not the drives' own.
    fn scenario(
        finding: &Finding<Self>,
        title: &str,
        source: Option<&str>,
        deviating: bool,
    ) -> Result<String, ExploreError> {
        let difference = &finding.difference;
        let (section, under, is_time) = B::basis(difference);
        let mut header = [&finding.setup.header[..], under].concat();
        let setup = LineSetup::new::<B>(header.clone(), Vec::new()).under_test::<B>()?;
        let planted = finding.setup.deviates.iter().map(Planted::line::<B>);
        if deviating {
            header = finding.setup.header.clone();
            header.extend(planted.clone());
        }
        let seen = B::play(&setup, &finding.case);
        let bus = B::BUS.name();
        let usual = || B::MANUAL.table_of(section, B::USUAL_SECTION);
        let source = source.map(str::to_owned).or_else(usual).unwrap_or_default();
        let mut text = format!("title   {title}\nsource  {source}\nbus     {bus}\n");
        for line in &header {
            text.push_str(&format!("{line}\n"));
        }
        text.push_str(&format!("\n# {}\n", difference.about()));
        for planted in planted {
            text.push_str(&format!("# found on {planted}\n"));
        }
        let timed = difference.place().filter(|_| is_time);
        B::steps(&setup, &finding.case, &seen, timed, &mut text);
        Ok(text)
    }

    fn deviates(setup: &LineSetup) -> bool {
        !setup.deviates.is_empty()
    }

    fn again(
        finding: &Finding<Self>,
        about: &FuzzSettings<Self>,
        known: &BTreeMap<String, u8>,
    ) -> Result<JudgedAgain, ExploreError> {
        if about.ports {
            return Ok(JudgedAgain::Unknown);
        }
        let mut target = OnLine::<B>::new(finding.setup.under_test::<B>()?);
        played_again(finding, about, known, &mut target)
    }

    fn settled(source: &Source) -> Result<(ScenarioHead, Arc<dyn Settled>), Problems> {
        settle::<B::Words>(source, BenchSize::Own)
    }

    fn planted(setup: &LineSetup) -> Vec<String> {
        setup.deviates.iter().map(Planted::line::<B>).collect()
    }

    fn is_sound(finding: &Finding<Self>) -> bool {
        let LineSetup { bus, deviates, .. } = &finding.setup;
        let on_line = deviates.iter().all(|planted| is_first(&planted.ring));
        finding.case.is_bounded() && bus == B::BUS.name() && on_line
    }
}

impl<B: LineBus> Shrinkable for LineTalk<B> {
    /// Acts with their repetitions, then their contents, then time.
    type Measure = (usize, u64, u64);

    fn measure(&self) -> (usize, u64, u64) {
        let acts = self.acts.iter().map(|act| usize::from(act.times));
        let weights = self.acts.iter().map(|act| B::weight(&act.what));
        let time = self.acts.iter().map(LineAct::lasts);
        (acts.sum(), weights.sum(), time.sum())
    }

    fn acts(&mut self) -> &mut Vec<Self::Act> {
        &mut self.acts
    }

    fn simpler(act: &Self::Act) -> Vec<Self::Act> {
        // To no wait, to that for a reply, to whole milliseconds.
        let waited = act.wait_us;
        let round = waited / 1_000 * 1_000;
        let waits = [0, 1_000, 2_000, 5_000, 10_000, 50_000, waited / 2, round].into_iter();
        let waits = waits.map(|wait_us| LineAct {
            wait_us,
            ..act.clone()
        });
        let fewer = fewer(act.times).map(|times| LineAct {
            times,
            ..act.clone()
        });
        let others = B::simpler(&act.what).into_iter();
        waits
            .chain(fewer)
            .chain(others.map(|what| LineAct { what, ..*act }))
            .collect()
    }

    /// The time of these acts is dropped too, or added to the act before them.
    fn without(&self, acts: Range<usize>) -> Vec<Self> {
        let before = acts.start.checked_sub(1);
        let mut dropped = self.clone();
        let gone: u64 = dropped.acts.drain(acts).map(|act| act.wait_us).sum();
        let mut waits = dropped.clone();
        if let Some(act) = before.and_then(|at| waits.acts.get_mut(at)) {
            act.wait_us += gone;
        }
        vec![dropped, waits]
    }
}
