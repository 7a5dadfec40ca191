//! The results of a campaign, for people and for tools.

use super::{LineOutcome, PlayedLine};
use crate::campaign::PlayedCampaign as _;
use crate::campaign::share::counts;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// How many of the worst cases a table shows.
const WORST: usize = 10;

/// How many cases there are of each class, what differs from the file, and the worst cases.
#[must_use]
pub(crate) fn table(played: &PlayedLine) -> String {
    let all = played.outcomes.len() as u64;
    let (name, title) = (&played.name, &played.title);
    let (count, units) = (played.count, played.table.units);
    let mut text = format!("{title}\n{name}: {all} cases; 1 drive, {count} {units}\n\n");
    text += &counts(played);
    let worst = played.serious();
    if !worst.is_empty() {
        text.push_str("\n  the worst\n");
    }
    for outcome in worst.into_iter().take(WORST) {
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "  {:18} {}", played.of(outcome).name, line(outcome));
    }
    text
}

/// The cases of a class, one a line.
#[must_use]
pub(crate) fn only(played: &PlayedLine, class: usize) -> String {
    let outcomes = played.outcomes.iter();
    let outcomes = outcomes.filter(|outcome| outcome.class == class);
    let lines = outcomes.map(|case| format!("{:10} {}\n", played.of(case).name, line(case)));
    lines.collect()
}

/// A case, and what happened.
fn line(outcome: &LineOutcome) -> String {
    let (case, disturbed) = (outcome.case.name(), &outcome.case.disturbed);
    format!("{case:20} {disturbed:22} {}", outcome.happened)
}

/// A campaign for tools.
#[must_use]
pub(crate) fn json(played: &PlayedLine, only: Option<usize>) -> Value {
    let unit = played.table.units.trim_end_matches('s');
    let case = |outcome: &LineOutcome| {
        json!({
            "case": outcome.case.name(),
            unit: outcome.case.disturbed,
            "class": played.of(outcome).name,
            "steps": outcome.steps,
            "troubles": outcome.troubles,
        })
    };
    let counts = played.table.classes.iter().enumerate();
    let counts =
        counts.map(|(place, class)| json!({ "class": class.name, "cases": played.count(place) }));
    let wanted = |outcome: &&LineOutcome| only.is_none_or(|only| outcome.class == only);
    let shown = played.outcomes.iter().filter(wanted);
    let differs = played.differs().into_iter();
    let differs = differs.map(
        |(name, expected, found)| json!({ "class": name, "expected": expected, "found": found }),
    );
    json!({
        "name": played.name,
        "bus": played.table.bus.name(),
        "title": played.title,
        played.table.units: played.count,
        "classes": counts.collect::<Vec<_>>(),
        "differs": differs.collect::<Vec<_>>(),
        "cases": shown.map(case).collect::<Vec<_>>(),
    })
}
