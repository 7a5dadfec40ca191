//! The header, and the lines one after another.

use super::drive::{self, DriveLine};
use super::step;
use super::words::{master_deviates, named};
use crate::link::Capability;
use crate::scenario::problem::{Problem, Problems, Span, Spanned};
use crate::scenario::scanner::Scanner;
use crate::scenario::source::Source;
use crate::scenario::syntax::{
    Action, Bus, Citation, RingRange, Scenario, Setup, SetupKind, Step, When,
};
use crate::scenario::times;
use harness_proto::line::Rate;
use harness_proto::novobus::address::{MAX_DRIVES, RingSize};
use harness_sim::novobus::deviation::MasterDeviation;

/// The most lines of a scenario.
const MAX_LINES: usize = 20_000;

/// The word behind `master` that makes a header line of it.
pub(crate) const DEVIATES: &str = "deviates";

const HEADER_WORDS: [&str; 8] = [
    "title", "source", "bus", "ring", "needs", "line", "strict", "deadline",
];

/// Reads a scenario.
///
/// # Errors
/// Every line that is no line of the language, or a header that is not complete.
pub fn parse(source: &Source) -> Result<Scenario, Problems> {
    read(source, Reader::default())
}

/// Reads the header of a scenario: what drives are before anything is sent. Its steps are left out, once it
/// is sure that they are steps; it needs none, and no `ring` line where `rings` are given.
///
/// # Errors
/// As of [`parse`].
pub fn parse_setup(source: &Source, rings: &[u8]) -> Result<Scenario, Problems> {
    let mut scenario = read(source, Reader::for_rings(rings))?;
    scenario.steps.clear();
    Ok(scenario)
}

/// Reads the header of rings of these sizes, where no step may stand.
///
/// # Errors
/// Every line that cannot be understood, every step, and a `ring` line for other sizes.
pub fn parse_header(source: &Source, rings: &[u8]) -> Result<Scenario, Problems> {
    let mut scenario = read(source, Reader::for_rings(rings))?;
    let mut problems = Vec::new();
    for step in scenario.steps.drain(..) {
        let what = "this is a step, and nothing is played here";
        let expected = "a line of a header expected here, such as `drive 1 input GPIN3 high`";
        problems.push(Problem::new(step.span, what, expected));
    }
    let fits = |(range, size): (&RingRange, &u8)| (range.smallest..=range.largest).contains(size);
    let same = scenario.rings.len() == rings.len();
    if !same || !scenario.rings.iter().zip(rings).all(fits) {
        let sizes: Vec<_> = rings.iter().map(u8::to_string).collect();
        let what = format!("the rig has {} drives", sizes.join(" and "));
        let span = scenario.rings.first().map_or(Span::default(), |r| r.span);
        problems.push(Problem::new(
            span,
            what,
            "no `ring` line, or its sizes, expected here",
        ));
    }
    if !problems.is_empty() {
        return Err(Problems::new(&source.name, source.text.clone(), problems));
    }
    for (range, size) in scenario.rings.iter_mut().zip(rings) {
        range.default = *size;
    }
    Ok(scenario)
}

/// Reads one line as a step, whatever stands before it.
///
/// # Errors
/// The line is no step.
pub fn parse_step(source: &Source) -> Result<Step, Problems> {
    step::step(&mut Scanner::new(&source.text, 0))
        .map_err(|problem| Problems::new(&source.name, source.text.clone(), vec![problem]))
}

fn read(source: &Source, mut reader: Reader) -> Result<Scenario, Problems> {
    let mut offset = 0;
    for (number, line) in source.text.split('\n').enumerate() {
        if number == MAX_LINES {
            reader.problems.push(Problem::new(
                Span {
                    start: offset,
                    end: offset,
                },
                format!("the scenario has more than {MAX_LINES} lines"),
                "the end of the file expected here",
            ));
            break;
        }
        let text = line.strip_suffix('\r').unwrap_or(line);
        if let Err(problem) = reader.line(Scanner::new(text, offset)) {
            reader.problems.push(problem);
        }
        offset += line.len() + 1;
    }
    reader
        .finish()
        .map_err(|problems| Problems::new(&source.name, source.text.clone(), problems))
}

#[derive(Default)]
struct Reader {
    title: Option<String>,
    sources: Vec<Citation>,
    bus: Option<Bus>,
    rings: Option<Vec<RingRange>>,
    rate: Option<Rate>,
    setups: Vec<Setup>,
    master: Option<Spanned<&'static MasterDeviation>>,
    needs: Vec<Capability>,
    strict: bool,
    deadline: Option<times::Duration>,
    steps: Vec<Step>,
    problems: Vec<Problem>,
    /// Only the header is wanted; these are its rings where it does not say.
    setup: Option<Vec<RingRange>>,
}

impl Reader {
    /// Of a header whose rings have these sizes where it does not say.
    fn for_rings(rings: &[u8]) -> Self {
        let range = |drives: &u8| RingRange {
            smallest: *drives,
            largest: *drives,
            default: *drives,
            span: Span::default(),
        };
        Self {
            setup: Some(rings.iter().map(range).collect()),
            ..Self::default()
        }
    }

    fn line(&mut self, mut scanner: Scanner<'_>) -> Result<(), Problem> {
        if scanner.at_end() {
            return Ok(());
        }
        let before = scanner.clone();
        let word = scanner.word();
        let header = word.as_ref().filter(|w| HEADER_WORDS.contains(&w.value));
        if let Some(word) = word.as_ref().filter(|w| drive::WORDS.contains(&w.value)) {
            return self.drive(word, scanner);
        }
        if let Some(word) = word.as_ref().filter(|w| w.value == "master")
            && scanner.eat_word(DEVIATES)
        {
            return self.master(word, scanner);
        }
        let Some(header) = header else {
            let mut scanner = before;
            self.steps.push(step::step(&mut scanner)?);
            return Ok(());
        };
        if !self.steps.is_empty() {
            return Err(
                step::behind_the_first(header.span, header.value).help(format!(
                    "move the line up, above the first step (line `{}`)",
                    header.value
                )),
            );
        }
        self.header(header, &mut scanner)
    }

    /// `master deviates NAME`
    fn master(&mut self, word: &Spanned<&str>, mut scanner: Scanner<'_>) -> Result<(), Problem> {
        if !self.steps.is_empty() {
            let problem = step::behind_the_first(word.span, "master deviates");
            return Err(problem.help("move the line up, above the first step"));
        }
        let here = scanner.here();
        let value = master_deviates(&mut scanner)?;
        let span = scanner.since(here);
        scanner.expect_end()?;
        once(
            &mut self.master,
            Spanned { value, span },
            &Spanned {
                value: "master deviates",
                span: word.span,
            },
        )
    }

    /// A line that begins with `drive` is a header line where it can be one.
    fn drive(&mut self, word: &Spanned<&str>, mut scanner: Scanner<'_>) -> Result<(), Problem> {
        let (drives, line) = drive::line(&mut scanner)?;
        scanner.expect_end()?;
        let span = scanner.since(word.span);
        let what = match line {
            DriveLine::Setup(what) => what,
            DriveLine::Influence(influence) if self.steps.is_empty() => {
                SetupKind::Influence(influence)
            }
            line => {
                let action = step::drive_action(drives, line, span)?;
                self.steps.push(Step {
                    when: When::Now,
                    action,
                    span,
                });
                return Ok(());
            }
        };
        if !self.steps.is_empty() {
            return Err(step::not_a_step(word.span, &what));
        }
        self.setups.push(Setup { drives, what, span });
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
                self.sources.push(citation(scanner)?);
                Ok(())
            }
            "bus" => {
                let bus = named(scanner, &Bus::NAMES, "a bus")?;
                scanner.expect_end()?;
                once(&mut self.bus, bus, word)
            }
            "ring" => {
                let rings = rings(scanner)?;
                once(&mut self.rings, rings, word)
            }
            "line" => {
                let rate = rate(scanner)?;
                once(&mut self.rate, rate, word)
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

    fn finish(mut self) -> Result<Scenario, Vec<Problem>> {
        let setup = self.setup.take();
        let needs_steps = setup.is_none();
        let given = setup.filter(|rings| !rings.is_empty());
        let rings = self.rings.take().or(given);
        let bus = self.bus.unwrap_or(Bus::DEFAULT);
        let rings = match rings {
            Some(rings) => rings,
            None if bus.is_built() && self.problems.is_empty() => {
                self.problems.push(
                    Problem::new(
                        Span::default(),
                        "the scenario does not say how many drives its ring has",
                        "a `ring` line expected",
                    )
                    .help("add a line such as `ring 4` or `ring 3..250 default 100`"),
                );
                Vec::new()
            }
            None => Vec::new(),
        };
        if needs_steps && bus.is_built() && self.steps.is_empty() && self.problems.is_empty() {
            let place = Span::default();
            let problem = Problem::new(place, "the scenario has no step", "a step expected");
            let help = "add a line such as `> 80`: the master sends SYNCO";
            self.problems.push(problem.help(help));
        }
        self.problems.extend(broken_loop(&self.steps));
        if !self.problems.is_empty() {
            return Err(self.problems);
        }
        Ok(Scenario {
            title: self.title.unwrap_or_default(),
            sources: self.sources,
            bus,
            rings,
            rate: self.rate.unwrap_or_default(),
            setups: self.setups,
            master: self.master,
            needs: self.needs,
            strict: self.strict,
            deadline: self.deadline,
            steps: self.steps,
        })
    }
}

/// The loop that has no `end`, or the `end` that has no loop.
fn broken_loop(steps: &[Step]) -> Option<Problem> {
    let mut open = Vec::new();
    for step in steps {
        match step.action {
            Action::For(..) => open.push(step.span),
            Action::End if open.pop().is_none() => {
                let problem = Problem::new(step.span, "no loop ends here", "a step expected here");
                return Some(problem.help("`for k in 0..last` begins a loop"));
            }
            _ => {}
        }
    }
    let begin = open.pop()?;
    let problem = Problem::new(
        begin,
        "the loop has no end",
        "an `end` line expected behind it",
    );
    Some(problem.help("the lines up to `end` are played for each number"))
}

fn once<T>(place: &mut Option<T>, value: T, word: &Spanned<&str>) -> Result<(), Problem> {
    if place.is_some() {
        return Err(Problem::new(
            word.span,
            format!("`{}` stands twice", word.value),
            "this line may stand once",
        ));
    }
    *place = Some(value);
    Ok(())
}

fn citation(scanner: &mut Scanner<'_>) -> Result<Citation, Problem> {
    let here = scanner.here();
    let text: Vec<_> = scanner.rest().split_whitespace().collect();
    let span = Span {
        start: here.start,
        end: here.start + scanner.rest().len(),
    };
    if text.len() < 2 {
        return Err(Problem::new(
            span,
            "a source is a document and a section",
            "a document and a section expected here, such as `nd21 9.7`",
        ));
    }
    Ok(Citation {
        text: text.join(" "),
        span,
    })
}

/// `100`, `3..250 default 100`, and a second ring behind a comma.
fn rings(scanner: &mut Scanner<'_>) -> Result<Vec<RingRange>, Problem> {
    let mut rings = vec![ring_range(scanner)?];
    if scanner.eat(",") {
        rings.push(ring_range(scanner)?);
    }
    scanner.expect_end()?;
    Ok(rings)
}

fn ring_range(scanner: &mut Scanner<'_>) -> Result<RingRange, Problem> {
    let here = scanner.here();
    let smallest = ring_size(scanner)?;
    let largest = if scanner.eat("..") {
        ring_size(scanner)?
    } else {
        smallest
    };
    let span = scanner.since(here);
    if smallest > largest {
        return Err(Problem::new(
            span,
            "the range of ring sizes ends before it begins",
            "the smaller number comes first",
        ));
    }
    let mut default = smallest;
    if scanner.eat_word("default") {
        let here = scanner.here();
        default = ring_size(scanner)?;
        if !(smallest..=largest).contains(&default) {
            return Err(Problem::new(
                scanner.since(here),
                format!("the default {default} is outside the range"),
                format!("a number from {smallest} to {largest} expected here"),
            ));
        }
    }
    Ok(RingRange {
        smallest,
        largest,
        default,
        span,
    })
}

fn ring_size(scanner: &mut Scanner<'_>) -> Result<u8, Problem> {
    let Some(digits) = scanner.take_while(|c| c.is_ascii_digit()) else {
        return Err(scanner.unexpected("the number of drives in the ring"));
    };
    let number = digits.value.parse().unwrap_or(u64::MAX);
    let size = RingSize::new(number).map_err(|error| {
        Problem::new(
            digits.span,
            error.to_string(),
            format!("1 to {MAX_DRIVES} expected here"),
        )
    })?;
    Ok(size.drives())
}

/// `38400`, `19200 8O1`.
fn rate(scanner: &mut Scanner<'_>) -> Result<Rate, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit());
    let rate = digits
        .and_then(|digits| digits.value.parse().ok())
        .and_then(Rate::from_bits_per_second);
    let Some(rate) = rate else {
        return Err(scanner.unexpected("38400, 19200 or 9600 (ND21 8.3)"));
    };
    ahead.eat("bit/s");
    let mut format = ahead.clone();
    if !format.at_end() {
        let chunk = format.chunk();
        if !chunk.value.eq_ignore_ascii_case("8O1") {
            return Err(ahead.unexpected("8O1: 8 data bits, odd parity, 1 stop bit (ND21 8.3)"));
        }
        ahead = format;
    }
    *scanner = ahead;
    scanner.expect_end()?;
    Ok(rate)
}
