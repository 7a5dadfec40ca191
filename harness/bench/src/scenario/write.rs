//! Writes scenarios: `parse` reads back what was written as the same scenario.
//!
//! Everything that makes a scenario, from a fuzzing run to a capture, makes the values of [`syntax`](super::syntax) and leaves the text to
//! this file and to the buses' `write`.

use super::syntax::{Action, Scenario, Step, When};
use crate::bus_name::BusName;
use crate::scenario::language::Language;
use std::fmt::Write as _;
use std::marker::PhantomData;

/// The column at which a comment after a step begins, if the step is not longer.
const COMMENT_AT: usize = 32;

/// The longest line of a remark, in characters.
const MOST_REMARK: usize = 100;

/// A scenario as text.
#[must_use]
pub fn write<L: Language>(scenario: &Scenario<L>) -> String {
    let mut text = Text::<L>::default();
    text.header(scenario);
    text.empty_line();
    for step in &scenario.steps {
        text.step(step, "");
    }
    text.into()
}

/// The text of a scenario, line by line.
#[derive(Clone, Debug)]
pub struct Text<L: Language> {
    lines: String,
    bus: PhantomData<L>,
}

impl<L: Language> Default for Text<L> {
    fn default() -> Self {
        Self {
            lines: String::new(),
            bus: PhantomData,
        }
    }
}

impl<L: Language> From<Text<L>> for String {
    fn from(text: Text<L>) -> Self {
        text.lines
    }
}

impl<L: Language> Text<L> {
    /// Writes the header of a scenario.
    pub fn header(&mut self, scenario: &Scenario<L>) {
        if !scenario.title.is_empty() {
            self.word("title", &scenario.title);
        }
        for source in &scenario.sources {
            self.word("source", &source.text);
        }
        if L::NAME != BusName::DEFAULT.name() {
            self.word("bus", L::NAME);
        }
        let (words, devices) = L::write_header(&scenario.header);
        for (word, value) in words {
            self.word(word, &value);
        }
        if scenario.strict {
            self.line("strict");
        }
        if let Some(deadline) = scenario.deadline {
            self.word("deadline", &deadline.to_string());
        }
        if !scenario.needs.is_empty() {
            let needs: Vec<_> = scenario.needs.iter().map(|need| need.name()).collect();
            self.word("needs", &needs.join(", "));
        }
        for line in devices {
            self.line(&line);
        }
    }

    /// Writes a step, with a comment after it if that is not empty.
    pub fn step(&mut self, step: &Step<L>, comment: &str) {
        let step = written(step);
        // Writing to a String cannot fail.
        let _infallible = match comment {
            "" => writeln!(self.lines, "{step}"),
            _ => writeln!(self.lines, "{step:<COMMENT_AT$} # {comment}"),
        };
    }

    /// Writes a remark, on as many lines as it needs.
    pub fn remark(&mut self, remark: &str) {
        let mut line = String::new();
        for word in remark.split_whitespace() {
            if !line.is_empty() && line.len() + word.len() >= MOST_REMARK {
                self.line(&format!("# {line}"));
                line.clear();
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
        self.line(&format!("# {line}"));
    }

    pub fn empty_line(&mut self) {
        self.line("");
    }

    fn word(&mut self, word: &str, value: &str) {
        self.line(&format!("{word:<7} {value}"));
    }

    fn line(&mut self, line: &str) {
        self.lines.push_str(line);
        self.lines.push('\n');
    }
}

/// A step as text.
fn written<L: Language>(step: &Step<L>) -> String {
    let when = match step.when {
        When::Now => String::new(),
        When::After(window) => format!("+{window} "),
        When::At(window) => format!("@{window} "),
    };
    let side = |port: usize| match port {
        0 => String::new(),
        port => (port + 1).to_string(),
    };
    let action = match &step.action {
        Action::Send { port, message } => format!("{}> {}", side(*port), L::write_message(message)),
        Action::Receive { port, message } => {
            format!("{}< {}", side(*port), L::write_message(message))
        }
        Action::Wait(time) => format!("wait {time}"),
        Action::For(counter, from, to) => format!("for {counter} in {from}..{to}"),
        Action::End => "end".to_owned(),
        Action::Own(step) => L::write_step(step),
    };
    when + &action
}
