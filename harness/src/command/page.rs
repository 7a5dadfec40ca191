//! `--html FILE`: the page of a run, collected while it goes on and written at its end.

use super::file;
use super::output::Output;
use crate::library::Entry;
use crate::regular;
use crate::report::html::{Head, ScenarioView, ShownScenario, run, section};
use crate::scenario::run::Outcome;
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

    /// Where it goes.
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
        let rate = entry
            .plan
            .as_ref()
            .map(|plan| plan.rate)
            .unwrap_or_default();
        let name = entry.name.as_str();
        let played = ScenarioView {
            name: entry.short_name(),
            title: &entry.scenario.title,
            sources: &sources,
            drives: &entry.drives(),
            text: &entry.source.text,
            outcome,
            traces,
            report: entry.report(),
            rate,
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

/// A file cannot be written, which has been reported.
pub(crate) struct NotWritable;

/// Checks that a file could be written.
pub(crate) fn writable(path: &Path, output: &mut Output) -> Result<(), NotWritable> {
    file::check(path).map_err(|failure| {
        failure.tell(output);
        NotWritable
    })
}

/// Writes a page atomically. Returns false after reporting a failure.
pub(crate) fn write(path: &Path, text: &str, output: &mut Output) -> bool {
    save(path, text, "the report is", output)
}

/// Writes a file atomically, and says that `what` is in it. Returns false after reporting a failure.
pub(crate) fn save(path: &Path, text: &str, what: &str, output: &mut Output) -> bool {
    match regular::write_text(path, text) {
        Ok(()) => {
            output.say(&format!("{what} in {}\n", path.display()));
            true
        }
        Err(error) => {
            output.complain(&format!("failed to write {}: {error}", path.display()));
            false
        }
    }
}

/// A word of a command line, as a shell reads it.
pub(crate) fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:,=+@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}
