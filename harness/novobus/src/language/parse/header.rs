//! Header lines: `ring`, `line`, `drive`, `master deviates`.

use super::drive::{self, DriveLine};
use super::step;
use super::words::master_deviates;
use crate::language::Novobus;
use crate::language::syntax::Scenario;
use crate::language::syntax::header::{Header, RingRange, Setup, SetupKind};
use harness_bench::counted::counted;
use harness_bench::scenario::parse::header::{Part, given_twice, header_lines, once, read};
use harness_bench::scenario::parse::step as core;
use harness_bench::scenario::problem::{Problem, Problems, Spanned, TextSpan};
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::source::Source;
use harness_proto::line::Rate;
use harness_proto::novobus::address::{MAX_DRIVES, RingSize};

/// The word behind `master` that makes a header line of it.
pub(crate) const DEVIATES: &str = "deviates";

/// Words with which header lines of this bus begin, for suggestions.
pub(crate) const WORDS: [&str; 3] = ["ring", "line", "drive"];

/// Reads a line that begins with `word` as a header line; `None` if it is a step. `begun` says whether a step stands in front of it.
pub(crate) fn line(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Option<Result<(), Problem>> {
    match word.value {
        "ring" | "line" if begun => Some(Err(core::header_too_late(word.span, word.value))),
        "ring" => Some(rings(scanner).and_then(|rings| {
            if header.rings.is_empty() {
                header.rings = rings;
                return Ok(());
            }
            Err(given_twice(word))
        })),
        "line" => Some(rate(scanner).and_then(|rate| once(&mut header.rate, rate, word))),
        "master" => {
            let deviates = scanner.eat_word(DEVIATES);
            deviates.then(|| deviating_master(word, scanner, header, begun))
        }
        name if drive::WORDS.contains(&name) => drive_line(word, scanner, header, begun),
        _ => None,
    }
}

/// What a header that is read lacks.
pub(crate) fn incomplete(header: &Header) -> Option<Problem> {
    let what = "the scenario does not say how many drives its ring has";
    let problem = Problem::new(TextSpan::default(), what, "a `ring` line expected");
    let help = "add a line such as `ring 4` or `ring 3..250 default 100`";
    header.rings.is_empty().then(|| problem.help(help))
}

/// A line that begins with `drive` is a header line where it can be one.
fn drive_line(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Option<Result<(), Problem>> {
    let read = drive::line(scanner).and_then(|read| scanner.expect_end().map(|()| read));
    let (drives, line) = match read {
        Ok(read) => read,
        Err(problem) => return Some(Err(problem)),
    };
    let what = match line {
        DriveLine::Setup(what) if begun => return Some(Err(step::not_a_step(word.span, &what))),
        DriveLine::Setup(what) => what,
        DriveLine::Influence(influence) if !begun => SetupKind::Influence(influence),
        _ => return None,
    };
    let span = scanner.since(word.span);
    header.setups.push(Setup { drives, what, span });
    Some(Ok(()))
}

/// `master deviates NAME`
fn deviating_master(
    word: &Spanned<&str>,
    scanner: &mut Scanner<'_>,
    header: &mut Header,
    begun: bool,
) -> Result<(), Problem> {
    if begun {
        let problem = core::behind_the_first(word.span, "master deviates");
        return Err(problem.help("move the line up, above the first step"));
    }
    let here = scanner.here();
    let value = master_deviates(scanner)?;
    let span = scanner.since(here);
    scanner.expect_end()?;
    let name = Spanned {
        value: "master deviates",
        span: word.span,
    };
    once(&mut header.master, Spanned { value, span }, &name)
}

/// Reads the header of a scenario: what drives are before anything is sent. Its steps are left out, once it
/// is sure that they are steps; it needs none, and no `ring` line where `rings` are given.
///
/// # Errors
/// As of [`parse`](harness_bench::scenario::parse::parse).
pub(crate) fn parse_setup(source: &Source, rings: &[u8]) -> Result<Scenario, Problems> {
    let mut scenario: Scenario = read(source, Part::Header)?;
    if scenario.header.rings.is_empty() {
        scenario.header.rings = rings.iter().copied().map(RingRange::of).collect();
    }
    if let Some(problem) = incomplete(&scenario.header) {
        let text = source.text.clone();
        return Err(Problems::new(&source.name, text, vec![problem]));
    }
    scenario.steps.clear();
    Ok(scenario)
}

/// Reads lines of a header that may leave out the `ring` line.
///
/// # Errors
/// Every line that cannot be understood, and every step.
pub(crate) fn parse_lines(source: &Source) -> Result<Header, Problems> {
    header_lines::<Novobus>(source)
}

/// The mistake in the `ring` line of a header that is not for rings of these sizes.
pub(crate) fn for_other_rings(header: &Header, rings: &[u8]) -> Option<Problem> {
    let ranges = &header.rings;
    let fits = |(range, size): (&RingRange, &u8)| range.contains(*size);
    if ranges.is_empty() || ranges.len() == rings.len() && ranges.iter().zip(rings).all(fits) {
        return None;
    }
    let sizes: Vec<_> = rings.iter().map(u8::to_string).collect();
    let what = match rings {
        [one] => format!("the rig has {}", counted(*one, "drive")),
        _ => format!("the rig has {} drives", sizes.join(" and ")),
    };
    let expected = "no `ring` line, or its sizes, expected here";
    Some(Problem::new(ranges[0].span, what, expected))
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
