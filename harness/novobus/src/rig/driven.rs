//! Whether the bench's own master did what the master of the manual does: its part of a scenario, played again beside the record.
//!
//! The bytes that a ring answers say nothing of a master that sends the wrong ones, or tells of right ones what is not so. But a master is a
//! function of what it is asked for and of what comes back: one that is given the record must send and tell the same.

use super::run::{Way, play_one};
use crate::language::plan::Plan;
use crate::language::plan::asks_the_driver;
use harness_bench::link::{Capability, Line as _, LinkEvent, Replay};
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::novobus::deviation::MasterDeviation;

/// The remark on an attempt in which the bench's own master is wrong: no drive is to blame.
const WRONG: &str =
    "the bench's own master: it sent or told something else than the master of the manual does";

/// What the driver did in an attempt.
#[derive(Clone, Debug)]
pub(crate) struct DriverAttempt {
    plan: Plan,
    events: Vec<LinkEvent>,
    way: Way,
    tolerance: Span,
    capabilities: Vec<Capability>,
    /// The verdict before it was compared with a twin.
    verdict: Verdict,
    finding: Option<String>,
}

impl DriverAttempt {
    /// An attempt at a plan, as it was recorded; `None` where the driver had no part in it.
    pub(crate) fn new(
        plan: &Plan,
        events: &[LinkEvent],
        way: &Way,
        (tolerance, capabilities): (Span, &[Capability]),
        outcome: &Outcome,
    ) -> Option<Self> {
        let unplayed = [Verdict::Skipped, Verdict::Aborted, Verdict::RigError];
        let played = outcome.unready.is_none() && !unplayed.contains(&outcome.verdict);
        (played && asks_the_driver(plan)).then(|| Self {
            plan: plan.clone(),
            events: events.to_vec(),
            way: way.clone(),
            tolerance,
            capabilities: capabilities.to_vec(),
            verdict: outcome.verdict,
            finding: message(outcome),
        })
    }

    /// Whether the master was right. If it was not, the attempt is the bench's fault.
    pub(crate) fn judge(&self, outcome: &mut Outcome) -> bool {
        let right = self.is_explained_by(None);
        if !right {
            outcome.verdict = Verdict::RigError;
            outcome.remarks.push(WRONG.to_owned());
        }
        right
    }

    /// Whether a master with this deviation, or the right one, would do and report what was recorded.
    #[must_use]
    pub(crate) fn is_explained_by(&self, master: Option<&'static MasterDeviation>) -> bool {
        let mut plan = self.plan.clone();
        plan.master = master;
        let drives = plan.rings.iter().map(|ring| ring.drives()).collect();
        let mut replay = Replay::new(
            self.events.clone(),
            plan.rate,
            self.tolerance,
            drives,
            self.capabilities.clone(),
        );
        let Ok(outcome) = play_one(&mut replay, &plan, &self.way) else {
            return false;
        };
        let told = (outcome.verdict, message(&outcome));
        // Trouble of the rig is in the record, so a replay meets it again. A replay in other trouble means that the master did
        // something else.
        let recorded = self.events.iter().find_map(|event| match event {
            LinkEvent::Trouble(trouble) => Some(trouble),
            _ => None,
        });
        replay.trouble() == recorded
            && replay.left().is_none()
            && told == (self.verdict, self.finding.clone())
    }
}

fn message(outcome: &Outcome) -> Option<String> {
    let finding = outcome.finding.as_ref();
    finding.map(|finding| finding.message.clone())
}
