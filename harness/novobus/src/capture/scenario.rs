//! Converts a capture to a scenario: the bytes sent with their times, the faults on the way, and the bytes that came back.

use super::faults::faults;
use super::stimuli::{CapturedFacts, told};
use crate::language::syntax::{
    CellPlace, DriveRange, Header, RingStep, Scenario, Setup, SetupKind, Step, Written,
};
use crate::language::write::Text;
use harness_bench::capture::{Capture, JudgeOptions};
use harness_bench::scenario::parse::parse;
use harness_bench::scenario::pattern::{Expected, Pattern};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::syntax::{Action, When};
use harness_bench::scenario::times::Duration;
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;
use harness_sim::record::{Channel, Trace};

/// Bytes on a line of a scenario, where it is not a long one.
const A_LINE: usize = 16;
/// Maximum number of lines of a scenario (see its language), except for some of the header.
const LINES: usize = 19_000;
/// Maximum number of bytes on a line: 10,000 characters.
const MOST_A_LINE: usize = 3_000;
/// The longest title.
const TITLE: usize = 100;

/// Why there is no scenario in a capture.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SketchError {
    /// What the master sent is not there.
    #[error(
        "the capture has no link {0}: what the master sent is not known, and nothing can be played"
    )]
    NoMaster(String),
    /// There is nothing to play.
    #[error("the master sent nothing in this capture: there is nothing to play")]
    Silent,
    /// A ring that cannot be.
    #[error("{0}")]
    Ring(String),
    /// It is longer than a scenario may be.
    #[error(
        "{0} lines: a scenario has at most {LINES}; give a tolerance for gaps (--tolerance), or import a part"
    )]
    TooLong(usize),
    /// The scenario with the setup has mistakes.
    #[error("the setup: {0}")]
    Setup(#[from] Box<Problems>),
}

/// The scenario's text.
///
/// # Errors
/// [`SketchError`].
pub(crate) fn scenario(
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<String, SketchError> {
    scenario_with(capture, options, &Header::default())
}

/// The scenario's text, with more in its header.
pub(super) fn scenario_with(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    more: &Header,
) -> Result<String, SketchError> {
    let mut rings = Vec::new();
    for (index, trace) in capture.traces.iter().enumerate() {
        rings.push(CapturedRing::of(index, trace)?);
    }
    if rings.iter().all(|ring| ring.first.octets().is_empty()) {
        return Err(SketchError::Silent);
    }
    let bytes: usize = rings
        .iter()
        .map(|r| r.first.octets().len() + r.received.len())
        .sum();
    let width = (bytes * 2 / LINES).clamp(A_LINE, MOST_A_LINE);
    let mut text: Text = Text::default();
    text.header(&head(capture, options, &rings, more)?);
    text.empty_line();
    for (index, trace) in capture.traces.iter().enumerate() {
        for link in &trace.channels {
            for fault in faults(index, link, capture.rate) {
                text.step(&RingStep::Fault(fault).into(), "");
            }
        }
    }
    for step in sends(&rings, capture.rate, options.tolerance(), width) {
        text.step(&step, "");
    }
    for (index, ring) in rings.iter().enumerate() {
        receives(&mut text, index, ring, width);
    }
    let text = String::from(text);
    match text.lines().count() {
        lines if lines > LINES => Err(SketchError::TooLong(lines)),
        _ => Ok(text),
    }
}

/// What matters of a ring.
struct CapturedRing<'c> {
    size: RingSize,
    first: &'c Channel,
    /// What arrived at the master.
    received: Vec<Received>,
    told: CapturedFacts,
}

impl<'c> CapturedRing<'c> {
    fn of(index: usize, trace: &'c Trace) -> Result<Self, SketchError> {
        let size = RingSize::new(u64::from(trace.stations))
            .map_err(|error| SketchError::Ring(error.to_string()))?;
        let first = trace.channels.iter().find(|link| link.from.is_none());
        let Some(first) = first else {
            let ring = if index == 0 { "" } else { "2:" };
            let name = format!("{ring}master->{}", size.first());
            return Err(SketchError::NoMaster(name));
        };
        let last = trace.channels.iter().find(|link| link.to.is_none());
        let last = last.map_or(&[][..], |link| link.octets());
        Ok(Self {
            size,
            first,
            received: last.iter().filter_map(LineByte::arrival).collect(),
            told: told(size, trace),
        })
    }
}

fn head(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    rings: &[CapturedRing<'_>],
    more: &Header,
) -> Result<Scenario, SketchError> {
    let sizes: Vec<_> = rings.iter().map(|ring| ring.size.drives()).collect();
    // A setup also defines the contents of the cells.
    let setups = match options.setup {
        Some(setup) => {
            let scenario: Scenario = parse(setup).map_err(Box::new)?;
            scenario.header.setups
        }
        None => cells(rings),
    };
    let header = Header {
        rate: Some(capture.rate).filter(|rate| *rate != Rate::default()),
        setups,
        ..Header::of_rings(&sizes)
    };
    // Whatever the gaps are, the byte behind them is waited for.
    let millis = capture.end().since_start().as_nanos() / 1_000_000 + 1_000;
    Ok(Scenario {
        deadline: Some(Duration::millis(millis.min(600_000))),
        ..Scenario::new(&title(options.title), header.and(more))
    })
}

/// What cells held before, as far as the drives said it.
fn cells(rings: &[CapturedRing<'_>]) -> Vec<Setup> {
    let mut setups = Vec::new();
    for (index, ring) in rings.iter().enumerate() {
        let mut cells = ring.told.cells.iter().peekable();
        while let Some(((drive, address), value)) = cells.next() {
            let mut bytes = vec![Expected::Byte(*value)];
            let mut next = address.checked_add(1);
            while let Some(((_, _), value)) =
                cells.next_if(|((d, a), _)| d == drive && Some(*a) == next)
            {
                bytes.push(Expected::Byte(*value));
                next = next.and_then(|next| next.checked_add(1));
            }
            let value = Written::Bytes(Pattern::of(&bytes, usize::MAX));
            setups.push(Setup::new(
                DriveRange::one(index, *drive),
                SetupKind::Memory(CellPlace::at(*address), value),
            ));
        }
    }
    setups
}

/// One line without what a scenario takes for a comment.
fn title(text: &str) -> String {
    let kept = text
        .chars()
        .map(|c| if c.is_control() || c == '#' { ' ' } else { c });
    let kept: String = kept.take(TITLE).collect();
    match kept.trim() {
        "" => "A capture".to_owned(),
        title => title.to_owned(),
    }
}

/// What the master sent, each run of bytes at its time.
fn sends(rings: &[CapturedRing<'_>], rate: Rate, tolerance: Span, width: usize) -> Vec<Step> {
    // Times are cut off to nanoseconds.
    let gap = tolerance.units().max(6);
    let byte_time = rate.byte_time();
    let mut runs: Vec<(Instant, usize, Vec<u8>)> = Vec::new();
    for (index, ring) in rings.iter().enumerate() {
        let mut free = Instant::START;
        for byte in ring.first.octets() {
            let Some(sent) = byte.sent else { continue };
            let start = byte.at - byte_time;
            let behind = start.since(free).units() <= gap;
            match runs.last_mut() {
                Some((_, link, run)) if behind && *link == index => run.push(sent),
                _ => runs.push((if behind { free } else { start }, index, vec![sent])),
            }
            free = if behind { free + byte_time } else { byte.at };
        }
    }
    runs.sort_by_key(|(at, ..)| *at);
    let mut steps = Vec::new();
    for (at, ring, run) in runs {
        // To the nearest nanosecond.
        let at = at + Span::from_units(1);
        let mut when = match at.since_start().as_nanos() {
            0 => When::Now,
            nanos => When::At(Duration::nanos(nanos).into()),
        };
        let run: Vec<_> = run.into_iter().map(Expected::Byte).collect();
        for bytes in Pattern::of(&run, usize::MAX).lines(width) {
            let step: Step = Step::from(Action::Send {
                port: ring,
                message: bytes,
            });
            steps.push(Step { when, ..step });
            when = When::Now;
        }
    }
    steps
}

/// Writes what came back, up to the first byte that the master received with a line error: no line can ask for one.
fn receives(text: &mut Text, index: usize, ring: &CapturedRing<'_>, width: usize) {
    let good = ring.received.iter().position(|byte| byte.error.is_some());
    let end = good.unwrap_or(ring.received.len());
    let shown = ring.received[..end].iter().enumerate();
    let shown: Vec<_> = shown
        .map(
            |(place, byte)| match ring.told.unforeseen.contains(&place) {
                true => Expected::Any,
                false => Expected::Byte(byte.byte),
            },
        )
        .collect();
    for bytes in Pattern::of(&shown, usize::MAX).lines(width) {
        text.step(
            &Action::Receive {
                port: index,
                message: bytes,
            }
            .into(),
            "",
        );
    }
    if end < ring.received.len() {
        text.remark(&format!(
            "byte {} arrived with a line error; what follows is not asked for",
            end + 1
        ));
    }
}

/// Bytes received, counted from 0, that cannot be foretold, ring by ring.
pub(crate) fn unforeseen(capture: &Capture) -> Vec<CapturedFacts> {
    let rings = capture.traces.iter().enumerate();
    let told = rings.map(|(index, trace)| CapturedRing::of(index, trace).map(|ring| ring.told));
    told.map(Result::unwrap_or_default).collect()
}
