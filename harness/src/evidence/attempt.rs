//! An attempt at a scenario, played again from its record and judged again.

use super::folder::capture;
use super::header::Header;
use super::record::RecordLine;
use crate::buses::novobus::rig::BesideTwin;
use crate::buses::novobus::rig::judge::known;
use crate::buses::novobus::rig::judge::{AttemptFacts, judge};
use crate::buses::novobus::rig::run::{Way, opening, twin};
use crate::buses::novobus::rig::sim::RigOfRings;
use crate::buses::novobus::rig::{Driven, play_one};
use crate::buses::twin::{Conversation, Twin};
use crate::file::values::LinkName;
use crate::library::Entry;
use crate::link::{
    Line as _, LinkEvent, LinkFault, Moment, PlacedFault, Recording, Replay, Trouble, link_name,
};
use crate::rig::file::{Interposer, Transport};
use crate::rig::segment::SegmentJudge;
use crate::rig::{Attempt, Rig, SessionError};
use crate::scenario::run::{AtMismatch, Outcome};
use crate::scenario::settled::Settled;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::sync::Arc;

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
    pub(super) verdict: Option<Recalled>,
}

/// The verdict of a record.
#[derive(Clone)]
pub(super) struct Recalled {
    pub(super) verdict: String,
    pub(super) finding: Option<String>,
    pub(super) remarks: Vec<String>,
    pub(super) took: Span,
    pub(super) unplaced: u64,
    pub(super) opening: Option<String>,
}

impl Recalled {
    /// Its remarks about faults that never happened.
    pub(super) fn unused(&self) -> impl Iterator<Item = &String> {
        let remarks = self.remarks.iter();
        remarks.filter(|remark| remark.starts_with(UNUSED))
    }
}

/// The outcome of an attempt that was played again.
pub(super) struct Again {
    /// Its outcome, and in a qualification its conversations and how they compare with the twin's.
    pub(super) attempt: Attempt,
    /// The twin found something.
    pub(super) stale: bool,
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
    ended: Ended,
}

/// Plays an attempt again from its record, in the way in which it went.
pub(super) fn again(
    recorded: &Recorded,
    text: &str,
    (header, way): (&Header, &Way),
    rig: &Rig,
    twin: &mut Twin,
) -> Again {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let size = header.way.rings.first().map(|ring| ring.drives());
    let entry = Entry::fitting(source, size).map_err(|problems| problems.to_string());
    let plan = entry.and_then(|entry| entry.plan.ok_or("no scenario of this bus".to_owned()));
    let mut plan = match plan {
        Ok(plan) if plan.rings == header.way.rings => plan,
        Ok(_) => return Again::impossible("it is for other rings than the rig has".to_owned()),
        Err(why) => return Again::impossible(why),
    };
    let own = rig.plan().ok().and_then(|rig| rig.master);
    plan.master = own.or(plan.master);
    let mut replay = Replay::new(
        recorded.events.clone(),
        header.rate,
        header.exactness.tolerance,
        header.drives.clone(),
        header.capabilities.clone(),
    )
    .reaching(reached(rig, header))
    .listening(heard(rig, header));
    let exact = replay.is_exact();
    let mut outcome = match play_one(&mut replay, &plan, way) {
        Ok(outcome) => outcome,
        Err((ring, ill)) => {
            let rig = rig.id().to_owned();
            let ring = ring + 1;
            Outcome::rig_error(
                SessionError::Ill {
                    rig,
                    ring,
                    ill: Box::new(ill),
                    cause: None,
                }
                .to_string(),
            )
        }
    };
    let all = Conversation::all(&recorded.events, header.rate.byte_time(), header.simulated);
    let opening = opening(rig, way, &all, header.exactness);
    let (conversations, anew) = way.compared(all, header.exactness);
    if anew && let Ok(fresh) = self::twin(rig, &known(rig)) {
        *twin = fresh;
    }
    let (comparisons, stale) = twin.follow_all(&conversations, way.exactness(header.exactness));
    let unplaced = recorded
        .verdict
        .as_ref()
        .map_or(0, |recalled| recalled.unplaced);
    let capabilities = (header.exactness.tolerance, header.capabilities.as_slice());
    let driven = Driven::new(&plan, &recorded.events, way, capabilities, &outcome);
    let driven = driven.filter(|_| header.simulated);
    let master_is_right = driven.as_ref().is_none_or(|own| own.judge(&mut outcome));
    let heard = AttemptFacts {
        rig,
        plan: &plan,
        way,
        exactness: header.exactness,
        conversations: &conversations,
        comparisons: &comparisons,
        unplaced,
        alive: &|| {},
    };
    let assumed = judge(&mut outcome, &heard);
    let mut attempt = Attempt::new(outcome, Vec::new());
    (attempt.opening, attempt.unplaced) = (opening, unplaced);
    if header.qualified {
        let beside = BesideTwin {
            conversations,
            comparisons,
            driven,
            assumed: Default::default(),
        };
        attempt.master_is_right = master_is_right;
        attempt.own = Some(Arc::new(beside.with(assumed)));
    }
    Again {
        attempt,
        stale,
        left: replay.left(),
        other: None,
        capture: None,
        exact,
        trouble: replay.trouble().is_some(),
        ended: Ended::of(&recorded.events),
    }
}

/// Judges an attempt on a rig with a port again.
///
/// # Errors
/// Its text is no scenario of the rig's bus, in a sentence.
pub(super) fn again_on_segment(
    recorded: &Recorded,
    text: &str,
    judge: &mut dyn SegmentJudge,
) -> Result<Again, String> {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let mut judged = judge.judge(&source, &recorded.events)?;
    let unplaced = recorded.verdict.as_ref().map_or(0, |own| own.unplaced);
    judged.outcome.unplaced(unplaced);
    if unplaced > 0 {
        judge.doubt();
    }
    let (other, made) = match &judged.played {
        Some((events, traces)) => (
            first_difference(&recorded.events, events),
            Some(capture(traces, &judged.outcome)),
        ),
        None => (None, None),
    };
    Ok(Again {
        attempt: Attempt {
            opening: judged.before,
            unplaced,
            ..Attempt::new(judged.outcome, Vec::new())
        },
        stale: false,
        left: judged.left,
        other,
        capture: made,
        exact: true,
        trouble: judged.trouble,
        ended: Ended::of(&recorded.events),
    })
}

/// Plays an attempt again on a simulated bench of its own.
pub(super) fn again_on_own_bench(recorded: &Recorded, text: &str, header: &Header) -> Again {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let rings = &header.way.rings;
    let size = rings.first().map(|ring| ring.drives());
    match Entry::fitting(source, size) {
        Err(problems) => Again::impossible(problems.to_string()),
        Ok(entry) => match (&entry.plan, entry.settled()) {
            (Some(plan), _) if plan.rings != *rings => {
                Again::impossible("it is for other rings than the rig has".to_owned())
            }
            (_, Some(plan)) => simulated_again(recorded, plan),
            (_, None) => Again::impossible("no scenario of this bus".to_owned()),
        },
    }
}

/// Plays an attempt again on simulated rings of its own: everything that was recorded must come again.
fn simulated_again(recorded: &Recorded, plan: &dyn Settled) -> Again {
    let mut link = plan.simulate();
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::whole(&mut *link, &mut events);
    let outcome = plan.play(&mut recording, AtMismatch::Stop);
    let traces: Vec<_> = (0..plan.ports()).map(|port| link.trace(port)).collect();
    Again {
        capture: Some(capture(&traces, &outcome)),
        exact: true,
        trouble: false,
        attempt: Attempt::new(outcome, traces),
        stale: false,
        left: None,
        other: first_difference(&recorded.events, &events),
        ended: Ended::of(&recorded.events),
    }
}

/// The first event of a record that is not what simulated drives give when it is played again.
fn first_difference(recorded: &[LinkEvent], played: &[LinkEvent]) -> Option<String> {
    let written = |events: &[LinkEvent]| -> Vec<RecordLine> {
        events.iter().filter_map(RecordLine::of).collect()
    };
    let (theirs, own) = (written(recorded), written(played));
    let at = (0..theirs.len().max(own.len())).find(|at| theirs.get(*at) != own.get(*at))?;
    let show = |line: Option<&RecordLine>| match line.map(serde_json::to_string) {
        Some(Ok(text)) => text,
        _ => "nothing more".to_owned(),
    };
    Some(format!(
        "event {}: the record has {}, the simulated rings give {}",
        at + 1,
        show(theirs.get(at)),
        show(own.get(at))
    ))
}

impl Again {
    /// Nothing could be played.
    fn impossible(why: String) -> Self {
        Self {
            attempt: Attempt::new(Outcome::rig_error(why), Vec::new()),
            stale: false,
            left: None,
            other: None,
            capture: None,
            exact: false,
            trouble: false,
            ended: Ended::of(&[]),
        }
    }
}

/// The inner links at which the bench can put faults; those at its own ends need none.
pub(super) fn reached(rig: &Rig, header: &Header) -> Vec<(usize, usize)> {
    let interposers = rig.file.interposer.iter();
    links(header, interposers.map(|own| (own.ring, own.link)))
}

/// Those of them on which no byte can get a wrong parity bit: with an interposer that has one serial port for both directions.
pub(super) fn keeping_parity(rig: &Rig, header: &Header) -> Vec<(usize, usize)> {
    let one = |own: &&Interposer| {
        own.upstream == own.downstream && own.upstream.transport == Transport::Serial
    };
    let drives = |ring: usize| header.drives.get(ring).copied().unwrap_or(0);
    let interposers = rig.file.interposer.iter().filter(one);
    interposers
        .map(|own| place(&drives, own.ring, own.link))
        .collect()
}

/// The links on which bytes were seen: by ring and place.
pub(super) fn heard(rig: &Rig, header: &Header) -> Vec<(usize, usize)> {
    let interposers = rig.file.interposer.iter().map(|own| (own.ring, own.link));
    let taps = rig.file.tap.iter().map(|own| (own.ring, own.link));
    links(header, interposers.chain(taps))
}

/// The ring and the place of a link between drives, as a rig's file names it.
fn place(drives: &dyn Fn(usize) -> u8, ring: u8, link: LinkName) -> (usize, usize) {
    let ring = usize::from(ring).saturating_sub(1);
    let from = link.from;
    let place = from.map_or(0, |from| drives(ring).saturating_sub(from));
    (ring, usize::from(place))
}

/// The master's own links and those between drives that are given by the number of their ring; all links of simulated rings.
fn links(header: &Header, inner: impl Iterator<Item = (u8, LinkName)>) -> Vec<(usize, usize)> {
    let drives = |ring: usize| header.drives.get(ring).copied().unwrap_or(0);
    let inner: Vec<_> = inner
        .map(|(ring, link)| place(&drives, ring, link))
        .collect();
    let all = (0..header.drives.len())
        .flat_map(|ring| (0..=usize::from(drives(ring))).map(move |place| (ring, place)));
    let end = |(ring, place): &(usize, usize)| *place == 0 || *place == usize::from(drives(*ring));
    all.filter(|place| header.simulated || end(place) || inner.contains(place))
        .collect()
}

impl Recorded {
    /// Whether the rig's limits denied something in it.
    pub(super) fn was_denied(&self) -> bool {
        let denied = |event: &LinkEvent| matches!(event, LinkEvent::Trouble(Trouble::Denied(_)));
        self.events.iter().any(denied)
    }

    /// Its name, with the number of the attempt where there are several.
    pub(super) fn title(&self) -> String {
        match self.attempt {
            0 | 1 => self.name.clone(),
            number => format!("{}, attempt {number}", self.name),
        }
    }

    /// What the record says of the attempt and its bytes do not bear out.
    pub(super) fn differs(&self, again: &Again, header: &Header) -> Option<String> {
        let own = self.verdict.as_ref()?;
        own.verdict_differs(again)
            .or_else(|| self.unplaced_or_unused(own, header))
            .or_else(|| own.remarks_differ(again))
            .or_else(|| own.rest_differs(again, header))
    }

    /// Line errors and unused faults that cannot have been.
    fn unplaced_or_unused(&self, own: &Recalled, header: &Header) -> Option<String> {
        if header.simulated && own.unplaced > 0 {
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
        let mut unused = own.unused().filter(|_| !header.simulated);
        let invented = unused.find(|remark| !asked_for.contains(remark))?;
        Some(format!(
            "the record says \"{invented}\", but no such fault was asked for"
        ))
    }
}

impl Recalled {
    fn verdict_differs(&self, again: &Again) -> Option<String> {
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
    fn remarks_differ(&self, again: &Again) -> Option<String> {
        let settled = |remarks: &[String]| -> Vec<String> {
            let remarks = remarks.iter();
            let kept = remarks.filter(|own| again.capture.is_some() || !own.starts_with(UNUSED));
            kept.cloned().collect()
        };
        let (stated, own) = (
            settled(&self.remarks),
            settled(&again.attempt.outcome.remarks),
        );
        if stated != own {
            return Some(format!(
                "the record remarks \"{}\", its bytes give \"{}\"",
                stated.join("; "),
                own.join("; ")
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
    fn rest_differs(&self, again: &Again, header: &Header) -> Option<String> {
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
    fn could_take(&self, took: Span, ended: &Ended) -> (Span, Span) {
        let real = match self.exactness.tolerance {
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
struct Ended {
    /// The time of its last event.
    at: Span,
    /// How long faults may have held bytes up.
    held: Span,
}

impl Ended {
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
