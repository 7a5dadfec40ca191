//! The front part of a run's page: how many verdicts there are of each kind, and a table of all scenarios.

use super::page::{Section, page};
use super::scenario::ScenarioView;
use crate::counted::counted;
use crate::html::Html;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;

/// What a page says of the run as a whole.
#[derive(Clone, Debug)]
pub struct Head<'h> {
    /// The page's title.
    pub title: &'h str,
    /// Names and values: the rig, when it began. Nothing that differs between two runs that are the same.
    pub facts: Vec<(&'h str, String)>,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) name: String,
    pub(crate) title: String,
    drives: String,
    pub(crate) verdict: Verdict,
    took: Span,
    sources: String,
}

/// A scenario's section, and its row in the summary.
#[derive(Clone, Debug)]
pub struct ShownScenario {
    pub(crate) row: Row,
    pub(crate) section: Section,
}

impl Row {
    pub(crate) fn of(played: &ScenarioView<'_>) -> Self {
        Self {
            name: played.name.to_owned(),
            title: played.title.to_owned(),
            drives: played.drives.to_owned(),
            verdict: played.outcome.verdict,
            took: played.outcome.took,
            sources: played.sources.join(", "),
        }
    }
}

/// The page of a run.
#[must_use]
pub fn run(head: &Head<'_>, shown: Vec<ShownScenario>) -> String {
    let mut front = Html::new();
    front.element("section", &[("aria-labelledby", &"summary")], |html| {
        html.line("h2", &[("id", &"summary")], "Summary");
        counts(html, &shown);
        if !head.facts.is_empty() {
            html.element("dl", &[], |html| {
                for (name, value) in &head.facts {
                    html.line("dt", &[], name);
                    html.line("dd", &[], value);
                }
            });
        }
        table(html, &shown);
    });
    let sections: Vec<_> = shown.into_iter().map(|shown| shown.section).collect();
    page(head.title, &front, &sections)
}

/// The class of a verdict's colour.
pub(crate) fn colour(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "good",
        Verdict::Skipped | Verdict::Marginal | Verdict::Flaky | Verdict::Inconclusive => "open",
        Verdict::Failed | Verdict::Aborted | Verdict::RigError => "bad",
    }
}

fn counts(html: &mut Html, shown: &[ShownScenario]) {
    let mut took = Span::ZERO;
    for one in shown {
        took = took + one.row.took;
    }
    let all = [Verdict::Passed, Verdict::Failed]
        .into_iter()
        .chain(Verdict::REST);
    html.element("ul", &[("class", &"counts")], |html| {
        for verdict in all {
            let count = shown
                .iter()
                .filter(|one| one.row.verdict == verdict)
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

fn table(html: &mut Html, shown: &[ShownScenario]) {
    html.element("table", &[], |html| {
        html.line("caption", &[], "Scenarios");
        html.element("thead", &[], |html| {
            html.heads(&[
                "Verdict",
                "Scenario",
                "Drives",
                "On the line",
                "Shows",
                "Covers",
            ]);
        });
        html.element("tbody", &[], |html| {
            for ShownScenario { row, section } in shown {
                html.element("tr", &[], |html| {
                    html.line("td", &[("class", &colour(row.verdict))], row.verdict);
                    html.element("th", &[("scope", &"row")], |html| {
                        let place = format!("#{}", section.id);
                        html.line("a", &[("href", &place)], &row.name);
                    });
                    html.line("td", &[("class", &"n")], &row.drives);
                    html.line("td", &[("class", &"n")], row.took);
                    html.line("td", &[], &row.title);
                    html.line("td", &[], &row.sources);
                });
            }
        });
    });
}
