//! A scenario settled for a bench of a given size: every number is known, everything that cannot be is refused, and nothing has been
//! sent yet.

pub mod unroll;

pub use unroll::Unroll;

use super::language::{Language, Settle};
use super::pattern::MAX_BYTES;
use super::problem::{Problem, Problems, TextSpan};
use super::source::Source;
use super::syntax::{Action, Scenario, Step, When};
use super::times::Window;
use crate::link::Capability;
use harness_proto::time::Span;
use std::ops::{Deref, DerefMut};

/// Maximum number of bytes that a run may carry on all links together: its record is kept in memory.
pub const MAX_CARRIED: u64 = 20_000_000;

/// Default wait of a line without a time.
const DEADLINE: Span = Span::from_millis(1000);

/// A scenario for a bench of a given size. What its header says is read through the plan itself.
#[derive(Clone, Debug)]
pub struct Plan<L: Language> {
    /// Whether messages that no line expects are a failure.
    pub strict: bool,
    /// How long a line without a time waits.
    pub deadline: Span,
    /// What a rig must have.
    pub needs: Vec<Capability>,
    pub steps: Vec<PlannedStep<L>>,
    pub setup: L::Setup,
}

impl<L: Language> Plan<L> {
    /// How many pieces the steps of the plan send; those of a master's own program are not known.
    #[must_use]
    pub fn pieces_sent(&self) -> usize {
        let steps = self.steps.iter();
        steps.map(|step| step.action.pieces().0).sum()
    }

    /// Whether a step judges what the drives do. A strict scenario judges what comes unexpected, if it does anything but wait.
    #[must_use]
    pub fn judges(&self) -> bool {
        let judges = |action: &PlannedAction<L>| match action {
            PlannedAction::Send(..) | PlannedAction::Wait(_) => false,
            PlannedAction::Receive(..) => true,
            PlannedAction::Own(act) => L::Planner::judges(act),
        };
        let acts = |action: &PlannedAction<L>| !matches!(action, PlannedAction::Wait(_));
        let mut actions = self.steps.iter().map(|step| &step.action);
        actions.any(|action| judges(action) || self.strict && acts(action))
    }
}

impl<L: Language> Deref for Plan<L> {
    type Target = L::Setup;

    fn deref(&self) -> &L::Setup {
        &self.setup
    }
}

impl<L: Language> DerefMut for Plan<L> {
    fn deref_mut(&mut self) -> &mut L::Setup {
        &mut self.setup
    }
}

#[derive(Clone, Debug)]
pub struct PlannedStep<L: Language> {
    /// The time in front.
    pub when: PlannedWhen,
    /// What happens.
    pub action: PlannedAction<L>,
    pub span: TextSpan,
}

/// The time of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedWhen {
    /// None.
    Now,
    /// After the line before.
    After(PlannedWindow),
    /// Since the start.
    At(PlannedWindow),
}

/// A time from, to, and how exact they are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedWindow {
    pub from: Span,
    pub to: Span,
    /// Half a unit of the last digit written, for an exact time; zero for a window.
    pub tolerance: Span,
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum PlannedAction<L: Language> {
    /// The master sends on a port, counted from 0.
    Send(usize, Vec<L::Sent>),
    /// The master receives on a port.
    Receive(usize, Vec<L::Wanted>),
    /// Time passes.
    Wait(Span),
    /// A step of the bus.
    Own(L::Act),
}

impl<L: Language> PlannedAction<L> {
    /// How many pieces the master sends, and how many it must receive.
    fn pieces(&self) -> (usize, usize) {
        match self {
            Self::Send(_, pieces) => (pieces.len(), 0),
            Self::Receive(_, pieces) => (0, pieces.len()),
            Self::Wait(_) => (0, 0),
            Self::Own(act) => L::Planner::pieces(act),
        }
    }
}

/// Settles a scenario, for a bench of `size` where that is given.
///
/// # Errors
/// Everything that cannot be on this bench.
pub fn plan<L: Language>(
    scenario: &Scenario<L>,
    source: &Source,
    size: Option<u8>,
) -> Result<Plan<L>, Problems> {
    let problems = |all| Problems::new(&source.name, source.text.clone(), all);
    let mut found = Vec::new();
    let mut planner =
        L::settle(scenario, size, &mut found).map_err(|problem| problems(vec![problem]))?;
    let mut needs = scenario.needs.clone();
    let steps = steps(scenario, &mut planner, &mut needs, &mut found);
    if !found.is_empty() {
        found.sort_by_key(|problem| problem.span.start);
        return Err(problems(found));
    }
    needs.extend(planner.needs(scenario));
    needs.sort();
    needs.dedup();
    let byte_time = planner.byte_time();
    let deadline = scenario.deadline.map(|deadline| deadline.on(byte_time));
    Ok(Plan {
        strict: scenario.strict || L::STRICT,
        deadline: deadline.unwrap_or(DEADLINE),
        needs,
        steps,
        setup: planner.finish(),
    })
}

/// Settles the steps, up to the first that makes the scenario too long.
fn steps<L: Language>(
    scenario: &Scenario<L>,
    planner: &mut L::Planner,
    needs: &mut Vec<Capability>,
    found: &mut Vec<Problem>,
) -> Vec<PlannedStep<L>> {
    let mut steps = Vec::new();
    let (mut sent, mut expected) = (0, 0);
    let room = planner.room();
    let mut unroll = planner.unroll(scenario);
    while let Some(next) = unroll.next() {
        let step = match next {
            Ok((step, scope)) => {
                planner.enter(scope);
                step
            }
            Err(problem) => {
                found.push(problem);
                break;
            }
        };
        match action::<L>(planner, step, needs) {
            Ok(action) => {
                let (to_send, to_receive) = action.pieces();
                sent += to_send;
                expected += to_receive;
                if let Some(problem) = too_long(sent, room, expected, step.span) {
                    found.push(problem);
                    break;
                }
                steps.push(PlannedStep {
                    when: when(step.when, planner.byte_time()),
                    action,
                    span: step.span,
                });
            }
            Err(problem) => {
                found.push(problem);
                // Another turn would tell the same again.
                if unroll.in_loop() {
                    break;
                }
            }
        }
    }
    steps
}

fn too_long(sent: usize, room: usize, expected: usize, span: TextSpan) -> Option<Problem> {
    let (what, remedy) = if expected > MAX_BYTES {
        let what = format!("more than {MAX_BYTES} bytes expected in one scenario");
        (what, "fewer bytes, in several scenarios")
    } else if sent > room {
        let what = format!("more than {room} bytes sent in one scenario on this ring");
        (what, "fewer bytes, or a smaller ring")
    } else {
        return None;
    };
    Some(Problem::new(span, what, remedy))
}

/// Settles one more step for the bench of a plan.
///
/// # Errors
/// What cannot be on this bench.
pub fn plan_step<L: Language>(
    plan: &Plan<L>,
    step: &Step<L>,
    source: &Source,
) -> Result<PlannedStep<L>, Problems> {
    let mut planner = L::resume(&plan.setup);
    let action = action::<L>(&mut planner, step, &mut Vec::new())
        .map_err(|problem| Problems::new(&source.name, source.text.clone(), vec![problem]))?;
    Ok(PlannedStep {
        when: when(step.when, planner.byte_time()),
        action,
        span: step.span,
    })
}

fn action<L: Language>(
    planner: &mut L::Planner,
    step: &Step<L>,
    needs: &mut Vec<Capability>,
) -> Result<PlannedAction<L>, Problem> {
    Ok(match &step.action {
        Action::Send { port, message } => PlannedAction::Send(*port, planner.send(*port, message)?),
        Action::Receive { port, message } => {
            PlannedAction::Receive(*port, planner.receive(*port, message)?)
        }
        Action::Wait(time) => PlannedAction::Wait(time.on(planner.byte_time())),
        Action::Own(task) => PlannedAction::Own(planner.act(task, step.span, needs)?),
        Action::For(..) | Action::End => {
            let what = "a loop is not one step";
            return Err(Problem::new(step.span, what, "a step expected here"));
        }
    })
}

fn when(when: When, byte_time: Span) -> PlannedWhen {
    let planned = |window: Window| {
        let tolerance = if window.is_exact() {
            window.from.tolerance(byte_time)
        } else {
            Span::ZERO
        };
        PlannedWindow {
            from: window.from.on(byte_time),
            to: window.to.on(byte_time),
            tolerance,
        }
    };
    match when {
        When::Now => PlannedWhen::Now,
        When::After(window) => PlannedWhen::After(planned(window)),
        When::At(window) => PlannedWhen::At(planned(window)),
    }
}
