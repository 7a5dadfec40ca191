//! Waits of a qualification, no longer than a right slave needs.
//!
//! What a right slave replies is the same after a part of most waits: its motor has reached its frequency long before. A slave that needs longer
//! shows it then as well. `run --rig` plays whole waits.

use super::rehearse::Other;
use super::{Own, Player};
use crate::rig::observed::Turn;
use harness_bench::scenario::plan::PlannedAction;
use harness_proto::time::Span;

/// Shorter waits stay as they are.
const LEAST: Span = Span::from_millis(400);

/// The sixteenths of a wait that are tried.
const PARTS: [u64; 9] = [1, 2, 3, 4, 6, 8, 10, 12, 14];

/// With this many hundredths of a part the replies must be the same too: the rig is not exact.
const MARGIN: u64 = 85;

impl Player {
    /// The same scenario with waits that are as long as right slaves need for the same replies.
    pub(super) fn shortened(&self, own: &Own, switches: bool) -> Own {
        let played = |own: &Own| {
            let other = Other {
                switches,
                ..Other::default()
            };
            let rehearsal = self.rehearse(own, &self.limits, other);
            rehearsal.passes().then(|| replies(&rehearsal.turns))
        };
        let mut shorter = own.clone();
        let Some(whole) = played(own) else {
            return shorter;
        };
        for place in 0..own.plan.steps.len() {
            let PlannedAction::Wait(wait) = own.plan.steps[place].action else {
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
            let sixteenth = wait.units() / 16;
            let enough = PARTS
                .into_iter()
                .map(|part| sixteenth * part)
                .find(|part| lasts(part / 100 * MARGIN) && lasts(*part));
            let units = enough.unwrap_or(wait.units());
            shorter.plan.steps[place].action = PlannedAction::Wait(Span::from_units(units));
        }
        shorter
    }
}

/// What was sent, and what came.
fn replies(turns: &[Turn]) -> Vec<(Vec<u8>, Vec<u16>)> {
    let all = turns.iter();
    all.map(|own| (own.octets.clone(), own.came.clone()))
        .collect()
}
