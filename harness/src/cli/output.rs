//! The two streams of the program, and how mistakes are shown on the second.

use super::args::{Progress, When};
use super::exit::Exit;
use crate::library::LibraryError;
use crate::scenario::problem::Problems;
use crate::scenario::verdict::Verdict;
use miette::{GraphicalReportHandler, GraphicalTheme};
use std::io::{IsTerminal, Write};

/// Where results and messages go.
pub(crate) struct Output {
    colour_out: bool,
    colour_err: bool,
    pub(crate) progress: bool,
    /// Standard output is a terminal.
    pub(crate) terminal: bool,
}

impl Output {
    pub(crate) fn new(color: When, progress: Progress) -> Self {
        let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        let colour = |terminal: bool| match color {
            When::Always => true,
            When::Never => false,
            When::Auto => terminal && !no_color,
        };
        let err = std::io::stderr().is_terminal();
        let terminal = std::io::stdout().is_terminal();
        Self {
            colour_out: colour(terminal),
            colour_err: colour(err),
            progress: match progress {
                Progress::Auto => err,
                Progress::Bar => true,
                Progress::None => false,
            },
            terminal,
        }
    }

    /// Whether what goes to standard output may have colours.
    pub(crate) const fn colours(&self) -> bool {
        self.colour_out
    }

    /// Writes a result.
    pub(crate) fn result(&mut self, text: &str) -> std::io::Result<()> {
        let mut out = std::io::stdout().lock();
        unless_closed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
    }

    /// Writes a message for people.
    pub(crate) fn complain(&mut self, text: &str) {
        let label = paint("error", "1;31", self.colour_err);
        self.say(&format!("{label}: {text}\n"));
    }

    /// Reports that standard output or a file cannot be written to, and returns the exit code for it.
    pub(crate) fn unwritable(&mut self, error: &std::io::Error) -> Exit {
        self.complain(&format!("failed to write: {error}"));
        Exit::RigError
    }

    /// Writes to standard error; a failure is ignored, because a closed standard error means that no one reads it.
    pub(crate) fn say(&mut self, text: &str) {
        let _unwritable = std::io::stderr().lock().write_all(text.as_bytes());
    }

    /// Shows every mistake of a scenario with its line.
    pub(crate) fn mistakes(&mut self, problems: &Problems) {
        let theme = if self.colour_err {
            GraphicalTheme::unicode()
        } else {
            GraphicalTheme::unicode_nocolor()
        };
        let handler = GraphicalReportHandler::new_themed(theme).with_width(100);
        for diagnostic in problems.diagnostics() {
            let mut text = String::new();
            if handler.render_report(&mut text, diagnostic).is_ok() {
                self.say(&(text + "\n"));
            }
        }
        self.complain(&problems.to_string());
    }

    /// Shows why a scenario cannot be loaded.
    pub(crate) fn library_error(&mut self, error: &LibraryError) {
        match error {
            LibraryError::Mistakes(problems) => self.mistakes(problems),
            other => self.complain(&other.to_string()),
        }
    }

    /// A verdict for standard output, padded.
    pub(crate) fn verdict(&self, verdict: Verdict) -> String {
        let colour = match verdict {
            Verdict::Passed => "32",
            Verdict::Skipped | Verdict::Marginal => "33",
            Verdict::Flaky | Verdict::Inconclusive => "35",
            Verdict::Failed | Verdict::Aborted | Verdict::RigError => "1;31",
        };
        paint(&format!("{verdict:12}"), colour, self.colour_out)
    }
}

/// The reader of a pipe that has seen enough (`drivebench run | head`) is no failure, and does not change
/// the exit code.
pub(crate) fn unless_closed(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

fn paint(text: &str, colour: &str, on: bool) -> String {
    if on {
        format!("\x1b[{colour}m{text}\x1b[0m")
    } else {
        text.to_owned()
    }
}
