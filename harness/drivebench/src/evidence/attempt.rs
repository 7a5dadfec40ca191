//! An attempt at a scenario, played again from its record and judged again.

use super::folder::capture;
use super::header::Header;
use super::record::RecordLine;
use crate::library::Entry;
use crate::link::{LinkEvent, LinkFault, Moment, PlacedFault, Recording, link_name};
use crate::rig::Attempt;
use crate::rig::playing::{RecordJudge, RecordedAttempt};
use crate::scenario::run::{AtMismatch, Outcome};
use crate::scenario::settled::Settled;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;

/// How much longer a busy computer may have waited in one attempt; for records without looks.
const WAITED: Span = Span::from_millis(1_000);

/// What a remark begins with about a fault that was asked for and never happened.
pub(super) const UNUSED: &str = "this fault never happened: ";

/// An attempt as recorded.
#[derive(Clone)]
pub(super) struct Recorded {
    pub(super) name: String,
    pub(super) sha256: String,
    pub(super) attempt: usize,
    pub(super) events: Vec<LinkEvent>,
    pub(super) verdict: Option<RecordedVerdict>,
}

/// The verdict of a record.
#[derive(Clone)]
pub(super) struct RecordedVerdict {
    pub(super) verdict: String,
    pub(super) finding: Option<String>,
    pub(super) remarks: Vec<String>,
    pub(super) took: Span,
    pub(super) unplaced: u64,
    pub(super) opening: Option<String>,
}

impl RecordedVerdict {
    /// Its remarks about faults that never happened.
    pub(super) fn unused(&self) -> impl Iterator<Item = &String> {
        let remarks = self.remarks.iter();
        remarks.filter(|remark| remark.starts_with(UNUSED))
    }
}

/// The outcome of an attempt that was played again.
pub(super) struct ReplayedAttempt {
    /// Its outcome, and in a qualification its conversations and how they compare with the twin's.
    pub(super) attempt: Attempt,
    /// What the record holds behind the end of the attempt.
    left: Option<String>,
    /// Where the record differs from what simulated rings of its own do.
    other: Option<String>,
    /// What its links carried, as a capture, where that is known.
    pub(super) capture: Option<String>,
    /// Whether the outcome must be the same to the last remark and moment.
    exact: bool,
    /// Whether the record ends in trouble.
    pub(super) trouble: bool,
    ended: ConversationEnd,
}

/// Judges an attempt on a rig again.
///
/// # Errors
/// Its text is no scenario of the rig's bus, in a sentence.
pub(super) fn again(
    recorded: &Recorded,
    text: &str,
    judge: &mut dyn RecordJudge,
) -> Result<ReplayedAttempt, String> {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let verdict = recorded.verdict.as_ref();
    let attempt = RecordedAttempt {
        events: &recorded.events,
        unplaced: verdict.map_or(0, |verdict| verdict.unplaced),
    };
    let judged = judge.judge(&source, attempt)?;
    let (other, made) = match &judged.played {
        Some((events, traces)) => (
            first_difference(&recorded.events, events),
            Some(capture(traces, &judged.attempt.outcome)),
        ),
        None => (None, None),
    };
    Ok(ReplayedAttempt {
        attempt: judged.attempt,
        left: judged.left,
        other,
        capture: made,
        exact: judged.exact,
        trouble: judged.trouble,
        ended: ConversationEnd::of(&recorded.events),
    })
}

/// Plays an attempt again on a simulated bench of its own.
pub(super) fn again_on_own_bench(
    recorded: &Recorded,
    text: &str,
    drives: &[u8],
) -> ReplayedAttempt {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    match Entry::fitting(source, drives.first().copied()) {
        Err(problems) => ReplayedAttempt::impossible(problems.to_string()),
        Ok(entry) => match entry.settled.rings() {
            Some(rings) if rings.drives != drives => {
                ReplayedAttempt::impossible("it is for other rings than the rig has".to_owned())
            }
            _ => simulated_again(recorded, &*entry.settled),
        },
    }
}

/// Plays an attempt again on simulated rings of its own: everything that was recorded must come again.
fn simulated_again(recorded: &Recorded, plan: &dyn Settled) -> ReplayedAttempt {
    let mut link = plan.simulate();
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::whole(&mut *link, &mut events);
    let outcome = plan.play(&mut recording, AtMismatch::Stop);
    let traces: Vec<_> = (0..plan.ports()).map(|port| link.trace(port)).collect();
    ReplayedAttempt {
        capture: Some(capture(&traces, &outcome)),
        exact: true,
        trouble: false,
        attempt: Attempt::new(outcome, traces),
        left: None,
        other: first_difference(&recorded.events, &events),
        ended: ConversationEnd::of(&recorded.events),
    }
}

/// The first event of a record that is not what simulated drives give when it is played again.
fn first_difference(recorded: &[LinkEvent], played: &[LinkEvent]) -> Option<String> {
    let written = |events: &[LinkEvent]| -> Vec<RecordLine> {
        events.iter().filter_map(RecordLine::of).collect()
    };
    let (theirs, ours) = (written(recorded), written(played));
    let at = (0..theirs.len().max(ours.len())).find(|at| theirs.get(*at) != ours.get(*at))?;
    let show = |line: Option<&RecordLine>| match line.map(serde_json::to_string) {
        Some(Ok(text)) => text,
        _ => "nothing more".to_owned(),
    };
    Some(format!(
        "event {}: the record has {}, the simulated rings give {}",
        at + 1,
        show(theirs.get(at)),
        show(ours.get(at))
    ))
}

impl ReplayedAttempt {
    /// Nothing could be played.
    fn impossible(why: String) -> Self {
        Self {
            attempt: Attempt::new(Outcome::rig_error(why), Vec::new()),
            left: None,
            other: None,
            capture: None,
            exact: false,
            trouble: false,
            ended: ConversationEnd::of(&[]),
        }
    }
}

impl Recorded {
    /// Its name, with the number of the attempt where there are several.
    pub(super) fn title(&self) -> String {
        match self.attempt {
            0 | 1 => self.name.clone(),
            number => format!("{}, attempt {number}", self.name),
        }
    }

    /// What the record says of the attempt and its bytes do not bear out.
    pub(super) fn differs(&self, again: &ReplayedAttempt, header: &Header) -> Option<String> {
        let verdict = self.verdict.as_ref()?;
        verdict
            .verdict_differs(again)
            .or_else(|| self.unplaced_or_unused(verdict, header))
            .or_else(|| verdict.remarks_differ(again))
            .or_else(|| verdict.rest_differs(again, header))
    }

    /// Line errors and unused faults that cannot have been.
    fn unplaced_or_unused(&self, verdict: &RecordedVerdict, header: &Header) -> Option<String> {
        if header.simulated && verdict.unplaced > 0 {
            return Some("a simulated ring places every line error".to_owned());
        }
        let asked_for = self.events.iter().filter_map(|event| match event {
            LinkEvent::Fault(ring, _, PlacedFault::Link(link, fault), Moment::Byte(byte)) => {
                let drives = header.drives.get(*ring).copied().unwrap_or(0);
                let place = link_name(*ring, drives, *link);
                Some(format!("{UNUSED}{place} byte {byte}: {fault}"))
            }
            _ => None,
        });
        let asked_for: Vec<String> = asked_for.collect();
        let mut unused = verdict.unused().filter(|_| !header.simulated);
        let invented = unused.find(|remark| !asked_for.contains(remark))?;
        Some(format!(
            "the record says \"{invented}\", but no such fault was asked for"
        ))
    }
}

impl RecordedVerdict {
    fn verdict_differs(&self, again: &ReplayedAttempt) -> Option<String> {
        if let Some(other) = &again.other {
            return Some(other.clone());
        }
        let outcome = &again.attempt.outcome;
        let judged = outcome.verdict.name();
        let found = outcome.finding.as_ref().map(|found| found.message.clone());
        let why = found.clone().or_else(|| outcome.remarks.first().cloned());
        if self.verdict != judged {
            let why = why.map_or_else(String::new, |why| format!(": {why}"));
            let verdict = &self.verdict;
            return Some(format!(
                "the record says {verdict}, its bytes say {judged}{why}"
            ));
        }
        (self.finding != found).then(|| {
            format!(
                "the record says \"{}\", its bytes say \"{}\"",
                self.finding.as_deref().unwrap_or("nothing"),
                why.as_deref().unwrap_or("nothing")
            )
        })
    }

    /// Remarks and what came before the reset. Which faults never happened is not in the bytes that the master received.
    fn remarks_differ(&self, again: &ReplayedAttempt) -> Option<String> {
        let settled = |remarks: &[String]| -> Vec<String> {
            let captured = again.capture.is_some();
            let kept = |remark: &&String| captured || !remark.starts_with(UNUSED);
            remarks.iter().filter(kept).cloned().collect()
        };
        let (stated, given) = (
            settled(&self.remarks),
            settled(&again.attempt.outcome.remarks),
        );
        if stated != given {
            return Some(format!(
                "the record remarks \"{}\", its bytes give \"{}\"",
                stated.join("; "),
                given.join("; ")
            ));
        }
        let opening = again.attempt.opening.as_deref();
        let differs = again.exact && self.opening.as_deref() != opening;
        differs.then(|| {
            format!(
                "the record says of what came before the reset \"{}\", its bytes say \"{}\"",
                self.opening.as_deref().unwrap_or("nothing"),
                opening.unwrap_or("nothing")
            )
        })
    }

    /// What is left over, and the time.
    fn rest_differs(&self, again: &ReplayedAttempt, header: &Header) -> Option<String> {
        let outcome = &again.attempt.outcome;
        // Without looks, an attempt that was given up may have been so at any byte, and shows nothing.
        let given_up = outcome.unready.is_some()
            || matches!(outcome.verdict, Verdict::Skipped | Verdict::RigError);
        if given_up && !again.exact {
            return None;
        }
        if let Some(left) = &again.left {
            return Some(format!(
                "the record goes on where the scenario ends: {left} was not asked for"
            ));
        }
        let (least, most) = match again.exact {
            true => (outcome.took, outcome.took),
            false => header.could_take(outcome.took, &again.ended),
        };
        let possible = (least..=most).contains(&self.took);
        (!possible).then(|| {
            format!(
                "the record says that it took {}, its bytes say {least} to {most}",
                self.took
            )
        })
    }
}

impl Header {
    /// The shortest and the longest time that an attempt can have taken. Bytes sent last come round after its end, and if they
    /// are not fetched the record does not say when. In real time a wait also ends a little late.
    fn could_take(&self, took: Span, ended: &ConversationEnd) -> (Span, Span) {
        let real = match self.tolerance {
            Span::ZERO => Span::ZERO,
            tolerance => tolerance + WAITED,
        };
        let drives = self.drives.iter().max().copied().unwrap_or(0);
        let round = self.rate.byte_time() * (u64::from(drives) + 2);
        let most = took.max(ended.at) + round + ended.held + real;
        (took.saturating_sub(real), most)
    }
}

/// How the last conversation of an attempt ended, as far as its record says.
struct ConversationEnd {
    /// The time of its last event.
    at: Span,
    /// How long faults may have held bytes up.
    held: Span,
}

impl ConversationEnd {
    fn of(events: &[LinkEvent]) -> Self {
        let begin = |event: &LinkEvent| matches!(event, LinkEvent::Begin(_));
        let last = events.iter().rposition(begin).unwrap_or(0);
        let mut ended = Self {
            at: Span::ZERO,
            held: Span::ZERO,
        };
        for event in events.iter().skip(last + 1) {
            let at = match event {
                LinkEvent::Sent(_, at, _)
                | LinkEvent::Received(_, at, _)
                | LinkEvent::Probe(_, at, ..) => *at,
                LinkEvent::Tapped(_, _, at, _) => *at,
                LinkEvent::Fault(_, at, PlacedFault::Link(_, what), _) => {
                    if let LinkFault::Delay(span) | LinkFault::Break(span) = what {
                        ended.held = ended.held + *span;
                    }
                    *at
                }
                _ => continue,
            };
            ended.at = ended.at.max(at.since_start());
        }
        ended
    }
}
