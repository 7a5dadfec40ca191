//! A capture that is judged, or made into a scenario, by the rules of its bus.

use super::Capture;
use crate::counted::counted;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::record::Trace;

/// Times of a capture are cut off to nanoseconds.
const CUT_OFF: Span = Span::from_nanos(2);

/// How far times may be off where a log has none.
const NO_TIMES: Span = Span::from_millis(86_400_000);

/// How a capture is judged.
#[derive(Clone, Copy, Debug, Default)]
pub struct JudgeOptions<'o> {
    /// What it is called; any text.
    pub title: &'o str,
    /// A scenario whose header describes the drives. Without one the drives are plain, and a ring's cells hold what they first report.
    pub setup: Option<&'o Source>,
    /// The tolerance of times that the user gave. On a ring smaller gaps between bytes sent are removed, because real clocks are not
    /// exact.
    pub tolerance: Option<Span>,
    /// The drives or slaves that are judged, of a line that they share; all where it is empty.
    pub stations: &'o [u8],
}

impl JudgeOptions<'_> {
    /// How far times may be off.
    #[must_use]
    pub fn tolerance(&self) -> Span {
        self.tolerance.unwrap_or(CUT_OFF)
    }
}

/// The result of judging a capture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JudgedCapture {
    /// Passed, failed, or inconclusive where nothing was compared.
    pub verdict: Verdict,
    /// What was judged, such as `3030 bytes on 101 links in 1.200 s`.
    pub about: String,
    /// What differs, a sentence each.
    pub differences: Vec<String>,
    /// What was not compared, a sentence each.
    pub remarks: Vec<String>,
    /// The bytes around what differs; empty where there is nothing to show.
    pub shown: String,
}

/// The result of judging frames or telegrams of a shared line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JudgedFrames {
    /// Passed, failed, or inconclusive where nothing was compared.
    pub verdict: Verdict,
    /// How many frames or telegrams of drives were compared.
    pub compared: usize,
    /// How many could be compared.
    pub replies: usize,
    /// What differs, a sentence each.
    pub differences: Vec<String>,
    /// What was not compared, a sentence each.
    pub remarks: Vec<String>,
}

/// Judges frames or telegrams by the drives' header: the drives that are named, or all; times may be off by as much.
type JudgeFrames = fn(&[Trace], Option<&Source>, (&[u8], Span)) -> Result<JudgedFrames, String>;

/// Makes a scenario of frames or telegrams, with this title and the drives' header.
type ReplayFrames = fn(&[Trace], &str, Option<&Source>) -> Result<String, String>;

/// Judges a capture of a shared line that has this many pieces, with what one is called.
///
/// # Errors
/// What is missing, in a sentence.
pub fn judged_frames(
    judge: JudgeFrames,
    count: usize,
    what: &str,
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<JudgedCapture, String> {
    // Times of a log are those of the bus unless the user says how far they are off; a log without times has an order alone.
    let tolerance = match capture.timed {
        true => options.tolerance.unwrap_or(Span::ZERO),
        false => NO_TIMES,
    };
    let stations = (options.stations, tolerance);
    let judged = judge(&capture.traces, options.setup, stations)?;
    Ok(JudgedCapture {
        verdict: judged.verdict,
        about: format!(
            "{} in {}, {} of {} compared",
            counted(count, what),
            capture.end(),
            judged.compared,
            counted(judged.replies, "reply"),
        ),
        differences: judged.differences,
        remarks: judged.remarks,
        shown: String::new(),
    })
}

/// Makes a scenario of a capture of a shared line.
///
/// # Errors
/// What is missing, in a sentence.
pub fn replayed_frames(
    replay: ReplayFrames,
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<String, String> {
    if options.tolerance.is_some() {
        return Err("--tolerance changes nothing in a scenario of frames or telegrams: each is sent at its own time; leave it out".to_owned());
    }
    if !capture.timed {
        return Err(
            "a scenario sends at the times of the log, and it has none; log with times, as `candump -L` does"
                .to_owned(),
        );
    }
    replay(&capture.traces, options.title, options.setup)
}
