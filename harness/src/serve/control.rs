//! Lines of control: they act on the rings beside the client, in the words of the scenario language.

use super::server::Server;
use crate::buses;
use crate::scenario::argument;
use crate::scenario::parse::parse_step;
use crate::scenario::plan::plan_step;
use crate::scenario::problem::Problems;
use crate::scenario::run::{Now, now};
use crate::scenario::source::Source;
use std::fmt;

/// The answer to a line of control. As a text it is one line without its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// It is done, or the check holds: `ok`.
    Ok,
    /// What was asked for: `ok ` and the state of a drive, `name=value` with a space between.
    State(String),
    /// The check does not hold: `no: ` and what was found.
    No(String),
    /// The line cannot be done, and nothing has happened: `error: ` and why, with the column of a mistake.
    Error(String),
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("ok"),
            Self::State(state) => write!(f, "ok {state}"),
            Self::No(found) => write!(f, "no: {found}"),
            Self::Error(why) => write!(f, "error: {why}"),
        }
    }
}

impl Server {
    /// Does a line of control at once: a fault (`! 98->97: flip 0`), something that happens to drives from outside the bus
    /// (`drive 3 input GPIN5 high`), or a check that looks at drives (`? drive 3 nist = 0rpm +-5rpm`). `state 3` asks what a drive
    /// shows outside the bus, `state 2:3 nist FF08:2` for cells of it, in hexadecimal digits. `None` for an empty line or a comment. Bytes and times in a fault are counted from the server's start.
    pub fn control(&mut self, line: &str) -> Option<Answer> {
        let said = line.split('#').next().unwrap_or_default().trim();
        if said.is_empty() {
            return None;
        }
        let source = match Source::from_bytes("control".to_owned(), line.trim_end().into()) {
            Ok(source) => source,
            Err(error) => return Some(Answer::Error(error.to_string())),
        };
        let mut words = said.split_whitespace().map(str::to_owned);
        if words.next().as_deref() == Some("state") {
            let state = self.state(words.next().as_deref(), &words.collect::<Vec<_>>());
            return Some(state.map_or_else(Answer::Error, Answer::State));
        }
        let step = parse_step(&source).and_then(|step| plan_step(&self.plan, &step, &source));
        Some(match step {
            Err(problems) => Answer::Error(first(&source.text, &problems)),
            Ok(step) => match now(&self.plan, &mut self.link, &step) {
                Now::Done => Answer::Ok,
                Now::Otherwise(found) => Answer::No(found),
                Now::Refused(why) => Answer::Error(why.to_owned()),
            },
        })
    }

    /// What a drive shows, or what these of its cells hold.
    fn state(&self, drive: Option<&str>, cells: &[String]) -> Result<String, String> {
        let (ring, number) = match drive.and_then(|drive| drive.split_once(':')) {
            Some(("1", number)) => (0, Some(number)),
            Some(("2", number)) => (1, Some(number)),
            Some(_) => (usize::MAX, None),
            None => (0, drive),
        };
        let drive = number
            .and_then(|number| number.parse::<u8>().ok())
            .filter(|drive| *drive < self.drives(ring))
            .ok_or("`state` and a drive of the bench expected: `state 3`, `state 2:3` in the second ring")?;
        let cells = argument::cells(cells).map_err(|problems| first("", &problems))?;
        buses::state_of(&self.link, ring, drive, &cells)
    }
}

/// The first mistake in a line, and where it stands: characters counted from 1.
pub(crate) fn first(line: &str, problems: &Problems) -> String {
    let Some(problem) = problems.all().first() else {
        return problems.to_string();
    };
    let before = line.get(..problem.span.start).unwrap_or(line);
    let column = before.chars().count() + 1;
    let mut text = format!("column {column}: {}", problem.message);
    let wanted = problem.expected.trim_end_matches(" expected here");
    let more = (!text.contains(wanted)).then_some(&problem.expected);
    for part in more.into_iter().chain(&problem.help) {
        text = format!("{text}; {part}");
    }
    text
}
