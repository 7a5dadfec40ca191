//! Compares a capture with the model: a simulated ring gets the same input as the real one, and the answers are compared.

use super::begin::{
    ShownBeginning, after_silences, from, gaps, is_midway, is_one_telegram, parts, shown, without,
};
use super::diff::{ComparedRun, Summary, compare};
use super::open::explanations;
use super::scenario::{SketchError, scenario_with, unforeseen};
use super::stimuli::CapturedFacts;
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::locate::locate;
use crate::simulate::simulated;
use harness_bench::capture::gap;
use harness_bench::capture::{Capture, JudgeOptions};
use harness_bench::link::{Link, link_name};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::{AtMismatch, play};
use harness_bench::scenario::source::{Source, SourceError};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Channel;
use harness_sim::record::LineByte;

/// The result of a judgement.
#[derive(Clone, Debug)]
pub(crate) struct CaptureVerdict {
    /// Passed where the last link of every ring carried what the model says; inconclusive where no last link was captured.
    pub verdict: Verdict,
    /// The last links: what the master received.
    pub master: Summary,
    /// Every link that was captured: where the rings differ first.
    pub links: Summary,
    /// How many cells took their contents from their first answers, because the model cannot know them.
    pub adopted: usize,
    /// How many bytes are data that changed by themselves, and were not compared.
    pub unforeseen: usize,
    /// The drive that the captured ring spells out at its end (ND21 9.7), with its ring.
    pub located: Option<(usize, u8)>,
    /// Remarks for the user.
    pub remarks: Vec<String>,
}

/// From how many places a capture that begins in mid-conversation is judged.
const MOST_STARTS: usize = 6;

/// Why plain memory differs from a right drive.
const OF_DRIVES: &str = "what differs is process data, or lies in cells that a drive may write itself or that a reset has changed, or a supply that was off in a \
     silence (ND21 9.4, 10.5, 14.2): describe the drives with --setup";

/// Why bytes that are missing at the end accuse no drive.
const UNDER_WAY: &str = "the capture ends while bytes are under way: those that it lacks at its end were due within the time by which its ports are late; \
     end a capture when the line is silent";

/// Why bytes that are missing after a ResetH8 accuse no drive.
const TESTS_ITSELF: &str = "what differs lies between a ResetH8 and the next silence, and nothing differs from there on: the drive may be silent while it tests \
     itself (ND21 10.5, 11.8); describe the drives with --setup";

/// Why what differs in front of a capture's first passed telegram accuses no drive.
const BEFORE: &str = "what differs lies in front of the first telegram that the ring passes on: before the capture a drive may have been in the error mode, in its \
     self-test or without power, a telegram or a command may have begun, or a link may have been broken (ND21 9.1, 9.5, 9.7, 9.9, 10.5)";

const NEVER_SILENT: &str = "the capture begins in mid-conversation, and its rings are never silent: what differs may come of bytes in front of it; begin it \
     before the master sends";

/// Why what differs across a gap accuses no drive.
const OF_A_GAP: &str = "what differs shows in none of the parts between gaps: bytes that are not in the capture may have been sent in them";

impl CaptureVerdict {
    /// What differs does not accuse a drive, for this reason.
    fn in_doubt(mut self, why: &str) -> Self {
        self.verdict = Verdict::Inconclusive;
        self.remarks.push(why.to_owned());
        self
    }
}

/// Why there is no judgement.
#[derive(Debug, thiserror::Error)]
pub(crate) enum JudgeError {
    /// No scenario can be made of the capture.
    #[error(transparent)]
    Sketch(#[from] SketchError),
    /// It has mistakes: with a setup for other rings, or it is longer than a scenario may be.
    #[error("the capture as a scenario: {}", first(.0))]
    Mistakes(#[from] Box<Problems>),
    /// It is longer than a scenario may be.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// It could not be played to its end.
    #[error("the model could not play the capture: {0}")]
    Aborted(String),
}

/// The message of the first problem, without its place: the generated text is not shown to the user.
fn first(problems: &Problems) -> String {
    let Some(first) = problems.all().first() else {
        return problems.to_string();
    };
    let too_long = first.expected.starts_with("fewer bytes");
    let remedy = match too_long {
        true => {
            "; judge it in parts that begin in a silence, such as the files of `capture --every` or those that Wireshark's editcap cuts"
        }
        false => "",
    };
    format!("{}{remedy}", first.message)
}

/// Judges a capture; times are compared as far as the tolerance. One that begins in mid-conversation, or before its rings have shown that
/// their drives are in normal mode, and differs, is judged from where its rings were first silent: what was in front of it is not known.
///
/// # Errors
/// [`JudgeError`].
pub(crate) fn judge(
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<CaptureVerdict, JudgeError> {
    let judged = judge_part(capture, options);
    let differs = judged
        .as_ref()
        .map_or(true, |judged| judged.verdict == Verdict::Failed);
    let gaps = if differs { gaps(capture) } else { Vec::new() };
    if gaps.is_empty() {
        return judged;
    }
    // The clock may have been set; or other bytes were sent and are not in the capture, after which each part is judged for itself.
    let mut judged = judge_part(&without(capture, &gaps), options)?;
    if judged.verdict == Verdict::Failed {
        let parts = parts(capture, &gaps).into_iter();
        let mut parts = parts.filter_map(|part| judge_part(&part, options).ok());
        judged = match parts.find(|judged| judged.verdict == Verdict::Failed) {
            Some(failed) => failed,
            None => judged.in_doubt(OF_A_GAP),
        };
    }
    judged.remarks.extend(gap::note(&gaps, "byte"));
    Ok(judged)
}

fn judge_part(capture: &Capture, options: &JudgeOptions<'_>) -> Result<CaptureVerdict, JudgeError> {
    let judged = judge_whole(capture, options)?;
    if judged.verdict != Verdict::Failed {
        return Ok(judged);
    }
    let is_midway = is_midway(capture);
    let shown = shown(capture, options.tolerance());
    // Its time in the capture; a byte that is missing at the end lies behind all.
    let first = judged.master.first.as_ref();
    let first = first.and_then(|first| first.sides[0]).map(|byte| byte.at);
    let is_early = match shown {
        ShownBeginning::From { at, lost } => lost || first.is_some_and(|first| first < at),
        ShownBeginning::Never => true,
        ShownBeginning::Wrong => false,
    };
    if !is_midway && !is_early {
        return match may_test_itself(capture, options, &judged)? {
            true => Ok(judged.in_doubt(TESTS_ITSELF)),
            false => Ok(judged),
        };
    }
    let starts = after_silences(capture);
    let Some(start) = starts.first() else {
        return Ok(judged.in_doubt(match is_midway {
            true => NEVER_SILENT,
            false => BEFORE,
        }));
    };
    let mut judged = judge_whole(&from(capture, *start), options)?;
    judged.remarks.push(format!(
        "{}: it is judged from {} on, where its rings were first silent, and bytes are counted from there",
        match is_midway {
            true => "the capture begins in mid-conversation",
            false => "the capture does not show what its drives did before",
        },
        start.since_start()
    ));
    if !is_midway && judged.verdict != Verdict::Failed {
        return Ok(judged.in_doubt(BEFORE));
    }
    if judged.verdict == Verdict::Passed && !is_one_telegram(capture, *start) {
        return Ok(judged.in_doubt(
            "more than the telegram under way was sent before: what differs there may come of bytes in front of the capture",
        ));
    }
    if judged.verdict != Verdict::Failed {
        return Ok(judged);
    }
    let normal = match shown {
        ShownBeginning::From { at, .. } => starts.partition_point(|start| *start < at),
        ShownBeginning::Never => starts.len(),
        ShownBeginning::Wrong => 0,
    };
    if normal == starts.len() {
        return Ok(judged.in_doubt(BEFORE));
    }
    // What came before can show for a while, such as a reset. A fault that lasts shows from everywhere.
    let later = starts.iter().skip(normal.max(1));
    for start in later.step_by(starts.len().div_ceil(MOST_STARTS)) {
        if judge_whole(&from(capture, *start), options)?.verdict != Verdict::Failed {
            return Ok(judged.in_doubt(
                "what differs does not show from each silence on: it may come of bytes in front of the capture",
            ));
        }
    }
    Ok(judged)
}

/// Whether what differs lies between a ResetH8 and the next silence of its rings, and nothing differs from there on.
fn may_test_itself(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    judged: &CaptureVerdict,
) -> Result<bool, JudgeError> {
    let Some(first) = judged.links.first.as_ref().map(|first| first.at) else {
        return Ok(false);
    };
    let told = unforeseen(capture);
    let resets = told.iter().flat_map(|told| &told.resets);
    let Some(reset) = resets.map(|(at, _)| at).filter(|at| **at <= first).max() else {
        return Ok(false);
    };
    let starts = after_silences(capture);
    let Some(start) = starts.iter().find(|start| *start > reset) else {
        return Ok(false);
    };
    Ok(judge_whole(&from(capture, *start), options)?.verdict != Verdict::Failed)
}

/// Judges a capture as one that begins with nothing under way. Without gaps up to the tolerance the model can be apart from a drive that
/// does something in its own time (ND21 9.9, 10.5, 14.10.5), so that a capture that differs is played once more at its own times.
fn judge_whole(
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<CaptureVerdict, JudgeError> {
    let told = unforeseen(capture);
    let none = Header::default();
    let judged = judge_as(capture, options, &told, (&none, options.tolerance()))?;
    if judged.verdict != Verdict::Failed {
        return Ok(judged);
    }
    if options.tolerance() > Span::ZERO {
        let exact = judge_as(capture, options, &told, (&none, Span::ZERO))?;
        if exact.verdict != Verdict::Failed {
            return Ok(exact);
        }
    }
    if options.setup.is_some() {
        return Ok(judged);
    }
    for explanation in explanations(capture, &told) {
        let gaps = [options.tolerance(), Span::ZERO];
        let exact = explanation.is_right && options.tolerance() > Span::ZERO;
        for gaps in &gaps[..1 + usize::from(exact)] {
            let Ok(mut explained) = judge_as(capture, options, &told, (&explanation.header, *gaps))
            else {
                continue;
            };
            if explained.links.differ > 0 {
                continue;
            }
            explained.remarks.push(explanation.remark);
            if !explanation.is_right {
                explained.verdict = Verdict::Inconclusive;
            }
            return Ok(explained);
        }
    }
    Ok(judged)
}

/// Judges a capture beside simulated drives with more in their header, with smaller gaps between bytes sent removed.
fn judge_as(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    told: &[CapturedFacts],
    more: (&Header, Span),
) -> Result<CaptureVerdict, JudgeError> {
    let (model, remarks) = model(capture, options, more)?;
    let model = as_captured(&model, capture);
    let behind = |ring: usize, link: &Channel, index: usize| {
        // Data behind the drive that cannot be predicted stand at the same place on the last link.
        let told = told.get(ring).filter(|_| link.from.is_some());
        told.is_some_and(|told| told.unforeseen.contains(&index))
    };
    let tolerance = Span::from_units(options.tolerance().units().max(6));
    let (left, right) = (
        ComparedRun {
            name: "capture",
            capture,
        },
        ComparedRun {
            name: "model",
            capture: &model,
        },
    );
    let heard = capture.end();
    let listened = capture.listened;
    let end = listened.map_or(heard, |listened| listened.until.max(heard));
    let inner =
        |ring: usize, link: &Channel, index: usize| link.to.is_some() || behind(ring, link, index);
    let master = compare(left, right, tolerance, &inner, Some(end));
    let links = compare(left, right, tolerance, &behind, Some(end));
    let last =
        |trace: &harness_sim::record::Trace| trace.channels.iter().any(|link| link.to.is_none());
    let is_whole = capture.traces.iter().all(last);
    let verdict = if !is_whole {
        Verdict::Inconclusive
    } else if master.differ > 0 {
        Verdict::Failed
    } else {
        Verdict::Passed
    };
    let of_drives = |ring: usize, link: &Channel, index: usize| {
        let told = told.get(ring);
        inner(ring, link, index) || told.is_some_and(|told| told.of_drives.contains(&index))
    };
    // Adapters give bytes late: how late, the bytes tell that are the same.
    let late = Span::from_units(links.latest.units().saturating_mul(2));
    let is_under_way = verdict == Verdict::Failed && {
        let end = before(end, late);
        compare(left, right, tolerance, &inner, Some(end)).differ == 0
    };
    let is_plain = verdict == Verdict::Failed && options.setup.is_none();
    let in_doubt = is_plain && compare(left, right, tolerance, &of_drives, Some(end)).differ == 0;
    let judged = CaptureVerdict {
        verdict,
        master,
        links,
        adopted: match options.setup {
            Some(_) => 0,
            None => told.iter().map(|told| told.cells.len()).sum(),
        },
        unforeseen: told.iter().map(|told| told.unforeseen.len()).sum(),
        located: located(capture),
        remarks,
    };
    Ok(match is_whole {
        false => judged.in_doubt(&not_captured(capture)),
        true if is_under_way => judged.in_doubt(UNDER_WAY),
        true if in_doubt => judged.in_doubt(OF_DRIVES),
        true => judged,
    })
}

/// A time so much earlier.
fn before(end: Instant, late: Span) -> Instant {
    let since = end.since_start().units();
    Instant::START + Span::from_units(since.saturating_sub(late.units()))
}

/// The links without which there is no verdict.
fn not_captured(capture: &Capture) -> String {
    let rings = capture.traces.iter().enumerate();
    let last = rings.map(|(ring, trace)| link_name(ring, trace.stations, trace.stations.into()));
    let last = last.collect::<Vec<_>>().join(", ");
    format!("the master's incoming link ({last}) was not captured")
}

/// What the model does where the same is done to it.
fn model(
    capture: &Capture,
    options: &JudgeOptions<'_>,
    (more, tolerance): (&Header, Span),
) -> Result<(Capture, Vec<String>), JudgeError> {
    let options = JudgeOptions {
        tolerance: Some(tolerance),
        ..*options
    };
    let text = scenario_with(capture, &options, more)?;
    let source = Source::from_bytes("the capture".to_owned(), text.into_bytes())?;
    let entry = RingScenario::new(source, None)?;
    let plan = &entry.plan;
    let mut link = simulated(plan);
    let outcome = play(plan, &mut link, AtMismatch::GoOn);
    if matches!(
        outcome.verdict,
        Verdict::Aborted | Verdict::Skipped | Verdict::RigError
    ) {
        let found = outcome.finding.map(|finding| finding.message);
        let why = found.or(outcome.remarks.first().cloned());
        return Err(JudgeError::Aborted(why.unwrap_or_default()));
    }
    let capture = Capture {
        rate: plan.rate,
        traces: (0..plan.rings.len()).map(|ring| link.trace(ring)).collect(),
        listened: None,
        timed: true,
    };
    Ok((capture, outcome.remarks))
}

/// The model's links, as far as they were captured. What a damaged byte was is not known, and no drive uses it (ND21 9.7).
fn as_captured(model: &Capture, capture: &Capture) -> Capture {
    let mut model = model.clone();
    for (trace, recorded) in model.traces.iter_mut().zip(&capture.traces) {
        let ends = |link: &Channel| (link.from, link.to);
        let captured = |link: &Channel| recorded.channels.iter().find(|o| ends(o) == ends(link));
        trace.channels.retain(|link| captured(link).is_some());
        for link in &mut trace.channels {
            let heard = captured(link).map_or(&[][..], Channel::octets);
            let pairs = link.octets_mut().into_iter().flatten().zip(heard);
            for (byte, heard) in pairs.filter(|(byte, heard)| byte.error == heard.error) {
                if byte.error.is_some() {
                    (byte.sent, byte.received) = (heard.sent, heard.received);
                }
            }
        }
    }
    model
}

/// The drive that a ring spells out at the end.
fn located(capture: &Capture) -> Option<(usize, u8)> {
    capture.traces.iter().enumerate().find_map(|(ring, trace)| {
        let last = trace.channels.iter().find(|link| link.to.is_none())?;
        let received: Vec<Received> = last.octets().iter().filter_map(LineByte::arrival).collect();
        let found = locate(&received, trace.stations)?;
        // The zeros of a check sequence make the ring spell out other drives (the figure of ND21 9.8).
        let first = trace.channels.iter().find(|link| link.from.is_none());
        let sent = first.map_or(&[][..], Channel::octets);
        let last = sent.iter().rev().take(8);
        let zeros = last.filter(|byte| byte.sent == Some(0));
        (found.sure || zeros.count() < 8).then_some((ring, found.drive))
    })
}
