//! `--html FILE`: the page of a run, collected while it goes on and written at its end.

use crate::command::output::Output;
use crate::command::page::{NotWritable, writable, write};
use crate::library::Entry;
use crate::scenario::run::Outcome;
use crate::shown::{Head, ScenarioView, ShownScenario, run, section};
use harness_sim::record::Trace;
use std::path::{Path, PathBuf};

/// A page that is being collected.
pub(crate) struct Page {
    path: PathBuf,
    shown: Vec<ShownScenario>,
}

impl Page {
    /// Starts a page if a file is named. A file that cannot be written is refused and reported now, because a run may take hours.
    pub(crate) fn new(
        path: Option<&Path>,
        output: &mut Output,
    ) -> Result<Option<Self>, NotWritable> {
        let Some(path) = path else { return Ok(None) };
        writable(path, output)?;
        Ok(Some(Self {
            path: path.to_owned(),
            shown: Vec::new(),
        }))
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a scenario that was played.
    pub(crate) fn add(&mut self, entry: &Entry, outcome: &Outcome, traces: &[Trace]) {
        let sources: Vec<_> = entry
            .scenario
            .sources
            .iter()
            .map(|s| s.text.clone())
            .collect();
        let name = entry.name.as_str();
        let played = ScenarioView {
            name: entry.short_name(),
            title: &entry.scenario.title,
            sources: &sources,
            drives: &entry.drives(),
            text: &entry.source.text,
            outcome,
            traces,
            report: entry.report,
            rate: entry.rate(),
            again: &format!("drivebench trace {}", word(name)),
        };
        self.shown.push(section(self.shown.len() + 1, &played));
    }

    /// Writes it. Returns false after reporting a failure.
    pub(crate) fn write(self, head: &Head<'_>, output: &mut Output) -> bool {
        let text = run(head, self.shown);
        write(&self.path, &text, output)
    }
}

/// A word of a command line, as a shell reads it.
fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}
