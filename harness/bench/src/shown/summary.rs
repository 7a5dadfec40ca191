//! The front part of a run's page: how many verdicts there are of each kind, and a table of all scenarios.

use super::scenario::ScenarioView;
use crate::counted::counted;
use crate::html::Html;
use crate::report::html::{Section, page};
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::collections::BTreeMap;
use std::fmt::{Display, Write as _};

/// What a page says of the run as a whole.
#[derive(Clone, Debug)]
pub struct Head<'h> {
    pub title: &'h str,
    /// Names and values: the rig, when it began. Nothing that differs between two runs that are the same.
    pub facts: Vec<(&'h str, String)>,
    /// What the run found as a whole, each text with its heading; shown before the scenarios.
    pub found: Vec<(&'h str, String)>,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct Row {
    pub name: String,
    pub title: String,
    drives: String,
    pub verdict: Verdict,
    took: Span,
    sources: String,
    /// What differed, or why it was not played.
    why: String,
    /// Places at which bytes were damaged though the scenario damages none, and how often.
    damaged: BTreeMap<String, usize>,
}

/// A scenario's section, and its row in the summary.
#[derive(Clone, Debug)]
pub struct ShownScenario {
    pub row: Row,
    pub section: Section,
}

impl ShownScenario {
    /// Shows it under another name.
    pub fn rename(&mut self, name: &str) {
        name.clone_into(&mut self.row.name);
        name.clone_into(&mut self.section.heading);
    }
}

impl Row {
    pub fn of(played: &ScenarioView<'_>) -> Self {
        Self {
            name: played.name.to_owned(),
            title: played.title.to_owned(),
            drives: played.drives.to_owned(),
            verdict: played.outcome.verdict,
            took: played.outcome.took,
            sources: played.sources.join(", "),
            why: why(played.outcome),
            damaged: damaged(played),
        }
    }
}

/// What differed, or why a scenario was not played.
fn why(outcome: &Outcome) -> String {
    let finding = outcome.finding.as_ref().map(|found| found.message.clone());
    let remark = || match outcome.verdict {
        Verdict::Passed => None,
        _ => outcome.remarks.first().cloned(),
    };
    finding.or_else(remark).unwrap_or_default()
}

/// Where bytes were damaged, and how often; nothing where the scenario damages bytes itself.
fn damaged(played: &ScenarioView<'_>) -> BTreeMap<String, usize> {
    match played.text.lines().any(|line| line.trim().starts_with('!')) {
        true => BTreeMap::new(),
        false => played.report.damaging_cables(played.traces),
    }
}

/// The verdict in a sentence, and where bytes were damaged.
fn sentences(shown: &[ShownScenario]) -> String {
    let bad = |scenario: &&ShownScenario| colour(scenario.row.verdict) == "bad";
    let skipped = |scenario: &&ShownScenario| scenario.row.verdict == Verdict::Skipped;
    let skips = shown.iter().filter(skipped).count();
    let played = shown.len() - skips;
    let failed = shown.iter().filter(bad).count();
    let rest = match skips {
        0 => String::new(),
        one => format!(" {one} skipped."),
    };
    let mut text = match shown.iter().find(bad) {
        Some(first) => {
            let why = match first.row.why.as_str() {
                "" => first.row.verdict.to_string(),
                why => why.trim_end_matches('.').to_owned(),
            };
            let name = &first.row.name;
            let first = if failed > 1 { "the first is " } else { "" };
            format!(
                "{failed} of {} failed: {first}{name}: {why}.{rest}",
                counted(played, "scenario")
            )
        }
        None if played == 0 => "No scenario was played.".to_owned(),
        None => {
            let passed = |scenario: &&ShownScenario| scenario.row.verdict == Verdict::Passed;
            let passed = shown.iter().filter(passed).count();
            format!(
                "{passed} of {} passed, and none failed.{rest}",
                counted(played, "scenario")
            )
        }
    };
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    for (place, count) in shown.iter().flat_map(|scenario| &scenario.row.damaged) {
        *places.entry(place).or_default() += count;
    }
    let all: usize = places.values().sum();
    if let Some((place, count)) = places.iter().max_by_key(|(_, count)| **count) {
        let place = place.strip_prefix("the ").unwrap_or(place);
        // Writing to a String cannot fail.
        let _infallible = write!(
            text,
            " The {place} damages bytes: {count} of {} located there.",
            match all {
                1 => "1 fault was".to_owned(),
                all => format!("{all} faults were"),
            }
        );
    }
    text
}

/// The page of a run.
#[must_use]
pub fn run(head: &Head<'_>, shown: Vec<ShownScenario>) -> String {
    let mut front = Html::new();
    front.element("section", &[("aria-labelledby", &"summary")], |html| {
        html.line("h2", &[("id", &"summary")], "Summary");
        html.line("p", &[("class", &"verdict")], sentences(&shown));
        counts(html, &shown);
        if !head.facts.is_empty() {
            html.element("dl", &[], |html| {
                for (name, value) in &head.facts {
                    html.line("dt", &[], name);
                    html.line("dd", &[], value);
                }
            });
        }
        for (heading, text) in &head.found {
            html.line("h3", &[], heading);
            html.element("pre", &[], |html| html.line("code", &[], text));
        }
        let skipped = |scenario: &&ShownScenario| scenario.row.verdict == Verdict::Skipped;
        let (skipped, played): (Vec<_>, Vec<_>) = shown.iter().partition(skipped);
        if !played.is_empty() {
            table(html, "Scenarios", &played);
        }
        if !skipped.is_empty() {
            html.element("details", &[], |html| {
                html.line("summary", &[], format_args!("{} skipped", skipped.len()));
                table(html, "Skipped scenarios", &skipped);
            });
        }
    });
    // What was skipped shows nothing but its reason, which the table has.
    let played = shown
        .into_iter()
        .filter(|scenario| scenario.row.verdict != Verdict::Skipped);
    let sections: Vec<_> = played.map(|scenario| scenario.section).collect();
    page(head.title, &front, &sections)
}

/// The class of a verdict's colour.
pub fn colour(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "good",
        Verdict::Skipped | Verdict::Marginal | Verdict::Flaky | Verdict::Inconclusive => "open",
        Verdict::Failed | Verdict::Aborted | Verdict::RigError => "bad",
    }
}

fn counts(html: &mut Html, shown: &[ShownScenario]) {
    let mut took = Span::ZERO;
    for scenario in shown {
        took = took + scenario.row.took;
    }
    let all = [Verdict::Passed, Verdict::Failed]
        .into_iter()
        .chain(Verdict::REST);
    html.element("ul", &[("class", &"counts")], |html| {
        for verdict in all {
            let count = shown
                .iter()
                .filter(|scenario| scenario.row.verdict == verdict)
                .count();
            if count > 0 || matches!(verdict, Verdict::Passed | Verdict::Failed) {
                let class = if count > 0 { colour(verdict) } else { "none" };
                html.line(
                    "li",
                    &[("class", &class)],
                    format_args!("{count} {verdict}"),
                );
            }
        }
    });
    html.line(
        "p",
        &[],
        format_args!("{}, {took} on the line.", counted(shown.len(), "scenario")),
    );
}

fn table(html: &mut Html, caption: &str, shown: &[&ShownScenario]) {
    const HEADS: [&str; 6] = [
        "Verdict",
        "Scenario",
        "Drives",
        "On the line",
        "Shows",
        "Covers",
    ];
    html.element("table", &[("class", &"rows")], |html| {
        html.line("caption", &[], caption);
        html.element("thead", &[], |html| html.heads(&HEADS));
        html.element("tbody", &[], |html| {
            for ShownScenario { row, section } in shown {
                html.element("tr", &[], |html| {
                    let cell = |html: &mut Html, class: &str, text: &dyn Display| {
                        html.line("td", &[("class", &class)], text);
                    };
                    cell(html, colour(row.verdict), &row.verdict);
                    html.element("th", &[("scope", &"row")], |html| {
                        if row.verdict == Verdict::Skipped {
                            html.text(&row.name);
                            return;
                        }
                        let place = format!("#{}", section.id);
                        html.line("a", &[("href", &place)], &row.name);
                    });
                    cell(html, "n", &row.drives);
                    cell(html, "n", &row.took);
                    html.element("td", &[], |html| {
                        html.line("p", &[], &row.title);
                        if !row.why.is_empty() {
                            html.line("p", &[("class", &colour(row.verdict))], &row.why);
                        }
                    });
                    html.line("td", &[], &row.sources);
                });
            }
        });
    });
}
