//! A scenario on simulated rings, from another program.

use super::Error;
use crate::command::play::{PlayedOnce, play_entry};
use crate::counted::counted;
use crate::library::Entry;
use crate::library::page::page;
use crate::scenario::files::sources;
use crate::scenario::run::AtMismatch;
use crate::scenario::source::{Source, line_number};
use crate::scenario::verdict::Verdict;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// A scenario that has been read and settled for rings of one size: a conversation with a bus in the manual's own notation.
#[derive(Debug)]
pub struct Scenario {
    entry: Entry,
}

impl Scenario {
    /// Reads a file, or a built-in scenario by its name, such as `9.7-100-axis-parity-error`.
    ///
    /// # Errors
    /// There is no such file or scenario, or it has mistakes.
    pub fn read(name: impl AsRef<Path>) -> Result<Self, Error> {
        let found = sources(&[name.as_ref().to_owned()])?;
        match <[Source; 1]>::try_from(found) {
            Ok([source]) => Self::settled(source, None),
            Err(several) => Err(Error::NotFound(format!(
                "{}: {}, and one is expected here",
                name.as_ref().display(),
                counted(several.len(), "scenario")
            ))),
        }
    }

    /// Reads a text; `name` stands in front of its mistakes.
    ///
    /// # Errors
    /// It has mistakes.
    pub fn parse(name: &str, text: &str) -> Result<Self, Error> {
        let source = Source::from_bytes(name.to_owned(), text.as_bytes().to_vec())?;
        Self::settled(source, None)
    }

    /// The same scenario for a ring of this many drives, 1 to 250, where its `ring` line allows several sizes.
    ///
    /// # Errors
    /// It is for other sizes, or one of its lines cannot be on a ring of this size.
    pub fn for_drives(self, drives: u8) -> Result<Self, Error> {
        Self::settled(self.entry.source, Some(drives))
    }

    fn settled(source: Source, drives: Option<u8>) -> Result<Self, Error> {
        let entry = Entry::new(source, drives)?;
        match entry.settled.rings() {
            Some(_) => Ok(Self { entry }),
            None => Err(Error::Mistake(format!(
                "{}: drives of the bus `{}` cannot be simulated yet",
                entry.name,
                entry.scenario.bus.name()
            ))),
        }
    }

    /// The title, which its first line gives.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.entry.scenario.title
    }

    /// Plays it on simulated rings, made new for it, in virtual time. Two runs give the same bytes at the same times.
    #[must_use]
    pub fn play(&self) -> Played {
        let PlayedOnce { outcome, traces } = play_entry(&self.entry, AtMismatch::Stop);
        Played {
            verdict: outcome.verdict,
            mismatch: outcome.finding.as_ref().map(|found| {
                let line = line_number(&self.entry.source.text, found.span.start);
                format!("{}:{line}: {}", self.entry.name, found.message)
            }),
            took: Duration::from_nanos(outcome.took.as_nanos()),
            page: page(&self.entry, &outcome, &traces),
        }
    }
}

/// What came of a scenario. It is shown as the page that `drivebench run` keeps: the verdict, and every byte on every link.
#[derive(Clone, Debug)]
pub struct Played {
    verdict: Verdict,
    mismatch: Option<String>,
    took: Duration,
    page: String,
}

impl Played {
    /// The verdict. [`Verdict::Passed`] means that everything was as the scenario says.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// The first line that was not met: `file:line: what was expected and what came`.
    #[must_use]
    pub fn mismatch(&self) -> Option<&str> {
        self.mismatch.as_deref()
    }

    /// How long the conversation took on the line.
    #[must_use]
    pub fn took(&self) -> Duration {
        self.took
    }
}

impl fmt::Display for Played {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.page)
    }
}
