//! Every verdict of a folder, judged again from its record.

use super::folder::{EvidenceError, RECORD, RIG, SCENARIOS, SUMS, sum, sums};
use super::record::{Line, capabilities, read};
use crate::library::Entry;
use crate::link::{Event, Replay};
use crate::rig::run::{judge, known, twin};
use crate::rig::{Driven, Rig, Way, parse, play_one};
use crate::scenario::run::Outcome;
use crate::scenario::source::Source;
use crate::twin::{Conversation, Exactness, Twin};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::Span;
use std::collections::BTreeMap;
use std::path::Path;

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
    way: Way,
}

/// An attempt as it stands in a record.
pub(super) struct Recorded {
    pub(super) name: String,
    sha256: String,
    pub(super) attempt: usize,
    events: Vec<Event>,
    verdict: Option<(String, Option<String>, u64)>,
}

/// Judges a folder again.
///
/// # Errors
/// It is no folder of evidence, or its record is damaged; with the place.
pub fn verify(path: &Path) -> Result<Verified, EvidenceError> {
    let mut verified = Verified {
        files: compare_sums(path)?,
        ..Verified::default()
    };
    let opened = Opened::open(path, &mut verified)?;
    // The sums are written last.
    verified.complete = opened.whole
        && path.join(SUMS).exists()
        && matches!(opened.lines.last(), Some(Line::End { .. }));
    opened.judged(|recorded, judged| {
        verified.attempts.push(match judged {
            Ok((_, outcome)) => recorded.compare(&outcome),
            Err(why) => recorded.with("aborted", Some(why)),
        });
    })?;
    Ok(verified)
}

/// A folder that is read.
pub(super) struct Opened<'p> {
    path: &'p Path,
    pub(super) lines: Vec<Line>,
    /// Whether the last line is.
    whole: bool,
    pub(super) rig: Rig,
    header: Header,
}

impl<'p> Opened<'p> {
    /// Reads the record and the rig's file; what is wrong with the files goes into `verified`.
    pub(super) fn open(path: &'p Path, verified: &mut Verified) -> Result<Self, EvidenceError> {
        let foreign = |why: String| EvidenceError::Foreign(path.display().to_string(), why);
        let text = |file: &str| {
            std::fs::read_to_string(path.join(file))
                .map_err(|error| foreign(format!("{file}: {error}")))
        };
        let (lines, whole) = read(&text(RECORD)?)?;
        let rig_text = text(RIG)?;
        let rig = parse(&Source {
            name: path.join(RIG).display().to_string(),
            text: rig_text.clone().into(),
        })
        .map_err(|problems| foreign(problems.to_string()))?;
        let header = header(&lines, &rig, &rig_text, verified)
            .ok_or_else(|| foreign("the record's first line holds what cannot be".to_owned()))?;
        Ok(Self {
            path,
            lines,
            whole,
            rig,
            header,
        })
    }

    /// The rate of the line.
    pub(super) fn rate(&self) -> Rate {
        self.header.rate
    }

    /// Plays every attempt again from its record: its text and what came of it, or why it cannot be.
    pub(super) fn judged(
        &self,
        mut each: impl FnMut(Recorded, Result<(String, Outcome), String>),
    ) -> Result<(), EvidenceError> {
        let fresh = || {
            twin(&self.rig, &known(&self.rig)).map_err(|problems| {
                EvidenceError::Foreign(self.path.display().to_string(), problems.to_string())
            })
        };
        let mut own = fresh()?;
        for recorded in group(&self.lines[1..]) {
            let file = format!("{SCENARIOS}/{}.scn", recorded.name);
            let judged = match std::fs::read_to_string(self.path.join(&file)) {
                _ if !is_name(&recorded.name) => Err("this is no name of a scenario".to_owned()),
                Err(error) => Err(format!("{file}: {error}")),
                Ok(text) if sum(text.as_bytes()) != recorded.sha256 => {
                    Err(format!("{file} is not the text that was played"))
                }
                Ok(text) => {
                    let (outcome, stale) =
                        again(&recorded, &text, &self.header, &self.rig, &mut own);
                    if stale {
                        own = fresh()?;
                    }
                    Ok((text, outcome))
                }
            };
            each(recorded, judged);
        }
        Ok(())
    }
}

fn header(lines: &[Line], rig: &Rig, rig_text: &str, verified: &mut Verified) -> Option<Header> {
    let Some(Line::Run {
        rig_sha256,
        rate,
        rings: drives,
        tolerance,
        simulated,
        capabilities: names,
        anew,
        ..
    }) = lines.first()
    else {
        return None;
    };
    if *rig_sha256 != sum(rig_text.as_bytes()) {
        verified
            .files
            .push(format!("{RIG} is not the file that was used"));
    }
    let sizes = drives.iter().map(|n| RingSize::new((*n).into()).ok());
    let rings = sizes.collect::<Option<Vec<_>>>()?;
    let capabilities = capabilities(names);
    let health = &rig.file.health;
    Some(Header {
        rate: Rate::from_bits_per_second(*rate)?,
        drives: drives.clone(),
        exactness: Exactness {
            tolerance: Span::from_units(*tolerance),
            line_errors: capabilities.contains(&crate::link::Capability::LineErrors),
            knows_cells: *simulated,
            looks: None,
        },
        capabilities,
        simulated: *simulated,
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
                unplaced,
                ..
            } => {
                if let Some(last) = all.last_mut() {
                    last.verdict = Some((verdict.clone(), finding.clone(), *unplaced));
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

/// Plays an attempt again from its record, and says whether the twin found something.
fn again(
    recorded: &Recorded,
    text: &str,
    header: &Header,
    rig: &Rig,
    twin: &mut Twin,
) -> (Outcome, bool) {
    let source = Source {
        name: recorded.name.clone(),
        text: text.to_owned().into(),
    };
    let size = header.rings.first().map(|ring| ring.drives());
    let mut plan = match Entry::new(source, size) {
        Ok(Entry {
            plan: Some(plan), ..
        }) => plan,
        Ok(_) => {
            return (
                Outcome::rig_error("no scenario of this bus".to_owned()),
                false,
            );
        }
        Err(problems) => return (Outcome::rig_error(problems.to_string()), false),
    };
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
        .map_or(0, |(.., unplaced)| *unplaced);
    let capabilities = (header.exactness.tolerance, header.capabilities.as_slice());
    let driven = Driven::new(&plan, &recorded.events, &header.way, capabilities, &outcome);
    if let Some(driven) = driven.filter(|_| header.simulated) {
        driven.judge(&mut outcome);
    }
    judge(&mut outcome, &comparisons, unplaced, &rig.file.deviation);
    (outcome, stale)
}

impl Recorded {
    fn with(&self, judged: &str, differs: Option<String>) -> Finding {
        let number = if self.attempt > 1 {
            format!(", attempt {}", self.attempt)
        } else {
            String::new()
        };
        Finding {
            name: format!("{}{number}", self.name),
            recorded: self.verdict.as_ref().map(|(verdict, ..)| verdict.clone()),
            judged: judged.to_owned(),
            differs,
        }
    }

    fn compare(&self, outcome: &Outcome) -> Finding {
        let judged = outcome.verdict.name();
        let found = outcome.finding.as_ref().map(|found| found.message.clone());
        let differs = match &self.verdict {
            None => None,
            Some((verdict, ..)) if verdict != judged => Some(format!(
                "the record says {verdict}, its bytes say {judged}{}",
                match found.or_else(|| outcome.remarks.first().cloned()) {
                    Some(found) => format!(": {found}"),
                    None => String::new(),
                }
            )),
            Some((_, finding, _)) if *finding != found => Some(format!(
                "the record says \"{}\", its bytes say \"{}\"",
                finding.as_deref().unwrap_or("nothing"),
                found.as_deref().unwrap_or("nothing")
            )),
            Some(_) => None,
        };
        self.with(judged, differs)
    }
}

/// What is wrong with the files of a folder; nothing where there are no sums, as of a run that did not end.
fn compare_sums(path: &Path) -> Result<Vec<String>, EvidenceError> {
    let stated = match std::fs::read(path.join(SUMS)) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(_) => return Ok(Vec::new()),
    };
    let table = |text: &str| -> BTreeMap<String, String> {
        let pairs = text.lines().filter_map(|line| line.split_once("  "));
        pairs
            .map(|(sum, file)| (file.to_owned(), sum.to_owned()))
            .collect()
    };
    let (stated, found) = (table(&stated), table(&sums(path)?));
    let mut wrong = Vec::new();
    for (file, sum) in &stated {
        match found.get(file) {
            None => wrong.push(format!("{file} is missing")),
            Some(own) if own != sum => wrong.push(format!("{file} was changed")),
            Some(_) => {}
        }
    }
    let added = found.keys().filter(|file| !stated.contains_key(*file));
    wrong.extend(added.map(|file| format!("{file} was added")));
    Ok(wrong)
}
