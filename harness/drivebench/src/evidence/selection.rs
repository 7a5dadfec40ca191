//! Whether a record has each scenario that was selected, and what a qualification plays behind them.

use super::files::sum;
use super::record::RecordLine;
use super::verify::OpenedFolder;
use crate::rig::playing::RecordJudge;

/// How the scenarios of a record compare with those that were to be played.
#[derive(Debug, Default)]
pub(super) struct SelectionCheck {
    /// What contradicts the first line, in sentences.
    pub(super) wrong: Vec<String>,
    /// Why it is not known that all of them were played.
    pub(super) missing: Option<String>,
}

/// Compares the lines `case` with the selection in the first line.
pub(super) fn compare(opened: &OpenedFolder) -> SelectionCheck {
    let mut selection = SelectionCheck::default();
    let header = &opened.header;
    let Some(selected) = &header.selected else {
        selection.missing =
            Some("which scenarios were selected: the record's first line does not say".to_owned());
        return selection;
    };
    let cases: Vec<_> = opened.lines.iter().filter_map(case).collect();
    let pairs = selected.iter().zip(&cases);
    for (number, (_, (name, _))) in (1..)
        .zip(pairs)
        .filter(|(_, (sum, (_, case)))| *sum != case)
    {
        selection.wrong.push(format!(
            "case {name}: the scenario that was selected as number {number} is another one"
        ));
    }
    if cases.len() < selected.len() {
        selection.missing = Some(format!(
            "{} of {} selected scenarios: the record ends before them",
            selected.len() - cases.len(),
            selected.len()
        ));
        return selection;
    }
    let more = &cases[selected.len()..];
    let judge = opened.judge().ok().flatten();
    let judge = judge.filter(|_| header.qualified);
    let qualifying = judge.as_deref().map(qualifying).unwrap_or_default();
    let sums: Vec<_> = qualifying.iter().map(|known| &known.sum).collect();
    let known = |sum: &String| sums.contains(&sum);
    let trial = |name: &str| judge.as_ref().is_some_and(|judge| judge.is_trial(name));
    let unknown = more
        .iter()
        .filter(|(name, sum)| !known(sum) && !trial(name));
    for (name, _) in unknown {
        selection
            .wrong
            .push(format!("case {name}: it was not selected"));
    }
    let played = |sum: &String| more.iter().any(|(_, other)| other == sum);
    let left = qualifying
        .iter()
        .filter(|conversation| conversation.always && !played(&conversation.sum));
    let left: Vec<_> = left.collect();
    if let [first, others @ ..] = &left[..] {
        let first = &first.name;
        let more = match others.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        selection.missing = Some(format!(
            "{first}{more}: a qualification plays them, and the record does not have them"
        ));
    }
    selection
}

/// The name of a case and the sum of its text.
fn case(line: &RecordLine) -> Option<(&str, String)> {
    match line {
        RecordLine::Case { name, sha256, .. } => Some((name, sha256.clone().unwrap_or_default())),
        _ => None,
    }
}

/// What a qualification plays behind the selected scenarios.
struct ExtraScenario {
    name: String,
    /// The sum of its text.
    sum: String,
    /// A probe may end with its first conversation.
    always: bool,
}

fn qualifying(judge: &dyn RecordJudge) -> Vec<ExtraScenario> {
    let all = judge.conversations().into_iter();
    let listed = all.map(|conversation| ExtraScenario {
        sum: sum(conversation.source.text.as_bytes()),
        name: conversation.source.name,
        always: conversation.always,
    });
    listed.collect()
}
