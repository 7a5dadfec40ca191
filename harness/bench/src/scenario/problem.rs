//! Mistakes in a scenario, shown with their line.

use super::source::line_number;
use crate::counted::counted;
use miette::{Diagnostic, NamedSource, SourceSpan};
use std::fmt;
use std::sync::Arc;

/// The most mistakes that one file is shown with; the first are the ones that matter.
const MAX_SHOWN: usize = 20;

/// A place in a scenario's text, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextSpan {
    pub start: usize,
    /// The byte after the last.
    pub end: usize,
}

impl TextSpan {
    /// From the start of this place to the end of another.
    #[must_use]
    pub fn to(self, other: Self) -> Self {
        Self {
            start: self.start,
            end: other.end.max(self.start),
        }
    }
}

impl From<TextSpan> for SourceSpan {
    fn from(span: TextSpan) -> Self {
        (span.start, span.end.saturating_sub(span.start)).into()
    }
}

/// A value with its place in the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    pub value: T,
    pub span: TextSpan,
}

/// One mistake: what is wrong, where, what was expected, and how to fix it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    pub message: String,
    pub span: TextSpan,
    /// What was expected there.
    pub expected: String,
    /// A suggestion.
    pub help: Option<String>,
}

impl Problem {
    /// A mistake at a place.
    #[must_use]
    pub fn new(span: TextSpan, message: impl Into<String>, expected: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            span,
            expected: expected.into(),
            help: None,
        }
    }

    /// What is wrong, what was expected, and the suggestion, in one line.
    pub fn sentence(&self) -> String {
        let mut text = self.message.clone();
        if !text.contains("expected") {
            text = format!("{text}; {}", self.expected);
        }
        match &self.help {
            Some(help) => format!("{text} ({help})"),
            None => text,
        }
    }

    /// The same with a suggestion.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// The same with another thing that may have been meant, where its help asks what was.
    #[must_use]
    pub fn or(mut self, other: &str) -> Self {
        if let Some(asked) = self.help.as_mut().filter(|help| help.ends_with('?')) {
            asked.truncate(asked.len() - 1);
            asked.push_str(&format!(" or {other}?"));
        }
        self
    }

    /// The same with the nearest of `known` suggested, if one is near.
    #[must_use]
    pub fn did_you_mean(self, found: &str, known: &[&str]) -> Self {
        match nearest(found, known) {
            Some(near) => self.help(format!("did you mean `{near}`?")),
            None => self,
        }
    }
}

/// The word among `known` that `found` most likely was meant to be.
#[must_use]
pub fn nearest<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let found = found.to_lowercase();
    known
        .iter()
        .map(|word| {
            (
                strsim::damerau_levenshtein(&found, &word.to_lowercase()),
                *word,
            )
        })
        .filter(|(distance, word)| *distance <= word.len().max(3) / 3)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, word)| word)
}

/// A scenario that cannot be played, with every mistake found in it.
#[derive(Debug)]
pub struct Problems {
    source: NamedSource<Arc<str>>,
    problems: Vec<Problem>,
    shown: Vec<ProblemReport>,
}

impl Problems {
    /// The mistakes found in the text `text` of the file `name`; at least one.
    #[must_use]
    pub fn new(name: &str, text: Arc<str>, problems: Vec<Problem>) -> Self {
        let source = NamedSource::new(name, text);
        let shown = problems
            .iter()
            .take(MAX_SHOWN)
            .map(|problem| ProblemReport {
                source: source.clone(),
                problem: problem.clone(),
            })
            .collect();
        Self {
            source,
            problems,
            shown,
        }
    }

    /// The mistakes, in order of their places.
    #[must_use]
    pub fn all(&self) -> &[Problem] {
        &self.problems
    }

    /// Each mistake on a line: `file:line: what is wrong; what was expected (help)`.
    pub fn lines(&self) -> String {
        let problems = self.problems.iter();
        let lines: Vec<_> = problems.map(|problem| self.line(problem)).collect();
        lines.join("\n")
    }

    fn line(&self, problem: &Problem) -> String {
        let number = line_number(self.source.inner(), problem.span.start);
        format!("{}:{number}: {}", self.source.name(), problem.sentence())
    }

    /// How many mistakes the file has, for a reader who has seen each of them.
    pub fn count(&self) -> String {
        let count = counted(self.problems.len(), "mistake");
        format!("{}: {count}", self.source.name())
    }

    /// Each mistake as something that can be shown.
    pub(crate) fn diagnostics(&self) -> impl Iterator<Item = &dyn Diagnostic> {
        self.shown.iter().map(|shown| shown as &dyn Diagnostic)
    }
}

/// The first mistake, and how many more there are.
impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problems.as_slice() {
            [] => f.write_str(&self.count()),
            [only] => f.write_str(&self.line(only)),
            [first, more @ ..] => {
                let more = counted(more.len(), "more mistake");
                write!(f, "{} (and {more})", self.line(first))
            }
        }
    }
}

impl std::error::Error for Problems {}

#[derive(Debug)]
struct ProblemReport {
    source: NamedSource<Arc<str>>,
    problem: Problem,
}

impl fmt::Display for ProblemReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for ProblemReport {}

impl Diagnostic for ProblemReport {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let help = self.problem.help.as_ref()?;
        Some(Box::new(help))
    }

    fn source_code(&self) -> Option<&dyn miette::SourceCode> {
        Some(&self.source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let label = miette::LabeledSpan::new_with_span(
            Some(self.problem.expected.clone()),
            self.problem.span,
        );
        Some(Box::new(std::iter::once(label)))
    }
}
