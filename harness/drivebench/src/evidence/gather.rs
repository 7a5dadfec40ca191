//! The scenarios of a run that was split, gathered part by part and judged again.

use super::derive::{CaseReport, Settled, case_reports};
use super::error::EvidenceError;
use super::junit::JunitCase;
use super::qualified::cases;
use super::read_parts::ReadPart;
use super::record::PartItem;
use super::selection;
use super::verify::{JudgedAttempt, scenarios};
use crate::counted::counted;
use crate::partition::Partition;
use crate::rig::playing::{QualificationRecord, Qualified, RecordJudge, RecordedPart};
use crate::shown::ShownScenario;
use std::collections::BTreeMap;
use std::path::Path;

/// A scenario of the whole run.
pub(super) struct Row {
    pub(super) settled: Settled,
    pub(super) junit: JunitCase,
    /// `None` for one that was not run.
    pub(super) shown: Option<ShownScenario>,
}

impl From<CaseReport> for Row {
    fn from(report: CaseReport) -> Self {
        Self {
            settled: report.settled,
            junit: report.junit,
            shown: Some(report.shown),
        }
    }
}

/// The scenarios of the whole run, gathered part by part.
pub(super) struct Gathering<'g> {
    path: &'g Path,
    rig: &'g str,
    all: &'g [PartItem],
    /// By their places.
    pub(super) rows: BTreeMap<usize, Row>,
    /// What a qualification plays behind the selected scenarios, and how many of them the parts have together.
    pub(super) behind: Vec<Row>,
    played_behind: usize,
    pub(super) missing: Vec<String>,
    parts: Vec<JudgedPart<'g>>,
    /// What judges the parts of a qualification together.
    judge: Option<Box<dyn RecordJudge>>,
}

/// A part whose attempts were judged again.
struct JudgedPart<'g> {
    part: &'g ReadPart,
    judged: Vec<JudgedAttempt<'g>>,
    /// The places of its scenarios in the list of all.
    places: &'g [usize],
    /// Whether it was played to its end.
    whole: bool,
}

impl<'g> Gathering<'g> {
    /// Of the parts of one run; `first` is one of them.
    pub(super) fn of(path: &'g Path, first: &'g ReadPart) -> Result<Self, EvidenceError> {
        let header = &first.opened.header;
        let judge = first.opened.judge()?;
        Ok(Self {
            path,
            rig: first.opened.rig.id(),
            all: first.scenarios(),
            rows: BTreeMap::new(),
            behind: Vec::new(),
            played_behind: 0,
            missing: Vec::new(),
            parts: Vec::new(),
            judge: judge.filter(|_| header.qualified),
        })
    }

    /// Takes the scenarios of a part that is there; `places` has their places.
    pub(super) fn part(
        &mut self,
        part: &'g ReadPart,
        places: &'g [usize],
    ) -> Result<(), EvidenceError> {
        let texts = scenarios(&part.path);
        if let Some(judge) = self.judge.as_mut().filter(|_| !self.parts.is_empty()) {
            judge.begin_part();
        }
        let judged = match &mut self.judge {
            Some(judge) => part.opened.judged_by(judge.as_mut(), &texts),
            None => part.opened.judged(&texts)?,
        };
        let behind = self.all.len() + self.played_behind;
        let number = |at: usize| match places.get(at) {
            Some(place) => place + 1,
            None => behind + at - places.len() + 1,
        };
        let mut made = case_reports(&part.path, &part.opened, &judged, &number)?;
        let more = made.split_off(places.len().min(made.len()));
        let played = made.len();
        let planned = places.iter().map(|place| &self.all[*place].name);
        let names = made.iter().map(|report| &report.settled.name);
        let qualifies = part.opened.header.qualified;
        if !(more.is_empty() || qualifies)
            || !planned.zip(names).all(|(planned, name)| planned == name)
        {
            return Err(EvidenceError::Merge(format!(
                "{}: its cases are not the scenarios of {} of its list",
                part.path.display(),
                part.partition
            )));
        }
        for (place, report) in places.iter().zip(made) {
            self.rows.insert(*place, report.into());
        }
        self.played_behind += more.len();
        for report in more {
            self.behind(report, part);
        }
        let unplayed = selection::compare(&part.opened).missing;
        let whole = part.has_ended() && played == places.len() && unplayed.is_none();
        if !part.has_ended() || played < places.len() {
            self.missing.push(format!(
                "part {} did not come to its end: {} not run",
                part.partition,
                counted(places.len() - played, "scenario")
            ));
        } else if let Some(why) = unplayed.filter(|_| qualifies) {
            self.missing.push(format!("part {}: {why}", part.partition));
        }
        self.not_run(
            &places[played..],
            &format!("part {} ended before it", part.partition),
        );
        self.parts.push(JudgedPart {
            part,
            judged,
            places,
            whole,
        });
        Ok(())
    }

    /// Takes what a qualification has played behind the selected scenarios. What came of it in a part before is shown once.
    fn behind(&mut self, mut report: CaseReport, part: &ReadPart) {
        let mut same = self.behind.iter().map(|row| &row.settled);
        let same = same.find(|row| row.name == report.settled.name);
        if same.is_some_and(|row| row.says_the_same_as(&report.settled)) {
            return;
        }
        if same.is_some() {
            report.name_part(&part.partition.to_string());
        }
        self.behind.push(report.into());
    }

    /// Takes the scenarios of a part that is not there. A part without any is not missed.
    pub(super) fn no_part(&mut self, partition: Partition, places: &[usize]) {
        if !places.is_empty() {
            let count = counted(places.len(), "scenario");
            self.missing
                .push(format!("part {partition} is missing: {count} not run"));
        }
        self.not_run(places, &format!("part {partition} is missing"));
    }

    fn not_run(&mut self, places: &[usize], why: &str) {
        for place in places {
            let settled = Settled::not_run(&self.all[*place].name, why);
            let row = Row {
                junit: settled.case(self.path, self.rig),
                settled,
                shown: None,
            };
            self.rows.insert(*place, row);
        }
    }

    /// What the parts of a qualification come to; `None` for those of a run.
    ///
    /// # Errors
    /// One of them was played with `--thorough` and another one without, or an attempt cannot be judged again.
    pub(super) fn qualified(&mut self) -> Result<Option<Qualified>, EvidenceError> {
        let Some(judge) = &mut self.judge else {
            return Ok(None);
        };
        let mut parts = Vec::new();
        for part in &self.parts {
            let name = part.part.partition.to_string();
            let wrong = |why| EvidenceError::Merge(format!("part {name}: {why}"));
            let mut left = cases(&part.part.opened, &part.judged).map_err(wrong)?;
            let selected = left.drain(..part.places.len().min(left.len()));
            let places = part.places.iter().copied();
            parts.push(RecordedPart {
                selected: places.zip(selected).collect(),
                cases: left,
                whole: part.whole,
                name,
            });
        }
        let parts_there = self.parts.iter();
        let began = parts_there.map(|part| &part.part.opened.header.started);
        let began = began.min().map_or("", String::as_str);
        let missing = &self.missing;
        let made = judge.qualified(began, QualificationRecord::Parts { parts, missing });
        let made = made.map_err(EvidenceError::Merge)?;
        Ok(made.into_iter().next())
    }
}
