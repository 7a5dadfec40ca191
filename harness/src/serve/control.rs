//! Lines of control: what somebody does to the rings beside the client, in the words of the scenario language.

use super::server::Server;
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
    /// The check does not hold: `no: ` and what was found.
    No(String),
    /// The line cannot be done, and nothing has happened: `error: ` and why, with the column of a mistake.
    Error(String),
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("ok"),
            Self::No(found) => write!(f, "no: {found}"),
            Self::Error(why) => write!(f, "error: {why}"),
        }
    }
}

impl Server {
    /// Does a line of control at once: a fault (`! 98->97: flip 0`), something that happens to drives from outside the bus
    /// (`drive 3 input GPIN5 high`), or a check that looks at drives (`? drive 3 nist = 0rpm +-5rpm`). `None` for an empty line or a
    /// comment. Bytes and times in a fault are counted from the server's start.
    pub fn control(&mut self, line: &str) -> Option<Answer> {
        let said = line.split('#').next().unwrap_or_default().trim();
        if said.is_empty() {
            return None;
        }
        let source = match Source::from_bytes("control".to_owned(), line.trim_end().into()) {
            Ok(source) => source,
            Err(error) => return Some(Answer::Error(error.to_string())),
        };
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
}

/// The first mistake in a line, and where it stands: characters counted from 1.
fn first(line: &str, problems: &Problems) -> String {
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
