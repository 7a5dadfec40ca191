//! Answers to lines of control, which act on a served bus beside the client, in the words of the scenario language.

use crate::scenario::language::Language;
use crate::scenario::parse::parse_step;
use crate::scenario::plan::{Plan, PlannedAction, PlannedWhen, plan_step};
use crate::scenario::problem::{Problems, TextSpan};
use crate::scenario::source::Source;
use std::fmt;

/// The answer to a line of control. As a text it is one line without its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlAnswer {
    /// It is done, or the check holds: `ok`.
    Ok,
    /// What was asked for: `ok ` and the state of a drive, `name=value` with a space between.
    State(String),
    /// The check does not hold: `no: ` and what was found.
    No(String),
    /// The line cannot be done, and nothing has happened: `error: ` and why, with the column of a mistake.
    Error(String),
}

impl fmt::Display for ControlAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("ok"),
            Self::State(state) => write!(f, "ok {state}"),
            Self::No(found) => write!(f, "no: {found}"),
            Self::Error(why) => write!(f, "error: {why}"),
        }
    }
}

/// Does a step of a scenario at once. `act` does one of this bus, or says why not; `only` names what can be done, for any other step.
pub fn step_at_once<L: Language>(
    source: &Source,
    plan: &Plan<L>,
    only: &str,
    act: impl FnOnce(&L::Act, TextSpan) -> Result<(), ControlAnswer>,
) -> ControlAnswer {
    let step = parse_step::<L>(source).and_then(|step| plan_step(plan, &step, source));
    match step {
        Err(problems) => ControlAnswer::Error(first(&source.text, &problems)),
        Ok(step) if step.when != PlannedWhen::Now => {
            let why = "a line is carried out at once: no time is allowed in front of it";
            ControlAnswer::Error(why.to_owned())
        }
        Ok(step) => match &step.action {
            PlannedAction::Own(own) => act(own, step.span).err().unwrap_or(ControlAnswer::Ok),
            _ => ControlAnswer::Error(only.to_owned()),
        },
    }
}

/// The first mistake in a line, and its column: characters counted from 1.
pub fn first(line: &str, problems: &Problems) -> String {
    let Some(problem) = problems.all().first() else {
        return problems.to_string();
    };
    let before = line.get(..problem.span.start).unwrap_or(line);
    let column = before.chars().count() + 1;
    let mut text = format!("column {column}: {}", problem.message);
    let wanted = problem.expected.trim_end_matches(" expected here");
    let more = (!text.contains(wanted)).then_some(&problem.expected);
    for part in more.into_iter().chain(&problem.help) {
        text = format!("{text}; {part}");
    }
    text
}
