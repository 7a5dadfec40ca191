//! Every verdict of a folder, judged again from its record.

use super::files::{
    self, KNOWN_PROFILE, RECORD, RIG, SCENARIOS, SUMS, compare_sums, read_text, sum,
};
use super::folder::EvidenceError;
use super::read::{RecordError, read};
use super::record::{Line, capabilities};
use crate::library::Entry;
use crate::link::{Event, LinkFault, PlacedFault, Recording, Replay};
use crate::rig::judge::{Heard, judge};
use crate::rig::run::{known, twin};
use crate::rig::{Driven, Rig, Way, parse_beside, play_one};
use crate::scenario::plan::Plan;
use crate::scenario::run::{AtFinding, Outcome, play};
use crate::scenario::simulate::simulated;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::twin::{Conversation, Exactness, Twin};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::Span;
use std::path::Path;

/// How much longer a busy computer may have waited in one attempt.
const WAITED: Span = Span::from_millis(1_000);

/// What was found out about one attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The scenario, and which attempt.
    pub name: String,
    /// The verdict in the record; `None` where the run did not come to it.
    pub recorded: Option<String>,
    /// The verdict as it is judged again.
    pub judged: String,
    /// What differs, if anything does.
    pub differs: Option<String>,
    /// Faults that were asked for and never happened, as the run told of them: a link's own bytes show them, not the master's.
    pub unused: Vec<String>,
}

/// What a folder is worth.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verified {
    /// What is wrong with its files: sums that differ, files that are missing or were added.
    pub files: Vec<String>,
    /// The attempts, in order.
    pub attempts: Vec<Finding>,
    /// Whether the run came to its end.
    pub complete: bool,
}

struct Header {
    rate: Rate,
    drives: Vec<u8>,
    rings: Vec<RingSize>,
    exactness: Exactness,
    capabilities: Vec<crate::link::Capability>,
    simulated: bool,
    /// Whether each scenario had simulated rings of its own.
    own_rings: bool,
    way: Way,
}

/// An attempt as it stands in a record.
pub(super) struct Recorded {
    pub(super) name: String,
    sha256: String,
    pub(super) attempt: usize,
    events: Vec<Event>,
    verdict: Option<Recalled>,
}

/// The verdict of a record.
struct Recalled {
    verdict: String,
    finding: Option<String>,
    remarks: Vec<String>,
    took: Span,
    unplaced: u64,
}

/// What came of an attempt that was played again.
pub(super) struct Again {
    pub(super) outcome: Outcome,
    /// The twin found something.
    stale: bool,
    /// What the record holds behind the end of the attempt.
    left: Option<String>,
    /// Where the record differs from what simulated rings of its own do.
    other: Option<String>,
    ended: Ended,
}

/// What a record is judged by.
pub struct Beside<'b> {
    /// The rig's file.
    pub rig: &'b Rig,
    /// The text of the scenario of a name, which is no path, or why there is none.
    pub scenario: &'b dyn Fn(&str) -> Result<String, String>,
}

/// Judges a folder again.
///
/// # Errors
/// It is no folder of evidence, or its record is damaged; with the place.
pub fn verify(path: &Path) -> Result<Verified, EvidenceError> {
    let files = compare_sums(path)?;
    let opened = Opened::folder(path)?;
    let mut verified = opened.verified(&scenarios(path))?;
    verified.files.splice(0..0, files);
    // The sums are written last.
    verified.complete &= path.join(SUMS).exists();
    Ok(verified)
}

/// The texts of a folder's scenarios.
pub(super) fn scenarios(path: &Path) -> impl Fn(&str) -> Result<String, String> {
    let path = path.to_owned();
    move |name| read_text(&path, &format!("{SCENARIOS}/{name}.scn"))
}

/// Judges a record again.
///
/// # Errors
/// It is damaged; with the place. Or it is of another rig.
pub fn judge_record(record: &[u8], beside: &Beside<'_>) -> Result<Verified, EvidenceError> {
    let opened = Opened::of(record, beside.rig.clone())?;
    opened.verified(beside.scenario)
}

/// A record that has been read, and what it is judged by.
pub(super) struct Opened {
    pub(super) lines: Vec<Line>,
    /// Whether the last line is.
    whole: bool,
    pub(super) rig: Rig,
    header: Header,
    /// What is wrong with the files that it names.
    files: Vec<String>,
}

impl Opened {
    /// Reads the record and the rig's file of a folder.
    pub(super) fn folder(path: &Path) -> Result<Self, EvidenceError> {
        let foreign = |what: String| EvidenceError::Foreign(path.display().to_string(), what);
        let record =
            files::read(path, RECORD).map_err(|error| foreign(format!("{RECORD}: {error}")))?;
        let beside = |name: &str| {
            let text = read_text(path, name)?.into_bytes();
            let name = path.join(name).display().to_string();
            Source::from_bytes(name, text).map_err(|error| error.to_string())
        };
        let source = beside(RIG).map_err(foreign)?;
        let rig = parse_beside(&source, &|_| beside(KNOWN_PROFILE));
        Self::of(
            &record,
            rig.map_err(|problems| foreign(problems.to_string()))?,
        )
    }

    fn of(record: &[u8], rig: Rig) -> Result<Self, EvidenceError> {
        let (lines, whole) = read(record)?;
        let mut files = Vec::new();
        let header = header(&lines, &rig, &mut files).map_err(|message| RecordError {
            line: 1,
            column: 1,
            offset: 0,
            message,
        })?;
        Ok(Self {
            lines,
            whole,
            rig,
            header,
            files,
        })
    }

    /// The rate of the line.
    pub(super) fn rate(&self) -> Rate {
        self.header.rate
    }

    /// Plays every attempt again from its record: its text and what came of it, or why it cannot be.
    pub(super) fn judged(
        &self,
        scenario: &dyn Fn(&str) -> Result<String, String>,
        mut each: impl FnMut(Recorded, Result<(String, Again), String>),
    ) -> Result<(), EvidenceError> {
        let fresh = || {
            twin(&self.rig, &known(&self.rig))
                .map_err(|problems| EvidenceError::Foreign(RIG.to_owned(), problems.to_string()))
        };
        let mut own = fresh()?;
        for recorded in group(&self.lines[1..]) {
            let text = match is_name(&recorded.name) {
                true => scenario(&recorded.name),
                false => Err("this is no name of a scenario".to_owned()),
            };
            let judged = match text {
                Err(why) => Err(why),
                Ok(text) if sum(text.as_bytes()) != recorded.sha256 => Err(format!(
                    "{SCENARIOS}/{}.scn is not the text that was played",
                    recorded.name
                )),
                Ok(text) => {
                    let again = again(&recorded, &text, &self.header, &self.rig, &mut own);
                    if again.stale {
                        own = fresh()?;
                    }
                    Ok((text, again))
                }
            };
            each(recorded, judged);
        }
        Ok(())
    }

    /// What the record is worth.
    fn verified(
        &self,
        scenario: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Verified, EvidenceError> {
        let mut verified = Verified {
            files: self.files.clone(),
            attempts: Vec::new(),
            complete: self.whole && matches!(self.lines.last(), Some(Line::End { .. })),
        };
        self.judged(scenario, |recorded, judged| {
            let finding = match judged {
                Err(why) => recorded.with("aborted", Some(why)),
                Ok((_, again)) => recorded.compare(&again, &self.header),
            };
            // The ring was lost in the middle of it.
            verified.complete &= finding.recorded.is_some();
            verified.attempts.push(finding);
        })?;
        Ok(verified)
    }
}

/// What the first line says, and what of it cannot be.
fn header(lines: &[Line], rig: &Rig, files: &mut Vec<String>) -> Result<Header, String> {
    let Some(Line::Run {
        rig_sha256,
        rate,
        rings: drives,
        tolerance,
        simulated,
        capabilities: names,
        anew,
        own_rings,
        ..
    }) = lines.first()
    else {
        return Err("the record of a run expected here".to_owned());
    };
    if *rig_sha256 != sum(rig.text.as_bytes()) {
        files.push(format!("{RIG} is not the file that was used"));
    }
    let sizes = drives.iter().map(|n| RingSize::new((*n).into()).ok());
    let rings = sizes.collect::<Option<Vec<_>>>();
    let rings = rings.ok_or("a ring has 1 to 250 drives (ND21 8.4)")?;
    let own: Vec<u8> = rig.rings().map(|(_, ring)| ring.drives).collect();
    if own != *drives {
        return Err(format!(
            "the record is of rings of {drives:?} drives, {RIG} has {own:?}"
        ));
    }
    let rate = Rate::from_bits_per_second(*rate)
        .ok_or_else(|| format!("{rate} bit/s is no rate of the line (ND21 8.3)"))?;
    let capabilities = capabilities(names);
    let health = &rig.file.health;
    Ok(Header {
        rate,
        drives: drives.clone(),
        exactness: Exactness {
            tolerance: Span::from_units(*tolerance),
            line_errors: capabilities.contains(&crate::link::Capability::LineErrors),
            knows_cells: *simulated,
            looks: None,
        },
        capabilities,
        simulated: *simulated,
        own_rings: *own_rings,
        way: Way {
            rings: rings.clone(),
            attempts: health.between.then_some(health.attempts),
            anew: *anew,
        },
        rings,
    })
}

/// The attempts of a record.
fn group(lines: &[Line]) -> Vec<Recorded> {
    let mut all: Vec<Recorded> = Vec::new();
    for line in lines {
        match line {
            Line::Scenario {
                name,
                sha256,
                attempt,
            } => all.push(Recorded {
                name: name.clone(),
                sha256: sha256.clone(),
                attempt: *attempt,
                events: Vec::new(),
                verdict: None,
            }),
            Line::Verdict {
                verdict,
                finding,
                remarks,
                took,
                unplaced,
            } => {
                if let Some(last) = all.last_mut() {
                    last.verdict = Some(Recalled {
                        verdict: verdict.clone(),
                        finding: finding.clone(),
                        remarks: remarks.clone(),
                        took: Span::from_units(*took),
                        unplaced: *unplaced,
                    });
                }
            }
            line => {
                if let (Some(last), Some(event)) = (all.last_mut(), line.event()) {
                    last.events.push(event);
                }
            }
        }
    }
    all
}

/// Whether a name leads to a file of the folder and nowhere else.
pub(super) fn is_name(name: &str) -> bool {
    let safe = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    !name.is_empty() && !name.starts_with('.') && name.chars().all(safe)
}

/// Plays an attempt again from its record.
fn again(recorded: &Recorded, text: &str, header: &Header, rig: &Rig, twin: &mut Twin) -> Again {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let size = header.rings.first().map(|ring| ring.drives());
    let entry = Entry::new(source, size).map_err(|problems| problems.to_string());
    let plan = entry.and_then(|entry| entry.plan.ok_or("no scenario of this bus".to_owned()));
    let mut plan = match plan {
        Ok(plan) if plan.rings == header.rings => plan,
        Ok(_) => return Again::impossible("it is for other rings than the rig has".to_owned()),
        Err(why) => return Again::impossible(why),
    };
    if header.own_rings {
        return simulated_again(recorded, &plan);
    }
    let own = rig.plan().ok().and_then(|rig| rig.master);
    plan.master = own.or(plan.master);
    let mut replay = Replay::new(
        recorded.events.clone(),
        header.rate,
        header.exactness.tolerance,
        header.drives.clone(),
        header.capabilities.clone(),
    );
    let mut outcome = match play_one(&mut replay, &plan, &header.way) {
        Ok(outcome) => outcome,
        Err((_, ill)) => Outcome::rig_error(ill.to_string()),
    };
    let all = Conversation::all(&recorded.events, header.rate.byte_time(), header.simulated);
    let (conversations, anew) = header.way.compared(all, header.exactness);
    if anew && let Ok(fresh) = self::twin(rig, &known(rig)) {
        *twin = fresh;
    }
    let (comparisons, stale) = twin.follow_all(&conversations, header.exactness);
    let unplaced = recorded
        .verdict
        .as_ref()
        .map_or(0, |recalled| recalled.unplaced);
    let capabilities = (header.exactness.tolerance, header.capabilities.as_slice());
    let driven = Driven::new(&plan, &recorded.events, &header.way, capabilities, &outcome);
    if let Some(driven) = driven.filter(|_| header.simulated) {
        driven.judge(&mut outcome);
    }
    let heard = Heard {
        rig,
        plan: &plan,
        way: &header.way,
        exactness: header.exactness,
        conversations: &conversations,
        comparisons: &comparisons,
        unplaced,
    };
    judge(&mut outcome, &heard);
    Again {
        outcome,
        stale,
        left: replay.left(),
        other: None,
        ended: Ended::of(&recorded.events),
    }
}

/// Plays an attempt again on simulated rings of its own: everything that was recorded must come again.
fn simulated_again(recorded: &Recorded, plan: &Plan) -> Again {
    let mut link = simulated(plan);
    let mut events: Vec<Event> = Vec::new();
    let mut recording = Recording::whole(&mut link, &mut events);
    let outcome = play(plan, &mut recording, AtFinding::Stop);
    let written = |events: &[Event]| -> Vec<Line> { events.iter().filter_map(Line::of).collect() };
    let (theirs, own) = (written(&recorded.events), written(&events));
    let differs = (0..theirs.len().max(own.len())).find(|at| theirs.get(*at) != own.get(*at));
    let show = |line: Option<&Line>| match line.map(serde_json::to_string) {
        Some(Ok(text)) => text,
        _ => "nothing more".to_owned(),
    };
    Again {
        outcome,
        stale: false,
        left: None,
        other: differs.map(|at| {
            format!(
                "event {}: the record has {}, the simulated rings give {}",
                at + 1,
                show(theirs.get(at)),
                show(own.get(at))
            )
        }),
        ended: Ended::of(&recorded.events),
    }
}

impl Again {
    /// Nothing could be played.
    fn impossible(why: String) -> Self {
        Self {
            outcome: Outcome::rig_error(why),
            stale: false,
            left: None,
            other: None,
            ended: Ended::of(&[]),
        }
    }
}

/// What a remark about a fault begins with that was asked for and never happened.
const UNUSED: &str = "this fault never happened: ";

impl Recorded {
    fn with(&self, judged: &str, differs: Option<String>) -> Finding {
        let number = if self.attempt > 1 {
            format!(", attempt {}", self.attempt)
        } else {
            String::new()
        };
        let remarks = self.verdict.iter().flat_map(|recalled| &recalled.remarks);
        Finding {
            name: format!("{}{number}", self.name),
            recorded: self.verdict.as_ref().map(|own| own.verdict.clone()),
            judged: judged.to_owned(),
            differs,
            unused: remarks
                .filter_map(|remark| remark.strip_prefix(UNUSED))
                .map(str::to_owned)
                .collect(),
        }
    }

    fn compare(&self, again: &Again, header: &Header) -> Finding {
        let judged = again.outcome.verdict.name();
        let differs = self.verdict.as_ref();
        let differs = differs.and_then(|own| own.differs(again, header));
        self.with(judged, differs)
    }
}

impl Recalled {
    /// What of it the bytes do not bear out.
    fn differs(&self, again: &Again, header: &Header) -> Option<String> {
        let outcome = &again.outcome;
        if let Some(other) = &again.other {
            return Some(other.clone());
        }
        let judged = outcome.verdict.name();
        let found = outcome.finding.as_ref().map(|found| found.message.clone());
        if self.verdict != judged {
            let why = found.or_else(|| outcome.remarks.first().cloned());
            let why = why.map_or_else(String::new, |why| format!(": {why}"));
            let verdict = &self.verdict;
            return Some(format!(
                "the record says {verdict}, its bytes say {judged}{why}"
            ));
        }
        if self.finding != found {
            return Some(format!(
                "the record says \"{}\", its bytes say \"{}\"",
                self.finding.as_deref().unwrap_or("nothing"),
                found.as_deref().unwrap_or("nothing")
            ));
        }
        // An attempt that was given up may have been so at any byte, and shows nothing.
        let given_up = outcome.unready.is_some();
        if given_up || matches!(outcome.verdict, Verdict::Skipped | Verdict::RigError) {
            return None;
        }
        if let Some(left) = &again.left {
            return Some(format!(
                "the record goes on where the scenario ends: {left} was not asked for"
            ));
        }
        let (least, most) = header.could_take(outcome.took, &again.ended);
        if (least..=most).contains(&self.took) {
            return None;
        }
        Some(format!(
            "the record says that it took {}, its bytes say {least} to {most}",
            self.took
        ))
    }
}

impl Header {
    /// What an attempt can have taken. What was sent comes round behind its end, and where nobody fetches it the record does not
    /// say when; where time is real, a wait ends a little later than it was to.
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
    fn of(events: &[Event]) -> Self {
        let begin = |event: &Event| matches!(event, Event::Begin(_));
        let last = events.iter().rposition(begin).unwrap_or(0);
        let mut ended = Self {
            at: Span::ZERO,
            held: Span::ZERO,
        };
        for event in events.iter().skip(last + 1) {
            let at = match event {
                Event::Sent(_, at, _) | Event::Received(_, at, _) | Event::Probe(_, at, ..) => *at,
                Event::Fault(_, at, PlacedFault::Link(_, what), _) => {
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
