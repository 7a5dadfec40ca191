//! A run on simulated rings, played once more: it is a function of rig and scenarios, so its record and captures come again.

use super::files::{CAPTURES, read_text};
use super::folder::capture;
use super::record::RecordLine;
use super::verify::{OpenedFolder, text_of};
use crate::buses::run_on;
use crate::link::{LinkEvent, Sink};
use crate::rig::playing::RigRun;
use crate::rig::{Attempt, Keeper, PlayedScenario, UseOptions};
use crate::scenario::run::Outcome;
use std::path::Path;

/// Plays every scenario of a run on a simulated rig again, and says where the record or a capture is not what comes of it. Nothing for
/// drives behind ports, and for scenarios whose attempts are compared one by one.
pub(super) fn rerun(
    path: &Path,
    opened: &OpenedFolder,
    texts: &dyn Fn(&str) -> Result<String, String>,
) -> Vec<String> {
    let header = &opened.header;
    let judge = opened.judge().ok().flatten();
    let one_by_one = judge.is_none_or(|judge| judge.plays_again());
    if !header.simulated || header.schema < 2 || one_by_one {
        return Vec::new();
    }
    let options = UseOptions {
        purpose: "verify".to_owned(),
        allow_motion: true,
        ill_as_well: header.qualified,
        ..UseOptions::default()
    };
    let mut run = match run_on(&opened.rig.for_replay(), &options) {
        Ok(run) => run,
        Err(error) => return vec![format!("the run cannot be played again: {error}")],
    };
    let mut wrong = Vec::new();
    let mut attempts = opened.attempts.iter();
    let mut lines = Vec::new();
    for line in &opened.lines[1..] {
        lines.push(line.clone());
        match line {
            RecordLine::Scenario { .. } => {
                let attempt = attempts.next().into_iter();
                let events = attempt.flat_map(|attempt| &attempt.events);
                lines.extend(events.filter_map(RecordLine::of));
            }
            RecordLine::Case { .. } => {
                let lines = std::mem::take(&mut lines);
                match scenario(&mut *run, path, opened, &lines, texts) {
                    Ok(differs) => wrong.extend(differs),
                    Err(why) => {
                        wrong.push(why);
                        break;
                    }
                }
            }
            _ => {}
        }
    }
    wrong
}

/// Plays one scenario again and compares it with its lines.
fn scenario(
    run: &mut dyn RigRun,
    path: &Path,
    opened: &OpenedFolder,
    lines: &[RecordLine],
    texts: &dyn Fn(&str) -> Result<String, String>,
) -> Result<Vec<String>, String> {
    let Some(RecordLine::Case { name, sha256, .. }) = lines.last() else {
        return Ok(Vec::new());
    };
    let text = text_of(name, sha256.as_deref().unwrap_or_default(), texts)?;
    let entry = opened.entry(name, &text)?;
    let mut tape = Tape {
        name,
        text: &text,
        lines: Vec::new(),
        captures: Vec::new(),
    };
    // A run of an earlier version has begun what the limits deny, and its record has the attempt.
    run.rehearse(lines.len() == 1);
    let outcome = match run.play(&entry.source, Some(&mut tape)) {
        Ok(PlayedScenario { outcome, .. }) => outcome,
        Err(error) => Outcome::rig_error(error.to_string()),
    };
    let title = entry.scenario.title.as_str();
    tape.lines.push(RecordLine::of_case(
        name,
        title,
        &entry.drives(),
        sha256.clone(),
        &outcome,
    ));
    let mut wrong = Vec::new();
    let differs =
        (0..lines.len().max(tape.lines.len())).find(|at| lines.get(*at) != tape.lines.get(*at));
    if let Some(at) = differs {
        wrong.push(format!(
            "{name}: played again, line {} of its part of the record is {}, the record has {}",
            at + 1,
            shown(tape.lines.get(at)),
            shown(lines.get(at))
        ));
    }
    for (number, made) in (1..).zip(&tape.captures) {
        let file = format!("{CAPTURES}/{name}.{number}.json");
        if !opened.left_out.contains(&file) && read_text(path, &file)? != *made {
            wrong.push(format!("{file} differs from the scenario played again"));
        }
    }
    Ok(wrong)
}

/// Keeps the lines and captures of a scenario.
struct Tape<'t> {
    name: &'t str,
    text: &'t str,
    lines: Vec<RecordLine>,
    captures: Vec<String>,
}

impl Sink for Tape<'_> {
    fn take(&mut self, event: &LinkEvent) {
        self.lines.extend(RecordLine::of(event));
    }
}

impl Keeper for Tape<'_> {
    fn begins(&mut self, attempt: usize) {
        self.lines
            .push(RecordLine::of_scenario(self.name, self.text, attempt));
    }

    fn ends(&mut self, _: usize, attempt: &Attempt) {
        self.lines.push(RecordLine::of_verdict(attempt));
        self.captures
            .push(capture(&attempt.traces, &attempt.outcome));
    }
}

fn shown(line: Option<&RecordLine>) -> String {
    let text = line.map(serde_json::to_string);
    match text {
        Some(Ok(text)) => text,
        _ => "missing".to_owned(),
    }
}
