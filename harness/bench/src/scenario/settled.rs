//! A settled scenario of any bus, for rooms that need not know which.

use super::language::Language;
use super::parse::parse;
use super::plan::{Plan, plan};
use super::problem::Problems;
use super::run::player::play_until;
use super::run::{AtMismatch, Outcome};
use super::source::Source;
use super::syntax::{Scenario, ScenarioHead};
use crate::link::{Capability, Link};
use harness_proto::line::Rate;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// For which size of ring a scenario is settled. Where stations share one line, a scenario is for one bench alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BenchSize {
    /// Its own.
    #[default]
    Own,
    /// This one.
    Of(u8),
    /// This one, where it is for several sizes and this is one of them; or its own.
    Fitting(u8),
}

/// The rings of a settled scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedRings {
    /// How many drives each has.
    pub drives: Vec<u8>,
    /// For which sizes the scenario is: the smallest and the largest of each ring.
    pub sizes: Vec<(u8, u8)>,
    /// The rate of the line.
    pub rate: Rate,
}

/// A settled scenario, and what every bus can do with it.
pub trait Settled: Debug + Send + Sync {
    /// What a rig must have for it.
    fn needs(&self) -> &[Capability];

    /// How many drives its bench has; `3+1` where it has two buses.
    fn size(&self) -> String;

    /// How many steps are played.
    fn steps(&self) -> usize;

    /// How many ports the master has on its bench.
    fn ports(&self) -> usize;

    /// The rings of its bench; `None` where stations share one line.
    fn rings(&self) -> Option<PlannedRings>;

    /// How many pieces its steps send; those of a master's own program are not known.
    fn pieces_sent(&self) -> usize;

    /// A simulated bench for it.
    fn simulate(&self) -> Box<dyn Link>;

    /// Plays it on a simulated bench of its own. Where no step judges anything, it has not passed.
    fn play(&self, link: &mut dyn Link, at_mismatch: AtMismatch) -> Outcome {
        self.play_until(link, at_mismatch, &AtomicBool::new(false))
    }

    /// The same, aborted once `interrupt` is set.
    fn play_until(
        &self,
        link: &mut dyn Link,
        at_mismatch: AtMismatch,
        interrupt: &AtomicBool,
    ) -> Outcome;
}

impl<L: Language> Settled for Plan<L> {
    fn needs(&self) -> &[Capability] {
        &self.needs
    }

    fn size(&self) -> String {
        L::size(self)
    }

    fn steps(&self) -> usize {
        self.steps.len()
    }

    fn ports(&self) -> usize {
        L::ports(self)
    }

    fn rings(&self) -> Option<PlannedRings> {
        L::planned_rings(self)
    }

    fn pieces_sent(&self) -> usize {
        Plan::pieces_sent(self)
    }

    fn simulate(&self) -> Box<dyn Link> {
        L::simulate(self)
    }

    fn play_until(
        &self,
        link: &mut dyn Link,
        at_mismatch: AtMismatch,
        interrupt: &AtomicBool,
    ) -> Outcome {
        // A rig's drives are compared with a model beside the scenario; the simulated ones of a scenario's own are not.
        play_until(self, link, at_mismatch, interrupt).judged_by(self)
    }
}

/// Reads and settles a scenario in the words of a bus.
///
/// # Errors
/// Its mistakes.
pub fn settle<L: Language>(
    source: &Source,
    size: BenchSize,
) -> Result<(ScenarioHead, Arc<dyn Settled>), Problems> {
    let scenario: Scenario<L> = parse(source)?;
    let size = match size {
        BenchSize::Own => None,
        BenchSize::Of(drives) => Some(drives),
        BenchSize::Fitting(drives) => L::fits(&scenario.header, drives).then_some(drives),
    };
    let plan = plan(&scenario, source, size)?;
    Ok((scenario.head(), Arc::new(plan)))
}
