//! `--junit FILE`: verdicts for continuous integration.

use super::run::drives;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::evidence::{JunitCase, junit};
use crate::library::Entry;
use crate::library::finding::{class, explain};
use crate::regular;
use crate::scenario::run::Outcome;
use harness_sim::record::Trace;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The verdicts of a run on their way into a file, if one is wanted.
pub(crate) struct Cases {
    rig: String,
    file: Option<PathBuf>,
    cases: Vec<JunitCase>,
}

impl Cases {
    /// Of a run on this rig.
    pub(crate) fn new(rig: &str, file: Option<&Path>) -> Self {
        Self {
            rig: rig.to_owned(),
            file: file.map(Path::to_owned),
            cases: Vec::new(),
        }
    }

    /// Notes the outcome of a scenario.
    pub(crate) fn note(&mut self, entry: &Entry, outcome: &Outcome, traces: &[Trace]) {
        let found = outcome.finding.iter().map(|found| found.message.clone());
        let message: Vec<_> = found.chain(outcome.remarks.clone()).collect();
        let found = outcome.finding.as_ref();
        self.cases.push(JunitCase {
            name: format!(
                "{}[rig={},drives={}]",
                entry.short_name(),
                self.rig,
                drives(entry)
            ),
            verdict: outcome.verdict,
            class: class(entry),
            message: message.join("; "),
            details: found.map_or_else(String::new, |found| explain(entry, found, traces)),
            took: Duration::from_nanos(outcome.took.as_nanos()),
            attachments: Vec::new(),
        });
    }

    /// Writes the file atomically. A failure is reported and gives the exit code of a bench that failed.
    pub(crate) fn write(&self, exit: Exit, output: &mut Output) -> Exit {
        let Some(path) = &self.file else {
            return exit;
        };
        let xml = junit(&format!("rig {}", self.rig), &self.cases);
        match regular::write_text(path, &xml) {
            Ok(()) => exit,
            Err(error) => {
                output.complain(&format!("failed to write {}: {error}", path.display()));
                exit.with_rig_error()
            }
        }
    }
}
