//! The header, and the lines one after another.

use super::step;
use super::words::{deviation, named, required};
use crate::bus_name::BusName;
use crate::link::Capability;
use crate::scenario::language::Language;
use crate::scenario::problem::{Problem, Problems, Spanned, TextSpan};
use crate::scenario::scanner::Scanner;
use crate::scenario::source::Source;
use crate::scenario::syntax::{Action, Citation, Scenario, Step};
use crate::scenario::times;
use harness_sim::deviation::{Deviation, DeviationTable};

/// The most lines of a scenario.
const MAX_LINES: usize = 20_000;

/// Words with which header lines of every bus begin.
pub const WORDS: [&str; 6] = ["title", "source", "bus", "needs", "strict", "deadline"];

/// How much of a scenario must be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Whole,
    /// Any lines of a header; steps may follow.
    Header,
}

/// Reads a scenario.
///
/// # Errors
/// Every line that is no line of the language, or a header that is not complete.
pub fn parse<L: Language>(source: &Source) -> Result<Scenario<L>, Problems> {
    read(source, Part::Whole)
}

/// The bus that a `bus` line names; a bus that no line names or that is not known counts as [`BusName::DEFAULT`].
pub fn bus(source: &Source) -> BusName {
    let named = source.text.lines().find_map(|line| {
        let mut words = line.split(['#']).next()?.split_whitespace();
        let is_bus = words.next() == Some("bus");
        words.next().filter(|_| is_bus)
    });
    let known = BusName::NAMES.iter().find(|(name, _)| Some(*name) == named);
    known.map_or(BusName::DEFAULT, |(_, bus)| *bus)
}

/// Reads one line as a step, whatever precedes it.
///
/// # Errors
/// The line is no step.
pub fn parse_step<L: Language>(source: &Source) -> Result<Step<L>, Problems> {
    let comment = L::comment(&source.text);
    step::step(&mut Scanner::up_to(&source.text, comment, 0))
        .map_err(|problem| Problems::new(&source.name, source.text.clone(), vec![problem]))
}

/// Reads a scenario or its header.
///
/// # Errors
/// As of [`parse`].
pub fn read<L: Language>(source: &Source, part: Part) -> Result<Scenario<L>, Problems> {
    let mut reader = ScenarioReader::<L>::new();
    let mut offset = 0;
    for (number, line) in source.text.split('\n').enumerate() {
        if number == MAX_LINES {
            reader.problems.push(Problem::new(
                TextSpan {
                    start: offset,
                    end: offset,
                },
                format!("the scenario has more than {MAX_LINES} lines"),
                "the end of the file expected here",
            ));
            break;
        }
        let text = line.strip_suffix('\r').unwrap_or(line);
        let scanner = Scanner::up_to(text, L::comment(text), offset);
        if let Err(problem) = reader.line(scanner) {
            reader.problems.push(problem);
        }
        offset += line.len() + 1;
    }
    reader
        .finish(part)
        .map_err(|problems| Problems::new(&source.name, source.text.clone(), problems))
}

struct ScenarioReader<L: Language> {
    title: Option<String>,
    sources: Vec<Citation>,
    bus: Option<Spanned<BusName>>,
    header: L::Header,
    needs: Vec<Capability>,
    strict: bool,
    deadline: Option<times::Duration>,
    steps: Vec<Step<L>>,
    problems: Vec<Problem>,
}

impl<L: Language> ScenarioReader<L> {
    fn new() -> Self {
        Self {
            title: None,
            sources: Vec::new(),
            bus: None,
            header: L::Header::default(),
            needs: Vec::new(),
            strict: false,
            deadline: None,
            steps: Vec::new(),
            problems: Vec::new(),
        }
    }

    fn line(&mut self, mut scanner: Scanner<'_>) -> Result<(), Problem> {
        if scanner.at_end() {
            return Ok(());
        }
        let before = scanner.clone();
        let word = scanner.word();
        let begun = !self.steps.is_empty();
        if let Some(word) = &word {
            if WORDS.contains(&word.value) {
                return match begun {
                    true => Err(step::header_too_late(word.span, word.value)),
                    false => self.header(word, &mut scanner),
                };
            }
            if let Some(read) = L::header(word, &mut scanner, &mut self.header, begun) {
                return read;
            }
        }
        scanner = before;
        self.steps.push(step::step(&mut scanner)?);
        Ok(())
    }

    fn header(&mut self, word: &Spanned<&str>, scanner: &mut Scanner<'_>) -> Result<(), Problem> {
        match word.value {
            "title" => {
                let text = scanner.rest().to_owned();
                if text.is_empty() {
                    return Err(scanner.unexpected("a title"));
                }
                once(&mut self.title, text, word)
            }
            "source" => {
                self.sources.push(citation(scanner, L::SOURCE)?);
                Ok(())
            }
            "bus" => {
                let here = scanner.here();
                let value = match scanner.eat_word(L::NAME) {
                    true => L::BUS,
                    false => named(scanner, &BusName::NAMES, "a bus")?,
                };
                let span = scanner.since(here);
                scanner.expect_end()?;
                once(&mut self.bus, Spanned { value, span }, word)
            }
            "needs" => {
                while !scanner.at_end() {
                    let capability = named(scanner, &Capability::NAMES, "a capability")?;
                    self.needs.push(capability);
                    scanner.eat(",");
                }
                Ok(())
            }
            "strict" => {
                self.strict = true;
                scanner.expect_end()
            }
            _ => {
                let deadline = times::duration(scanner)?;
                scanner.expect_end()?;
                once(&mut self.deadline, deadline, word)
            }
        }
    }

    fn finish(mut self, part: Part) -> Result<Scenario<L>, Vec<Problem>> {
        let other = self.bus.as_ref().filter(|named| named.value != L::BUS);
        if let (Part::Header, Some(other)) = (part, other) {
            self.problems.push(for_another_bus(other, L::BUS));
        }
        let bus = self.bus.map_or(BusName::DEFAULT, |named| named.value);
        if part == Part::Whole && self.problems.is_empty() {
            let no_step = self.steps.is_empty().then(|| no_step(L::EXAMPLE));
            self.problems
                .extend(L::incomplete(&self.header).or(no_step));
        }
        self.problems.extend(broken_loop(&self.steps));
        if !self.problems.is_empty() {
            return Err(self.problems);
        }
        Ok(Scenario {
            title: self.title.unwrap_or_default(),
            sources: self.sources,
            bus,
            header: self.header,
            needs: self.needs,
            strict: self.strict,
            deadline: self.deadline,
            steps: self.steps,
        })
    }
}

/// Reads lines of a header, which need not be complete.
///
/// # Errors
/// Every line that cannot be understood, and every step.
pub fn header_lines<L: Language>(source: &Source) -> Result<L::Header, Problems> {
    let scenario: Scenario<L> = read(source, Part::Header)?;
    let problems: Vec<_> = scenario.steps.iter().map(no_header_line).collect();
    match problems.is_empty() {
        true => Ok(scenario.header),
        false => Err(Problems::new(&source.name, source.text.clone(), problems)),
    }
}

fn no_header_line<L: Language>(step: &Step<L>) -> Problem {
    let what = "this is a step, and only header lines are allowed here";
    let expected = format!(
        "a line of a header expected here, such as {}",
        L::HEADER_EXAMPLE
    );
    Problem::new(step.span, what, expected)
}

fn for_another_bus(named: &Spanned<BusName>, wanted: BusName) -> Problem {
    let what = format!("these drives are on the bus `{}`", wanted.name());
    let expected = format!("no `bus` line, or `bus {}`, expected here", wanted.name());
    Problem::new(named.span, what, expected)
}

fn no_step(example: &str) -> Problem {
    let what = "the scenario has no step";
    let problem = Problem::new(TextSpan::default(), what, "a step expected");
    problem.help(format!("add a line such as {example}"))
}

/// The loop that has no `end`, or the `end` that has no loop.
fn broken_loop<L: Language>(steps: &[Step<L>]) -> Option<Problem> {
    let mut open = Vec::new();
    for step in steps {
        match step.action {
            Action::For(..) => open.push(step.span),
            Action::End if open.pop().is_none() => {
                let problem = Problem::new(
                    step.span,
                    "no loop begins above this `end`",
                    "a step expected here",
                );
                return Some(problem.help("`for k in 0..last` begins a loop"));
            }
            _ => {}
        }
    }
    let begin = open.pop()?;
    let problem = Problem::new(
        begin,
        "the loop has no `end` line",
        "an `end` line expected behind it",
    );
    Some(problem.help("the lines up to `end` are played for each number"))
}

/// Keeps the value of a line that may occur once.
///
/// # Errors
/// It is given twice.
pub fn once<T>(place: &mut Option<T>, value: T, word: &Spanned<&str>) -> Result<(), Problem> {
    if place.is_some() {
        return Err(given_twice(word));
    }
    *place = Some(value);
    Ok(())
}

/// Reads a line `master deviates NAME` with one of these names, which may stand once, above the first step.
///
/// # Errors
/// It names no deviation, or stands elsewhere or twice.
pub fn deviating_master<Injection>(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    place: &mut Option<&'static Deviation<Injection>>,
    begun: bool,
    table: &DeviationTable<Injection>,
) -> Result<(), Problem> {
    let line = Spanned {
        value: "master deviates",
        span: word.span,
    };
    if begun {
        let problem = step::behind_the_first(line.span, line.value);
        return Err(problem.help("move the line up, above the first step"));
    }
    required(scanner, &["deviates"])?;
    let value = deviation(scanner, table, "a master", "`master deviates NAME`")?;
    scanner.expect_end()?;
    once(place, value, &line)
}

/// A line that may be given once and is given twice.
pub fn given_twice(word: &Spanned<&str>) -> Problem {
    let what = format!("`{}` is given twice", word.value);
    Problem::new(word.span, what, "this line may appear only once")
}

fn citation(scanner: &mut Scanner<'_>, example: &str) -> Result<Citation, Problem> {
    let here = scanner.here();
    let text: Vec<_> = scanner.rest().split_whitespace().collect();
    let span = TextSpan {
        start: here.start,
        end: here.start + scanner.rest().len(),
    };
    if text.len() < 2 {
        return Err(Problem::new(
            span,
            "a source needs a document and a section",
            format!("a document and a section expected here, such as `{example}`"),
        ));
    }
    Ok(Citation {
        text: text.join(" "),
        span,
    })
}
