//! The section of a scenario: its outcome, what was expected beside what was received, and its pictures.

use super::summary::{Row, ShownScenario, colour};
use super::{SegmentReport, TraceView};
use crate::html::Html;
use crate::report::html::{FoldedPart, Section};
use crate::report::lines::lines;
use crate::scenario::run::{ByteDifference, Mismatch, Outcome};
use crate::scenario::source::line_number;
use crate::scenario::verdict::Verdict;
use harness_proto::line::{Rate, Received};
use harness_sim::record::Trace;

/// Bytes of a line shown before and after the one that differs.
const AROUND: usize = 12;

/// Expectations shown at most.
const EXPECTED: usize = 100;

/// Remarks shown at most.
const REMARKS: usize = 40;

/// A scenario that was played.
#[derive(Clone, Copy, Debug)]
pub struct ScenarioView<'p> {
    pub name: &'p str,
    pub title: &'p str,
    /// Which tables of which manual it pins.
    pub sources: &'p [String],
    /// How many drives its rings have: `3`, or `3+2`.
    pub drives: &'p str,
    /// Its text; empty where it is not known.
    pub text: &'p str,
    pub outcome: &'p Outcome,
    /// What the links carried, ring by ring.
    pub traces: &'p [Trace],
    /// How they are shown.
    pub report: &'static dyn SegmentReport,
    /// The rate of the line.
    pub rate: Rate,
    /// The command that shows it again.
    pub again: &'p str,
}

/// Its section; `number` makes it unique on a page.
#[must_use]
pub fn section(number: usize, played: &ScenarioView<'_>) -> ShownScenario {
    let id = format!("s{number}");
    let outcome = played.outcome;
    let mut html = Html::new();
    html.element("p", &[], |html| {
        html.line(
            "strong",
            &[("class", &colour(outcome.verdict))],
            outcome.verdict,
        );
        html.text(format_args!(" {}", played.title));
    });
    facts(&mut html, played);
    if let Some(finding) = &outcome.finding {
        found(&mut html, played, finding);
    }
    ShownScenario {
        row: Row::of(played),
        section: Section {
            heading: played.name.to_owned(),
            gravity: outcome.verdict as u8,
            parts: parts(&id, played),
            id,
            html,
        },
    }
}

fn facts(html: &mut Html, played: &ScenarioView<'_>) {
    let outcome = played.outcome;
    html.element("dl", &[], |html| {
        let mut fact = |name: &str, value: &dyn std::fmt::Display| {
            html.line("dt", &[], name);
            html.line("dd", &[], value);
        };
        if !played.sources.is_empty() {
            fact("Covers", &played.sources.join(", "));
        }
        fact("Drives", &played.drives);
        fact("On the line", &outcome.took);
        for remark in outcome.remarks.iter().take(REMARKS) {
            fact("Note", remark);
        }
        if outcome.remarks.len() > REMARKS {
            fact("Note", &format!("{} more", outcome.remarks.len() - REMARKS));
        }
        fact("Reproduce with", &played.again);
    });
}

fn found(html: &mut Html, played: &ScenarioView<'_>, finding: &Mismatch) {
    html.line("h3", &[], "What differed");
    html.line("p", &[("class", &"bad")], &finding.message);
    let line = played.text.get(finding.span.start..finding.span.end);
    if let Some(line) = line.filter(|line| !line.is_empty()) {
        let number = line_number(played.text, finding.span.start);
        html.line(
            "p",
            &[],
            format_args!("The step, line {number} of the scenario:"),
        );
        html.element("pre", &[], |html| html.line("code", &[], line));
    }
    if !finding.in_error.is_empty() {
        html.line(
            "p",
            &[],
            format_args!("In the error mode: {}", finding.in_error),
        );
    }
    if let Some(difference) = &finding.difference {
        beside(html, difference);
    }
}

/// Expected beside received, as a table with a column a byte.
fn beside(html: &mut Html, difference: &ByteDifference) {
    let from = difference.index.saturating_sub(AROUND);
    let longest = difference.expected.len().max(difference.received.len());
    let to = longest.min(difference.index + AROUND + 1);
    let expected = |at: usize| difference.expected.get(at).map(|byte| byte.to_string());
    let received = |at: usize| difference.received.get(at).map(Received::to_string);
    html.element("table", &[("class", &"bytes")], |html| {
        let place = difference.byte;
        html.line(
            "caption",
            &[],
            format_args!("Expected and received around byte {place} at the master"),
        );
        html.element("tr", &[], |html| {
            html.line("th", &[("scope", &"col")], "Byte of the line");
            for at in from..to {
                html.line("th", &[("scope", &"col")], at + 1);
            }
        });
        row(html, "Expected", from..to, difference.index, &expected);
        row(html, "Received", from..to, difference.index, &received);
    });
}

fn row(
    html: &mut Html,
    name: &str,
    shown: std::ops::Range<usize>,
    differs: usize,
    byte: &dyn Fn(usize) -> Option<String>,
) {
    html.element("tr", &[], |html| {
        html.line("th", &[("scope", &"row")], name);
        for at in shown {
            let text = byte(at).unwrap_or_else(|| "none".to_owned());
            if at == differs {
                html.element("td", &[("class", &"bad")], |html| {
                    html.line("strong", &[], text);
                });
            } else {
                html.line("td", &[], text);
            }
        }
    });
}

/// What the scenario expects, line by line, and whether it was received. Returns false if it expects nothing.
fn expectations(html: &mut Html, played: &ScenarioView<'_>) -> bool {
    let mut start = 0;
    let mut rows = Vec::new();
    for (index, line) in played.text.split_inclusive('\n').enumerate() {
        let text = line.trim();
        if text.starts_with(['<', '?']) {
            rows.push((
                index + 1,
                text,
                came(played.outcome, start, start + line.len()),
            ));
        }
        start += line.len();
    }
    if rows.is_empty() {
        return false;
    }
    html.element("details", &[], |html| {
        html.line("summary", &[], format_args!("Expectations: {}", rows.len()));
        html.element("table", &[], |html| {
            html.line(
                "caption",
                &[],
                "Lines of the scenario that expect something, and what came",
            );
            html.heads(&["Line", "Expected", "Received"]);
            for (number, text, (class, came)) in rows.iter().take(EXPECTED) {
                html.element("tr", &[], |html| {
                    html.line("td", &[("class", &"n")], number);
                    html.line("td", &[("class", &"n")], text);
                    html.line("td", &[("class", class)], came);
                });
            }
        });
        if rows.len() > EXPECTED {
            let more = rows.len() - EXPECTED;
            html.line(
                "p",
                &[("class", &"note")],
                format_args!("{more} more are not shown."),
            );
        }
    });
    true
}

/// Whether the bytes expected by a line were received: playing stops at the first difference.
fn came(outcome: &Outcome, start: usize, end: usize) -> (&'static str, &'static str) {
    let known = outcome.finding.as_ref().map(|found| &found.span);
    match (outcome.verdict, known) {
        (_, Some(span)) if span.end > 0 && (start..end).contains(&span.start) => {
            ("bad", "differs, see above")
        }
        (_, Some(span)) if span.end > 0 && end <= span.start => ("good", "as expected"),
        (Verdict::Passed | Verdict::Marginal | Verdict::Flaky, None) => ("good", "as expected"),
        (Verdict::Skipped, _) => ("open", "not played"),
        _ => ("open", "not known"),
    }
}

fn parts(id: &str, played: &ScenarioView<'_>) -> Vec<FoldedPart> {
    let mut parts = Vec::new();
    let mut html = Html::new();
    if expectations(&mut html, played) {
        parts.push(FoldedPart {
            heading: "Expected and received".to_owned(),
            html,
            instead: String::new(),
        });
    }
    let two = played.traces.len() > 1;
    let instead = format!("It is shown by: {}", played.again);
    for (ring, trace) in played.traces.iter().enumerate() {
        let finding = played.outcome.finding.as_ref();
        let difference = finding.and_then(|finding| finding.difference.as_ref());
        let differs = difference.filter(|difference| difference.ring == ring);
        let view = TraceView {
            trace,
            ring,
            one_of_two: two,
            id: &format!("{id}-{ring}"),
            title: played.title,
            rate: played.rate,
            differs: differs.map(|difference| difference.byte),
        };
        let pictures = played.report.pictures(&view).into_iter();
        parts.extend(pictures.map(|(heading, html)| FoldedPart {
            heading,
            html,
            instead: instead.clone(),
        }));
        parts.extend(played.report.page_rows(trace));
    }
    if !played.outcome.records.is_empty() {
        let mut html = Html::new();
        lines(&mut html, id, &played.outcome.records);
        parts.push(FoldedPart {
            heading: "Recorded cells".to_owned(),
            html,
            instead,
        });
    }
    parts.extend(text(played.text));
    parts
}

fn text(text: &str) -> Option<FoldedPart> {
    if text.is_empty() {
        return None;
    }
    let mut html = Html::new();
    html.element("details", &[], |html| {
        html.line("summary", &[], "Its text");
        html.element("pre", &[], |html| html.line("code", &[], text));
    });
    Some(FoldedPart {
        heading: "Scenario".to_owned(),
        html,
        instead: String::new(),
    })
}
