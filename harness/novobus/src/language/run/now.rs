//! Steps that are done at once, beside the conversation of another master.

use super::Runner;
use crate::language::plan::{Plan, PlannedCheck, PlannedStep, RingAct};
use harness_bench::link::Link;
use harness_bench::scenario::plan::{PlannedAction, PlannedWhen};
use harness_bench::scenario::run::player::AtMismatch;

/// The outcome of a step that is done at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Now {
    /// The step is done, or the check holds.
    Done,
    /// The check does not hold: what was found, in a sentence.
    Otherwise(String),
    /// The step cannot be done at once: why, in a sentence.
    Refused(&'static str),
}

/// Does a step at once. No time passes and nothing is sent: faults, what happens to drives from outside the bus,
/// and checks that look at drives or at the error mode.
pub(crate) fn now(plan: &Plan, link: &mut dyn Link, step: &PlannedStep) -> Now {
    if step.when != PlannedWhen::Now {
        return Now::Refused(
            "a line is carried out at once: no time is allowed in front of it (a fault may have one after its place)",
        );
    }
    match &step.action {
        PlannedAction::Own(RingAct::Fault(ring, fault, moment)) => {
            link.inject(*ring, *fault, *moment);
            Now::Done
        }
        PlannedAction::Own(RingAct::Influence(ring, drives, influence)) => {
            influence.act(link, *ring, drives.clone());
            Now::Done
        }
        PlannedAction::Own(RingAct::Check(check)) => look(plan, link, check, step),
        _ => Now::Refused(
            "only faults (`!`), checks (`?`) and what happens to drives (`drive ...`) can be done at once: \
             the bytes are the master's",
        ),
    }
}

fn look(plan: &Plan, link: &mut dyn Link, check: &PlannedCheck, step: &PlannedStep) -> Now {
    match check {
        PlannedCheck::Drive(_) | PlannedCheck::Error(..) | PlannedCheck::Located(_, _, None) => {}
        _ => {
            return Now::Refused(
                "this check counts bytes of the scenario's own master; here another master sends",
            );
        }
    }
    let mut runner = Runner::new(plan, link, AtMismatch::Stop);
    let result = super::check::check(&mut runner, check, false, step.span);
    match (result, runner.unseen.take()) {
        (Ok(()), None) => Now::Done,
        (Err(stop), _) | (Ok(()), Some(stop)) => Now::Otherwise(stop.into_message()),
    }
}
