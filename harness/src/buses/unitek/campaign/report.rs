//! The results of a campaign, for people and for tools.

use super::{FrameClass, FrameOutcome, JobEnd, PlayedFrames};
use crate::campaign::report::share;
use serde_json::{Value, json};
use std::fmt::Write as _;

/// How many of the worst cases a table shows.
const WORST: usize = 10;

/// How many cases there are of each class, what differs from the file, and the worst cases.
#[must_use]
pub fn table(played: &PlayedFrames<'_>) -> String {
    let all = played.outcomes.len() as u64;
    let campaign = played.campaign;
    let mut text = format!(
        "{}\n{}: {all} cases; 1 drive, {} frames\n\n",
        campaign.file.title,
        campaign.name.trim_end_matches(".toml"),
        campaign.frames(),
    );
    // Writing to a String cannot fail.
    let _infallible = writeln!(text, "  {:18} {:>8} {:>9}", "class", "cases", "share");
    for class in FrameClass::ALL {
        let count = played.count(class);
        let (name, share) = (class.name(), share(count, all));
        let _infallible = writeln!(text, "  {name:18} {count:>8} {share:>9}  {}", class.about());
    }
    for (name, expected, found) in played.differs() {
        let _infallible = writeln!(
            text,
            "  differs: {name} is {found}, the file pins {expected}"
        );
    }
    let worst = serious(played);
    if !worst.is_empty() {
        text.push_str("\n  the worst\n");
    }
    for outcome in worst.into_iter().take(WORST) {
        let name = outcome.case.to_string();
        let (class, frame) = (outcome.class.name(), &outcome.disturbed);
        let _infallible = writeln!(
            text,
            "  {class:18} {name:20} {frame:22} {}",
            happened(outcome)
        );
    }
    text
}

/// The serious cases, the worst class first.
pub(super) fn serious<'p>(played: &'p PlayedFrames<'_>) -> Vec<&'p FrameOutcome> {
    let serious = |outcome: &&FrameOutcome| outcome.class >= FrameClass::Noticed;
    let mut worst: Vec<_> = played.outcomes.iter().filter(serious).collect();
    worst.sort_by_key(|outcome| std::cmp::Reverse(outcome.class));
    worst
}

/// The cases of a class, one a line.
#[must_use]
pub fn only(played: &PlayedFrames<'_>, class: FrameClass) -> String {
    let own = played.outcomes.iter().filter(|own| own.class == class);
    let line = |own: &FrameOutcome| {
        let name = own.case.to_string();
        format!(
            "{:10} {name:20} {:22} {}\n",
            class.name(),
            own.disturbed,
            happened(own)
        )
    };
    own.map(line).collect()
}

/// What happened in a case.
pub(super) fn happened(outcome: &FrameOutcome) -> String {
    let played = &outcome.conversation;
    let jobs = played
        .ends
        .iter()
        .enumerate()
        .filter(|(_, end)| !end.is_well());
    let jobs = jobs.map(|(step, end)| format!("step {}: {}", step + 1, end.words()));
    let parts: Vec<_> = jobs
        .chain(played.troubles.iter().cloned())
        .take(4)
        .collect();
    if parts.is_empty() {
        let ends: Vec<_> = played.ends.iter().map(JobEnd::words).collect();
        return format!("reported: {}", ends.join(", "));
    }
    parts.join("; ")
}

/// A campaign for tools.
#[must_use]
pub fn json(played: &PlayedFrames<'_>, only: Option<FrameClass>) -> Value {
    let campaign = played.campaign;
    let case = |outcome: &FrameOutcome| {
        let ends: Vec<_> = outcome
            .conversation
            .ends
            .iter()
            .map(JobEnd::words)
            .collect();
        json!({
            "case": outcome.case.to_string(),
            "frame": outcome.disturbed,
            "class": outcome.class.name(),
            "steps": ends,
            "troubles": outcome.conversation.troubles,
        })
    };
    let count = |class: FrameClass| json!({ "class": class.name(), "cases": played.count(class) });
    let wanted = |own: &&FrameOutcome| only.is_none_or(|only| own.class == only);
    let shown = played.outcomes.iter().filter(wanted);
    let differs = played.differs().into_iter();
    let differs = differs.map(
        |(name, expected, found)| json!({ "class": name, "expected": expected, "found": found }),
    );
    json!({
        "name": campaign.name.trim_end_matches(".toml"),
        "bus": "unitek",
        "title": campaign.file.title,
        "frames": campaign.frames(),
        "classes": FrameClass::ALL.map(count),
        "differs": differs.collect::<Vec<_>>(),
        "cases": shown.map(case).collect::<Vec<_>>(),
    })
}
