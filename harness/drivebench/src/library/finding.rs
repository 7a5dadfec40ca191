//! A finding as a text for people: its line in the scenario, what was expected, what was received, and the table around it.

use crate::library::Entry;
use crate::scenario::run::Mismatch;
use crate::scenario::source::line_number;
use harness_sim::record::Trace;
use std::fmt::Write as _;

/// The line that a finding is about, with its place, and the bytes that differ.
#[must_use]
pub fn explain(entry: &Entry, finding: &Mismatch, traces: &[Trace]) -> String {
    let place = place(entry, finding);
    let sources: Vec<_> = entry
        .scenario
        .sources
        .iter()
        .map(|s| s.text.clone())
        .collect();
    let mut text = format!("{place}: {}\n", finding.message);
    let line = entry.source.text.get(finding.span.start..finding.span.end);
    for line in line.unwrap_or_default().lines() {
        // Writing to a String cannot fail.
        let _infallible = writeln!(text, "    {line}");
    }
    if !finding.in_error.is_empty() {
        let _infallible = writeln!(text, "in the error mode: {}", finding.in_error);
    }
    text + &entry.report.around(finding, traces, &sources)
}

/// `file:line:column` of a finding.
fn place(entry: &Entry, finding: &Mismatch) -> String {
    let before = entry
        .source
        .text
        .get(..finding.span.start)
        .unwrap_or_default();
    let line = line_number(&entry.source.text, finding.span.start);
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    format!("{}:{line}:{column}", entry.name)
}

/// The chapter of the manual that a scenario is about, `nd21.chapter-9` of the first source `nd21 9.7`, as a class name for reports of
/// tests; `scenarios` for a scenario without a source.
#[must_use]
pub fn class(entry: &Entry) -> String {
    let source = entry.scenario.sources.first();
    let mut words = source.map_or("", |source| &source.text).split_whitespace();
    match (words.next(), words.next()) {
        (Some(manual), Some(section)) => {
            let chapter = section.split('.').next().unwrap_or(section);
            match chapter.starts_with(|c: char| c.is_ascii_digit()) {
                true => format!("{manual}.chapter-{chapter}"),
                // An example or an item of an appendix.
                false => format!("{manual}.{chapter}"),
            }
        }
        _ => "scenarios".to_owned(),
    }
}
