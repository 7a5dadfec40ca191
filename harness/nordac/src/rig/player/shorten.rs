//! Waits of a qualification, no longer than a right slave needs.
//!
//! What a right slave replies is the same after a part of most waits: its motor has reached its frequency long before. A slave that needs longer
//! shows it then as well. `run --rig` plays whole waits.

use super::rehearse::ModelOptions;
use super::{Player, RigScenario};
use crate::rig::observed::Turn;
use harness_bench::scenario::plan::PlannedAction;
use harness_proto::time::Span;

/// Shorter waits stay as they are.
const LEAST: Span = Span::from_millis(400);

/// In this many parts a wait is divided.
const PARTS: u64 = 64;

/// With this many hundredths of what is left of a wait the replies must be the same too, and with this much less: a motor is not exact, and a
/// computer that is late must not leave it open whether a time was over.
const MARGIN: u64 = 95;
const SLACK: Span = Span::from_millis(100);

impl Player {
    /// The same scenario with waits that are as long as right slaves need for the same replies.
    pub(super) fn shortened(&self, scenario: &RigScenario, switches: bool) -> RigScenario {
        let played = |shorter: &RigScenario| {
            let other = ModelOptions {
                switches,
                ..ModelOptions::default()
            };
            let rehearsal = self.rehearse(shorter, &self.limits, other);
            rehearsal.passes().then(|| replies(&rehearsal.turns))
        };
        let mut shorter = scenario.clone();
        let Some(whole) = played(scenario) else {
            return shorter;
        };
        for place in 0..scenario.plan.steps.len() {
            let PlannedAction::Wait(wait) = scenario.plan.steps[place].action else {
                continue;
            };
            if wait < LEAST {
                continue;
            }
            let mut lasts = |units: u64| {
                let span = Span::from_units(units);
                shorter.plan.steps[place].action = PlannedAction::Wait(span);
                played(&shorter).as_ref() == Some(&whole)
            };
            let of = |parts: u64| wait.units() / PARTS * parts;
            // The replies are the same with the upper one, and are not with the lower one.
            let (mut lower, mut upper) = (0, PARTS);
            while lower + 1 < upper {
                let middle = lower.midpoint(upper);
                let all = of(middle);
                let least = (all / 100 * MARGIN).min(all.saturating_sub(SLACK.units()));
                let enough = lasts(least) && lasts(all);
                *if enough { &mut upper } else { &mut lower } = middle;
            }
            let units = if upper == PARTS {
                wait.units()
            } else {
                of(upper)
            };
            shorter.plan.steps[place].action = PlannedAction::Wait(Span::from_units(units));
        }
        shorter
    }
}

fn replies(turns: &[Turn]) -> Vec<(Vec<u8>, Vec<u16>)> {
    let all = turns.iter();
    all.map(|turn| (turn.octets.clone(), turn.came.clone()))
        .collect()
}
