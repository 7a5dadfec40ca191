//! `drivebench run`.

use super::args::{RunArguments, Selection};
use super::exit::Exit;
use super::output::Output;
use super::page::Page;
use super::rig_failure::find_rig;
use super::run_rig::{Job, work};
use crate::library::{Entry, LibraryError, sources};
use crate::link::Link;
use crate::report::html::Head;
use crate::report::mismatch::mismatch;
use crate::report::plot::plot;
use crate::rig::Rig;
use crate::scenario::parse::parse;
use crate::scenario::run::{AtFinding, Finding, Outcome, play};
use crate::scenario::simulate::simulated;
use crate::scenario::syntax::{Bus, Scenario};
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::trace::Trace;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write as _;

/// Reads every scenario selected; a ring size is taken where the scenario allows it.
///
/// # Errors
/// The first file that is not there, or the mistakes of every scenario that has some.
pub(super) fn select(
    selection: &Selection,
    ring: Option<u8>,
) -> Result<Vec<Entry>, Vec<LibraryError>> {
    let sources = sources(&selection.paths).map_err(|error| vec![error])?;
    let mut entries = Vec::new();
    let mut errors: Vec<LibraryError> = Vec::new();
    for source in sources {
        let size = |scenario: &Scenario| {
            let range = scenario.rings.first();
            ring.filter(|n| range.is_some_and(|r| (r.smallest..=r.largest).contains(n)))
        };
        let entry = parse(&source)
            .and_then(|scenario| Entry::new(source, size(&scenario)).map_err(|problems| *problems));
        match entry {
            Ok(entry) => entries.push(entry),
            Err(problems) => errors.push(Box::new(problems).into()),
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    if let Some(text) = &selection.filter {
        entries.retain(|entry| entry.matches(text));
    }
    Ok(entries)
}

/// Plays scenarios, one line each.
pub(super) fn run(arguments: &RunArguments, output: &mut Output) -> std::io::Result<Exit> {
    let rig = match arguments.rig.as_deref().map(|name| find_rig(name, output)) {
        None => None,
        Some(Some(rig)) => Some(rig),
        Some(None) => return Ok(Exit::Usage),
    };
    let own = rig.as_ref().map(|rig| rig.file.ring.first.drives);
    let size = own.or(arguments.ring);
    let entries = match select(&arguments.selection, size) {
        Ok(entries) => entries,
        Err(errors) => {
            errors.iter().for_each(|error| output.library_error(error));
            output.say("nothing was played\n");
            return Ok(Exit::Usage);
        }
    };
    if entries.is_empty() {
        output.complain("no scenario was selected; `drivebench list` shows what there is");
        return Ok(Exit::NothingSelected);
    }
    let Ok(page) = Page::new(arguments.html.as_deref(), output) else {
        return Ok(Exit::Usage);
    };
    let recorded = arguments.evidence.is_some();
    if let Some(rig) = rig.as_ref().filter(|rig| recorded || !rig.is_bare()) {
        let job = Job {
            purpose: "run",
            allow_motion: arguments.allow_motion,
            wait: arguments.wait.unwrap_or_default(),
            evidence: arguments.evidence.clone(),
            records: arguments.records,
            require_all: arguments.require_all,
            qualify: false,
        };
        return work(rig, &entries, &job, page, output);
    }
    on_simulated(arguments, &entries, rig.as_ref(), page, output)
}

/// Plays scenarios on simulated rings, each of its own.
fn on_simulated(
    arguments: &RunArguments,
    entries: &[Entry],
    rig: Option<&Rig>,
    mut page: Option<Page>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let bar = progress_bar(entries.len(), output.progress);
    let mut verdicts = Vec::new();
    let mut took = Span::ZERO;
    for entry in entries {
        bar.set_message(entry.short_name().to_owned());
        let played = match rig.and_then(|rig| too_large(entry, rig)) {
            Some(why) => Played {
                outcome: Outcome::skipped(why),
                traces: Vec::new(),
            },
            None => play_entry(entry, AtFinding::Stop),
        };
        let outcome = &played.outcome;
        took = took + outcome.took;
        verdicts.push(outcome.verdict);
        let mut line = line(entry, outcome, output);
        if arguments.records || entries.len() == 1 {
            line.push_str(&records(outcome));
        }
        bar.suspend(|| output.result(&line))?;
        let details = details(entry, outcome, &played.traces);
        bar.suspend(|| output.say(&details));
        if let Some(page) = &mut page {
            page.add(entry, outcome, &played.traces);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    output.result(&summary(&verdicts, took))?;
    let head = Head {
        title: "drivebench: scenarios on simulated rings",
        facts: Vec::new(),
    };
    if page.is_some_and(|page| !page.write(&head, output)) {
        return Ok(Exit::RigError);
    }
    Ok(Exit::of(&verdicts, arguments.require_all))
}

/// A scenario that was played, with what it left.
pub(super) struct Played {
    pub(super) outcome: Outcome,
    pub(super) traces: Vec<Trace>,
}

/// Why a scenario does not fit a simulated rig.
fn too_large(entry: &Entry, rig: &Rig) -> Option<String> {
    let plan = entry.plan.as_ref()?;
    let own: Vec<_> = plan.rings.iter().map(|ring| ring.drives()).collect();
    let sizes: Vec<_> = rig.rings().map(|(_, ring)| ring.drives).collect();
    (own != sizes).then(|| format!("it is for {own:?} drives, the rig has {sizes:?}"))
}

/// Plays a scenario on simulated rings.
pub(super) fn play_entry(entry: &Entry, at_finding: AtFinding) -> Played {
    let Some(plan) = &entry.plan else {
        let name = Bus::NAMES
            .iter()
            .find(|(_, bus)| *bus == entry.scenario.bus);
        let bus = name.map_or("", |(name, _)| name);
        return Played {
            outcome: Outcome::skipped(format!("the bench has no bus `{bus}` yet")),
            traces: Vec::new(),
        };
    };
    let mut link = simulated(plan);
    let outcome = play(plan, &mut link, at_finding);
    Played {
        outcome,
        traces: (0..plan.rings.len()).map(|ring| link.trace(ring)).collect(),
    }
}

/// What a scenario recorded, indented below its line.
fn records(outcome: &Outcome) -> String {
    let lines = outcome.records.iter().map(plot).collect::<String>();
    lines.lines().map(|line| format!("  {line}\n")).collect()
}

pub(super) fn line(entry: &Entry, outcome: &Outcome, output: &Output) -> String {
    let rings = entry.plan.iter().flat_map(|plan| &plan.rings);
    let drives: Vec<_> = rings.map(|ring| ring.drives().to_string()).collect();
    format!(
        "{} {:44} {:>5} drives {:>12}  {}\n",
        output.verdict(outcome.verdict).trim_end_matches(' '),
        entry.short_name(),
        drives.join("+"),
        outcome.took.to_string(),
        entry.scenario.title
    )
}

/// What there is to say about a scenario beside its line, for people.
pub(super) fn details(entry: &Entry, outcome: &Outcome, traces: &[Trace]) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    for remark in &outcome.remarks {
        let _infallible = writeln!(text, "  note: {remark}");
    }
    if let Some(finding) = &outcome.finding {
        text.push_str(&explain(entry, finding, traces));
    }
    text
}

/// A finding: the line it is about, and the bytes that differ.
fn explain(entry: &Entry, finding: &Finding, traces: &[Trace]) -> String {
    let place = place(entry, finding);
    let sources: Vec<_> = entry
        .scenario
        .sources
        .iter()
        .map(|s| s.text.clone())
        .collect();
    let mut text = format!("\n{place}: {}\n", finding.message);
    let line = entry.source.text.get(finding.span.start..finding.span.end);
    for line in line.unwrap_or_default().lines() {
        let _infallible = writeln!(text, "    {line}");
    }
    if !finding.in_error.is_empty() {
        let _infallible = writeln!(text, "in the error mode: {}", finding.in_error);
    }
    let bytes = mismatch(finding, traces, &sources);
    if bytes.is_empty() {
        if !sources.is_empty() {
            let _infallible = writeln!(text, "see {}", sources.join(", "));
        }
    } else {
        text.push('\n');
        text.push_str(&bytes);
    }
    text.push('\n');
    text
}

/// `file:line:column` of a finding.
fn place(entry: &Entry, finding: &Finding) -> String {
    let before = entry
        .source
        .text
        .get(..finding.span.start)
        .unwrap_or_default();
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    format!("{}:{line}:{column}", entry.name)
}

pub(super) fn summary(verdicts: &[Verdict], took: Span) -> String {
    let count = |wanted: Verdict| verdicts.iter().filter(|v| **v == wanted).count();
    let mut text = format!(
        "{} passed, {} failed",
        count(Verdict::Passed),
        count(Verdict::Failed)
    );
    for verdict in Verdict::REST {
        if count(verdict) > 0 {
            let _infallible = write!(text, ", {} {verdict}", count(verdict));
        }
    }
    let _infallible = writeln!(text, " ({} scenarios, {took} on the line)", verdicts.len());
    text
}

pub(super) fn progress_bar(length: usize, shown: bool) -> ProgressBar {
    let target = if shown && length > 1 {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::with_draw_target(Some(length as u64), target).with_style(style)
}
