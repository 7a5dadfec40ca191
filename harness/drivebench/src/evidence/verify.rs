//! Every verdict of a folder, judged again from its record, and everything that follows from the record compared.

use super::attempt::{
    Recorded, RecordedVerdict, ReplayedAttempt, UNUSED, again, again_on_own_bench,
};
use super::cases;
use super::derive::derived;
use super::error::EvidenceError;
use super::error::RecordError;
use super::files::{
    DEVIATIONS, KNOWN_PROFILE, PROFILE, RECORD, RIG, SCENARIOS, SUMS, compare_sums, read_text, sum,
};
use super::header::{Header, header};
use super::keep::left_out;
use super::qualified::{self, QualifiedAgain};
use super::read::{read, unlike_written};
use super::record::RecordLine;
use super::reports;
use super::rerun::rerun;
use super::sealed::unsigned;
use super::selection;
use super::signature::{self, Signer};
use crate::buses::{RIG_BUSES, judge_of};
use crate::counted::counted;
use crate::regular::{self, Links};
use crate::rig::playing::RecordJudge;
use crate::rig::{Rig, parse_beside};
use crate::scenario::run::DENIED;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// What was found out about one attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rejudged {
    /// The scenario, and which attempt.
    pub name: String,
    /// The verdict in the record; `None` where the run did not come to it.
    pub recorded: Option<String>,
    /// The verdict as it is judged again.
    pub judged: String,
    /// What differs, if anything does.
    pub differs: Option<String>,
    /// Faults that were requested and never happened, as the run reported them: the bytes of the fault's own link show this, the
    /// master's bytes do not.
    pub unused: Vec<String>,
}

/// What a folder is worth.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verified {
    /// What is wrong with its files: sums that differ, files that are missing or were added.
    pub files: Vec<String>,
    /// The attempts, in order.
    pub attempts: Vec<Rejudged>,
    /// Whether the run came to its end, and this program could compare everything that follows from its record.
    pub complete: bool,
    /// What nothing in the folder confirms, in sentences.
    pub unconfirmed: Vec<String>,
}

impl Verified {
    /// Whether nothing is wrong.
    fn is_right(&self) -> bool {
        self.first_wrong().is_none()
    }

    /// The first thing that is wrong, in a sentence.
    #[must_use]
    pub fn first_wrong(&self) -> Option<&String> {
        let attempts = self.attempts.iter();
        let differs = attempts.filter_map(|attempt| attempt.differs.as_ref());
        self.files.iter().chain(differs).next()
    }
}

/// What a record is judged by.
pub struct Beside<'b> {
    /// The rig's file.
    pub rig: &'b Rig,
    /// The text of the scenario of a name, which is no path, or why there is none.
    pub scenario: &'b dyn Fn(&str) -> Result<String, String>,
}

/// An attempt that was played again.
pub(super) struct JudgedAttempt<'o> {
    pub(super) recorded: &'o Recorded,
    /// Its text and what came of it, or why it cannot be played.
    pub(super) again: Result<(String, ReplayedAttempt), String>,
    /// What the record says of it and its bytes do not bear out.
    pub(super) differs: Option<String>,
}

/// Judges a folder again, and checks its signature where a signer is given.
///
/// # Errors
/// It is no folder of evidence, or its record is damaged; with the place. Or a signature cannot be checked here.
pub fn verify(path: &Path, signer: Option<Signer<'_>>) -> Result<Verified, EvidenceError> {
    regular::has_run(path, RECORD)
        .map_err(|why| EvidenceError::Foreign(path.display().to_string(), why))?;
    let mut files = compare_sums(path)?;
    if let Some(signer) = signer {
        files.extend(signature::check(path, signer)?);
    }
    let opened = OpenedFolder::open(path)?;
    let scenario = scenarios(path);
    let (judged, qualification) = opened.judged_and_qualified(&scenario)?;
    let mut verified = opened.verified(&judged, &scenario);
    verified.files.splice(0..0, files);
    if signer.is_none() {
        verified.unconfirmed.push(unsigned(path).to_owned());
    }
    // The sums are written last.
    verified.complete &= path.join(SUMS).exists();
    if opened.header.program != env!("CARGO_PKG_VERSION") {
        verified.complete = false;
        verified.unconfirmed.push(format!(
            "reports and captures: drivebench {} made them, and this is {}",
            opened.header.program,
            env!("CARGO_PKG_VERSION")
        ));
    } else if path.join(SUMS).exists() && opened.is_ended(&judged) {
        let made = derived(path, &opened, &judged)?;
        let wrong = reports::differences(path, &opened, &judged, &made);
        verified.files.extend(wrong);
        verified.files.extend(rerun(path, &opened, &scenario));
        if opened.header.qualified && verified.is_right() {
            let made = qualification.unwrap_or_else(|| Ok(Vec::new()));
            verified.files.extend(qualified::differences(path, made));
        } else if opened.header.qualified {
            verified.unconfirmed.push(format!(
                "{PROFILE} and {DEVIATIONS}: they are compared where nothing else is wrong"
            ));
        }
        verified.files.extend(reports::page(path, &made));
    }
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
    let opened = OpenedFolder::of(record, beside.rig.clone())?;
    let judged = opened.judged(beside.scenario)?;
    Ok(opened.verified(&judged, beside.scenario))
}

/// A record that has been read, and what it is judged by.
pub(super) struct OpenedFolder {
    /// All but the events of attempts.
    pub(super) lines: Vec<RecordLine>,
    pub(super) attempts: Vec<Recorded>,
    /// Whether the last line is.
    whole: bool,
    pub(super) rig: Rig,
    pub(super) header: Header,
    /// The captures that were left out on purpose.
    pub(super) left_out: BTreeSet<String>,
    /// What is wrong with the files that it names.
    files: Vec<String>,
}

impl OpenedFolder {
    /// Reads the record and the rig's file of a folder.
    pub(super) fn open(path: &Path) -> Result<Self, EvidenceError> {
        let foreign = |what: String| EvidenceError::Foreign(path.display().to_string(), what);
        regular::has_run(path, RECORD).map_err(foreign)?;
        let record = regular::open(&path.join(RECORD), Links::Refuse)
            .map_err(|error| foreign(format!("{RECORD}: {error}")))?;
        let beside = |name: &str| {
            let text = read_text(path, name)?.into_bytes();
            let name = path.join(name).display().to_string();
            Source::from_bytes(name, text).map_err(|error| error.to_string())
        };
        let source = beside(RIG).map_err(foreign)?;
        let rig = parse_beside(&source, &RIG_BUSES, &|_| beside(KNOWN_PROFILE));
        Self::of(
            BufReader::new(record),
            rig.map_err(|problems| foreign(problems.to_string()))?,
        )
    }

    fn of(record: impl BufRead, rig: Rig) -> Result<Self, EvidenceError> {
        let (mut lines, mut attempts) = (Vec::new(), Vec::<Recorded>::new());
        let mut unlike = None;
        let whole = read(record, |number, text, line| {
            if unlike.is_none() {
                unlike = unlike_written(number, text, &line);
            }
            match line.event() {
                Some(event) => {
                    if let Some(last) = attempts.last_mut() {
                        last.events.push(event);
                    }
                }
                None => {
                    begin_or_end(&mut attempts, &line);
                    lines.push(line);
                }
            }
        })?;
        let mut files = Vec::new();
        let header = header(&lines, &rig, &mut files).map_err(|message| RecordError {
            line: 1,
            column: 1,
            offset: 0,
            message,
        })?;
        if header.program == env!("CARGO_PKG_VERSION") {
            files.extend(unlike.map(|why| format!("{RECORD}, {why}")));
        }
        Ok(Self {
            left_out: left_out(&lines, header.keep),
            lines,
            attempts,
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

    /// Plays every attempt again from its record.
    pub(super) fn judged(
        &self,
        scenario: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<Vec<JudgedAttempt<'_>>, EvidenceError> {
        Ok(match self.judge()? {
            Some(mut judge) => self.judged_by(judge.as_mut(), scenario),
            None => self.judged_each(scenario, |recorded, text| {
                Ok(again_on_own_bench(recorded, text, &self.header.drives))
            }),
        })
    }

    /// The same, and what a qualification comes to.
    fn judged_and_qualified(
        &self,
        scenario: &dyn Fn(&str) -> Result<String, String>,
    ) -> Result<(Vec<JudgedAttempt<'_>>, Option<QualifiedAgain>), EvidenceError> {
        let Some(mut judge) = self.judge()?.filter(|_| self.header.qualified) else {
            return Ok((self.judged(scenario)?, None));
        };
        let judged = self.judged_by(judge.as_mut(), scenario);
        let made = qualified::again(self, &judged, judge.as_mut());
        Ok((judged, Some(made)))
    }

    /// What judges attempts on a rig; `None` where each scenario had a bench of its own.
    pub(super) fn judge(&self) -> Result<Option<Box<dyn RecordJudge>>, EvidenceError> {
        if self.header.own_rings {
            return Ok(None);
        }
        let foreign = |why| EvidenceError::Foreign(RIG.to_owned(), why);
        let mut judge = judge_of(&self.rig, self.header.qualified).map_err(foreign)?;
        judge.adopt(&self.header.names);
        Ok(Some(judge))
    }

    /// Judges every attempt on a rig again.
    pub(super) fn judged_by(
        &self,
        judge: &mut dyn RecordJudge,
        scenario: &dyn Fn(&str) -> Result<String, String>,
    ) -> Vec<JudgedAttempt<'_>> {
        self.judged_each(scenario, |recorded, text| again(recorded, text, judge))
    }

    /// Judges every attempt again, each for itself.
    fn judged_each(
        &self,
        scenario: &dyn Fn(&str) -> Result<String, String>,
        mut again: impl FnMut(&Recorded, &str) -> Result<ReplayedAttempt, String>,
    ) -> Vec<JudgedAttempt<'_>> {
        let attempts = self.attempts.iter();
        attempts
            .map(|recorded| {
                let text = text_of(&recorded.name, &recorded.sha256, scenario);
                let again = text.and_then(|text| {
                    let again = again(recorded, &text)?;
                    Ok((text, again))
                });
                let differs = match &again {
                    Err(why) => Some(why.clone()),
                    Ok((_, again)) => recorded.differs(again, &self.header),
                };
                JudgedAttempt {
                    recorded,
                    again,
                    differs,
                }
            })
            .collect()
    }

    /// Whether the record has its last line and the verdict of every attempt.
    fn is_ended(&self, judged: &[JudgedAttempt<'_>]) -> bool {
        self.whole
            && matches!(self.lines.last(), Some(RecordLine::End { .. }))
            && judged
                .iter()
                .all(|attempt| attempt.recorded.verdict.is_some())
    }

    /// What the record is worth.
    fn verified(
        &self,
        judged: &[JudgedAttempt<'_>],
        scenario: &dyn Fn(&str) -> Result<String, String>,
    ) -> Verified {
        let mut verified = Verified {
            files: self.files.clone(),
            attempts: judged.iter().map(JudgedAttempt::finding).collect(),
            // The ring may have been lost in the middle of an attempt.
            complete: self.is_ended(judged),
            unconfirmed: self.unconfirmed(),
        };
        verified
            .files
            .extend(cases::differences(self, judged, scenario));
        let selection = selection::compare(self);
        verified.files.extend(selection.wrong);
        verified.complete &= self.header.schema > 1 && selection.missing.is_none();
        verified.unconfirmed.extend(selection.missing);
        verified
    }

    /// Whether a scenario was skipped for such a reason.
    fn skips(&self, is_such: impl Fn(&str) -> bool) -> bool {
        self.lines.iter().any(|line| match line {
            RecordLine::Case {
                verdict, remarks, ..
            } if verdict == Verdict::Skipped.name() => {
                remarks.first().is_some_and(|why| is_such(why))
            }
            _ => false,
        })
    }

    /// What nothing in the folder confirms.
    fn unconfirmed(&self) -> Vec<String> {
        let mut all = vec!["date and versions of the program and the system"];
        let header = &self.header;
        if header.schema < 2 {
            all.push(
                "this record of schema 1 has no looks at the ports and no texts of skipped scenarios: what depends on them is not compared",
            );
        }
        if !header.simulated {
            all.push(
                "the clock of the computer: times fit the rate of the line and each other, but could be others by as much",
            );
            all.push(
                "which faults on links never happened, line errors without their bytes, bytes on inner links, whether a port had more to send, why one was lost, and the safe state, without which a run ends with the attempt that it has played",
            );
        }
        if header.qualified && !header.simulated || self.skips(|why| why.starts_with(DENIED)) {
            all.push(
                "which scenarios the limits left out: the record does not hold what the bench knew of the drives then",
            );
        }
        if self.skips(|_| true) {
            all.push(
                "the texts of scenarios that were skipped: only their titles, their drives and the reasons are compared",
            );
        }
        all.push(
            "values of the rig's file on which nothing recorded depends, such as max_speed, serial numbers, interlocks, hooks and the safe state",
        );
        let mut all: Vec<_> = all.into_iter().map(str::to_owned).collect();
        if !self.left_out.is_empty() {
            all.push(format!(
                "{} of attempts that passed: left out on purpose (`--keep {}`); the attempts were judged by the record",
                counted(self.left_out.len(), "capture"),
                header.keep
            ));
        }
        all
    }
}

/// The text of a scenario with this sum.
pub(super) fn text_of(
    name: &str,
    sha256: &str,
    scenario: &dyn Fn(&str) -> Result<String, String>,
) -> Result<String, String> {
    if !is_name(name) {
        return Err("this is not a name of a scenario".to_owned());
    }
    let text = scenario(name)?;
    match sum(text.as_bytes()) == sha256 {
        true => Ok(text),
        false => Err(format!(
            "{SCENARIOS}/{name}.scn is not the text that was played"
        )),
    }
}

impl JudgedAttempt<'_> {
    fn finding(&self) -> Rejudged {
        let verdict = self.recorded.verdict.as_ref();
        let unused = verdict.into_iter().flat_map(RecordedVerdict::unused);
        let judged = self.again.as_ref();
        Rejudged {
            name: self.recorded.title(),
            recorded: verdict.map(|verdict| verdict.verdict.clone()),
            judged: judged
                .map_or("aborted", |(_, again)| again.attempt.outcome.verdict.name())
                .to_owned(),
            differs: self.differs.clone(),
            unused: unused
                .filter_map(|remark| remark.strip_prefix(UNUSED))
                .map(str::to_owned)
                .collect(),
        }
    }
}

/// Begins an attempt with its first line, and ends it with its verdict.
fn begin_or_end(attempts: &mut Vec<Recorded>, line: &RecordLine) {
    match line {
        RecordLine::Scenario {
            name,
            sha256,
            attempt,
        } => attempts.push(Recorded {
            name: name.clone(),
            sha256: sha256.clone(),
            attempt: *attempt,
            events: Vec::new(),
            verdict: None,
        }),
        RecordLine::Verdict {
            verdict,
            finding,
            remarks,
            took,
            unplaced,
            opening,
        } => {
            if let Some(last) = attempts.last_mut() {
                last.events.shrink_to_fit();
                last.verdict = Some(RecordedVerdict {
                    verdict: verdict.clone(),
                    finding: finding.clone(),
                    remarks: remarks.clone(),
                    took: Span::from_units(*took),
                    unplaced: *unplaced,
                    opening: opening.clone(),
                });
            }
        }
        _ => {}
    }
}

/// Whether a name leads to a file of the folder and nowhere else.
pub(super) fn is_name(name: &str) -> bool {
    let safe = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    !name.is_empty() && !name.starts_with('.') && name.chars().all(safe)
}
