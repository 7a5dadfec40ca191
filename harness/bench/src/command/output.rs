//! The two streams of the program, and how mistakes are shown on the second.

use super::args::{ColourWhen, ShowProgress};
use super::exit::Exit;
use crate::scenario::files::LibraryError;
use crate::scenario::problem::Problems;
use crate::scenario::verdict::Verdict;
use crate::serve::ServeHost;
use miette::{GraphicalReportHandler, GraphicalTheme};
use std::io::{IsTerminal, Write};

/// Where results and messages go.
pub struct Output {
    colour_out: bool,
    colour_err: bool,
    pub progress: bool,
    /// Standard output is a terminal.
    pub terminal: bool,
    /// The terminal on standard output can move its cursor.
    pub full_screen: bool,
    /// The columns of the terminal on standard output.
    width: Option<usize>,
    /// Results and messages, where they are collected for an answer in place of being written.
    collected: Option<[String; 2]>,
    /// Takes results and messages in place of the streams of the process.
    given: Option<Taker>,
}

/// Takes a text.
type Taker = Box<dyn Fn(Stream, &str)>;

/// What a text is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// A result: standard output.
    Result,
    /// A message for people: standard error.
    Message,
}

/// Maximum bytes that are collected of results, and of messages.
const MOST_COLLECTED: usize = 4 << 20;

/// What the streams of the process are, and what its environment says of colours.
struct Streams {
    out_is_terminal: bool,
    err_is_terminal: bool,
    /// `NO_COLOR` is set and not empty.
    no_color: bool,
    /// `TERM` is `dumb`: the terminal knows no escape sequences.
    dumb: bool,
    width: Option<usize>,
}

impl Streams {
    fn of_process() -> Self {
        let out = std::io::stdout();
        let size = rustix::termios::tcgetwinsize(&out).ok();
        let columns = size.map(|size| usize::from(size.ws_col));
        Self {
            out_is_terminal: out.is_terminal(),
            err_is_terminal: std::io::stderr().is_terminal(),
            no_color: std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty()),
            dumb: std::env::var_os("TERM").is_some_and(|term| term == "dumb"),
            // A serial console may report 0 columns.
            width: columns.filter(|columns| *columns > 0),
        }
    }
}

/// Colours of usage errors and help, which appear before `--color` is known: none by `NO_COLOR` and `TERM=dumb`, even where `CI` is set.
pub fn colour_of_usage() -> clap::ColorChoice {
    let streams = Streams::of_process();
    if streams.no_color || streams.dumb {
        clap::ColorChoice::Never
    } else {
        clap::ColorChoice::Auto
    }
}

impl Output {
    pub fn new(color: ColourWhen, progress: ShowProgress) -> Self {
        Self::on(&Streams::of_process(), color, progress)
    }

    fn on(streams: &Streams, color: ColourWhen, progress: ShowProgress) -> Self {
        let colour = |terminal: bool| match color {
            ColourWhen::Always => true,
            ColourWhen::Never => false,
            ColourWhen::Auto => terminal && !streams.no_color && !streams.dumb,
        };
        Self {
            colour_out: colour(streams.out_is_terminal),
            colour_err: colour(streams.err_is_terminal),
            progress: match progress {
                ShowProgress::Auto => streams.err_is_terminal && !streams.dumb,
                ShowProgress::Bar => true,
                ShowProgress::None => false,
            },
            terminal: streams.out_is_terminal,
            full_screen: streams.out_is_terminal && !streams.dumb,
            width: streams.width.filter(|_| streams.out_is_terminal),
            collected: None,
            given: None,
        }
    }

    /// Collects results and messages for an answer.
    pub fn collecting() -> Self {
        Self {
            colour_out: false,
            colour_err: false,
            progress: false,
            terminal: false,
            full_screen: false,
            width: None,
            collected: Some(Default::default()),
            given: None,
        }
    }

    /// Gives results and messages to `take` from now on. The screen is not its own: there is no progress and no full screen.
    pub fn given_to(self, take: impl Fn(Stream, &str) + 'static) -> Self {
        Self {
            progress: false,
            full_screen: false,
            given: Some(Box::new(take)),
            ..self
        }
    }

    /// The results and messages collected since the last call.
    pub fn take_collected(&mut self) -> [String; 2] {
        self.collected
            .as_mut()
            .map(std::mem::take)
            .unwrap_or_default()
    }

    /// The results collected so far.
    pub fn collected_result(&self) -> &str {
        self.collected.as_ref().map_or("", |streams| &streams[0])
    }

    /// Keeps a text where texts are collected; of too long ones their beginning.
    fn collect(&mut self, stream: Stream, text: &str) -> bool {
        let Some(collected) = &mut self.collected else {
            return false;
        };
        if collected[stream as usize].len() < MOST_COLLECTED {
            collected[stream as usize].push_str(text);
        }
        true
    }

    fn give(&self, stream: Stream, text: &str) -> bool {
        let Some(take) = &self.given else {
            return false;
        };
        take(stream, text);
        true
    }

    /// Lines that fit the terminal: the words that do not fit go on in indented lines. A pipe or a file gets the lines as they are.
    pub fn fitted(&self, text: &str) -> String {
        match self.width {
            Some(width) => text
                .split_inclusive('\n')
                .map(|line| folded(line, width))
                .collect(),
            None => text.to_owned(),
        }
    }

    /// Whether what goes to standard output may have colours.
    pub(crate) const fn colours(&self) -> bool {
        self.colour_out
    }

    /// Writes a result.
    pub fn result(&mut self, text: &str) -> std::io::Result<()> {
        if self.collect(Stream::Result, text) || self.give(Stream::Result, text) {
            return Ok(());
        }
        let mut out = std::io::stdout().lock();
        unless_closed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
    }

    /// Writes a message for people.
    pub fn complain(&mut self, text: &str) {
        let label = paint("error", "1;31", self.colour_err);
        self.say(&format!("{label}: {text}\n"));
    }

    /// Reports that standard output or a file cannot be written to, and returns the exit code for it.
    pub fn unwritable(&mut self, error: &std::io::Error) -> Exit {
        self.complain(&format!("failed to write: {error}"));
        Exit::RigError
    }

    /// Writes to standard error; a failure is ignored, because a closed standard error means that no one reads it.
    pub fn say(&mut self, text: &str) {
        if self.collect(Stream::Message, text) || self.give(Stream::Message, text) {
            return;
        }
        let _unwritable = std::io::stderr().lock().write_all(text.as_bytes());
    }

    /// Shows every mistake of a scenario with its line.
    pub fn mistakes(&mut self, problems: &Problems) {
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
        self.complain(&problems.count());
    }

    /// Shows why a scenario cannot be loaded.
    pub fn library_error(&mut self, error: &LibraryError) {
        match error {
            LibraryError::Mistakes(problems) => self.mistakes(problems),
            other => self.complain(&other.to_string()),
        }
    }

    /// A verdict for standard output, padded.
    pub fn verdict(&self, verdict: Verdict) -> String {
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
pub fn unless_closed(result: std::io::Result<()>) -> std::io::Result<()> {
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

/// A line with line breaks in place of the spaces at which it would pass the width. A word that is wider stays whole.
fn folded(line: &str, width: usize) -> String {
    const INDENT: &str = "    ";
    let mut text = String::new();
    let mut rest = line.to_owned();
    let mut indent = "";
    loop {
        let room = width.saturating_sub(indent.len()).max(1);
        let Some(at) = break_at(&rest, room) else {
            return text + indent + &rest;
        };
        text = text + indent + rest[..at].trim_end() + "\n";
        rest = rest[at..].trim_start().to_owned();
        // Columns do not go on in the next line, so their padding is not needed there.
        while rest.contains("   ") {
            rest = rest.replace("   ", "  ");
        }
        indent = INDENT;
    }
}

/// The space at which a line that is wider than `room` is broken; `None` if it fits, or has no such space.
fn break_at(line: &str, room: usize) -> Option<usize> {
    let line = line.trim_end();
    let (end, past) = line.char_indices().nth(room)?;
    let start = line.len() - line.trim_start().len();
    // The space may stand directly behind the last column.
    let before = line[..end + past.len_utf8()]
        .rfind(' ')
        .filter(|at| *at > start);
    before.or_else(|| line[end..].find(' ').map(|at| end + at))
}

/// A table with a heading; each column is as wide as what stands in it.
pub fn columns(heading: &[&str], rows: &[impl AsRef<[String]>]) -> String {
    let mut widths: Vec<_> = heading.iter().map(|title| title.len()).collect();
    for row in rows {
        for (width, cell) in widths.iter_mut().zip(row.as_ref()) {
            *width = cell.chars().count().max(*width);
        }
    }
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let padded: Vec<_> = cells
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"))
            .collect();
        format!("{}\n", padded.join("  ").trim_end())
    };
    let mut text = line(&mut heading.iter().copied());
    for row in rows {
        text.push_str(&line(&mut row.as_ref().iter().map(String::as_str)));
    }
    text
}

impl ServeHost for Output {
    fn tell(&mut self, line: &str) -> std::io::Result<()> {
        self.result(&format!("{line}\n"))
    }

    fn say(&mut self, line: &str) {
        Self::say(self, &format!("{line}\n"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn terminal() -> Streams {
        Streams {
            out_is_terminal: true,
            err_is_terminal: true,
            no_color: false,
            dumb: false,
            width: Some(20),
        }
    }

    fn output(streams: &Streams, color: ColourWhen) -> (bool, bool, bool) {
        let output = Output::on(streams, color, ShowProgress::Auto);
        assert_eq!(output.colour_out, output.colour_err);
        (output.colour_out, output.progress, output.full_screen)
    }

    #[test]
    fn colours_need_a_terminal_that_knows_them() {
        assert_eq!(output(&terminal(), ColourWhen::Auto), (true, true, true));
        let no_color = Streams {
            no_color: true,
            ..terminal()
        };
        assert_eq!(output(&no_color, ColourWhen::Auto), (false, true, true));
        let dumb = Streams {
            dumb: true,
            ..terminal()
        };
        assert_eq!(output(&dumb, ColourWhen::Auto), (false, false, false));
        assert_eq!(output(&dumb, ColourWhen::Always), (true, false, false));
        assert_eq!(output(&terminal(), ColourWhen::Never), (false, true, true));
    }

    #[test]
    fn lines_fit_the_terminal() {
        let output = Output::on(&terminal(), ColourWhen::Auto, ShowProgress::Auto);
        for (line, fitted) in [
            ("short\n", "short\n"),
            ("exactly twenty chars\n", "exactly twenty chars\n"),
            (
                "name    100 drives  a title of many words\n",
                "name    100 drives\n    a title of many\n    words\n",
            ),
            (
                "  a_word_that_is_too_wide_for_it and more\n",
                "  a_word_that_is_too_wide_for_it\n    and more\n",
            ),
            (
                "ümläute ümläute ümläute\n",
                "ümläute ümläute\n    ümläute\n",
            ),
            ("1234567890123456789012345\n", "1234567890123456789012345\n"),
        ] {
            assert_eq!(output.fitted(line), fitted);
        }
        let file = Streams {
            out_is_terminal: false,
            ..terminal()
        };
        let line = "name    100 drives  a title of many words\n";
        assert_eq!(
            Output::on(&file, ColourWhen::Auto, ShowProgress::Auto).fitted(line),
            line
        );
    }
}
