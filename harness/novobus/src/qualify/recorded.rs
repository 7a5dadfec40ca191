//! Qualifications made again from their records: of one run, and of the parts of one that was split.

use super::TRIALS;
use super::probes::thorough;
use super::qualification::{Qualification, QualificationFacts, QualifiedBench};
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::rig::run::twin;
use crate::twin::Twin;
use harness_bench::evidence::files::sum;
use harness_bench::rig::playing::{Qualified, RecordedCase, RecordedPart};
use harness_bench::rig::{PlayedScenario, Rig};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::Why;
use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;

/// What the record of a run comes to, whose first scenarios were `selected`. A record shows that a run ended early where a scenario is missing;
/// behind the last one it may have ended too, by `max_run`. None where it ends within a probe.
///
/// # Errors
/// A qualification plays other scenarios, in a sentence.
pub(crate) fn of_run(
    facts: &QualificationFacts,
    began: &str,
    cases: VecDeque<RecordedCase>,
    selected: usize,
) -> Result<Vec<Qualified>, String> {
    let mut all = Vec::new();
    for ended in [false, true] {
        match ending(facts, began, cases.clone(), (selected, ended)) {
            Err(Stop::Missing) => {}
            Err(Stop::Other(name)) => {
                return Err(format!(
                    "case {name}: a qualification with the scenarios before it plays another one here"
                ));
            }
            Ok(made) => all.push(made),
        }
    }
    Ok(all)
}

/// The same, where it is known whether the run has ended behind its last scenario.
fn ending(
    facts: &QualificationFacts,
    began: &str,
    mut cases: VecDeque<RecordedCase>,
    (selected, ended): (usize, bool),
) -> Result<Qualified, Stop> {
    let is_thorough = is_thorough(&facts.rig, cases.iter());
    let mut course = Qualification::new(facts.clone());
    let mut over = false;
    for case in cases.drain(..selected.min(cases.len())) {
        over |= case.ends_the_run;
        course.note(&case.name, &case.played);
    }
    let mut record = RunRecord {
        rig: &facts.rig,
        cases,
        ended,
        over,
    };
    let made = course.settle(&mut record, began.to_owned(), is_thorough)?;
    match record.cases.pop_front() {
        Some(case) => Err(Stop::Other(case.name)),
        None => Ok(made),
    }
}

/// What the parts of a qualification come to together. `missing` says what was not played, in sentences.
///
/// # Errors
/// One of them was played with `--thorough` and another one without, in a sentence.
pub(crate) fn of_parts(
    facts: &QualificationFacts,
    began: &str,
    parts: Vec<RecordedPart>,
    missing: &[String],
) -> Result<Qualified, String> {
    let mut selected = BTreeMap::new();
    let mut records = Vec::new();
    for part in parts {
        let judged = part.selected.iter().map(|(_, case)| case);
        records.push(PartRecord {
            rig: &facts.rig,
            thorough: is_thorough(&facts.rig, judged.clone().chain(&part.cases)),
            over: judged.clone().any(|case| case.ends_the_run),
            name: part.name,
            whole: part.whole,
            cases: part.cases,
            others: Vec::new(),
        });
        selected.extend(part.selected);
    }
    let is_thorough = records.iter().any(|record| record.thorough);
    if let Some(record) = records
        .iter()
        .find(|record| record.whole && record.thorough != is_thorough)
    {
        return Err(format!(
            "part {}: it was played without --thorough, and another part with it",
            record.name
        ));
    }
    // Beside the others stands one that was played to its end if there is one, or else the one that came the furthest.
    records.sort_by_key(|record| (!record.whole, Reverse(record.cases.len())));
    let mut records = records.into_iter();
    let mut first = records.next().ok_or("there is no part")?;
    first.others = records.collect();
    let mut course = Qualification::new(facts.clone());
    for case in selected.values() {
        course.note(&case.name, &case.played);
    }
    if !missing.is_empty() {
        course.note_missing(missing);
    }
    let Ok(made) = course.settle(&mut first, began.to_owned(), is_thorough);
    Ok(made)
}

/// Whether the long conversations are among the scenarios of a record.
fn is_thorough<'c>(rig: &Rig, mut cases: impl Iterator<Item = &'c RecordedCase>) -> bool {
    let long = thorough(rig.ring_size()).unwrap_or_default();
    let long = long.first().map(|entry| sum(entry.source.text.as_bytes()));
    long.is_some_and(|long| cases.any(|case| case.sum == long))
}

/// The record of a run in place of a rig.
struct RunRecord<'r> {
    rig: &'r Rig,
    /// What was not asked for yet.
    cases: VecDeque<RecordedCase>,
    /// Whether nothing may be played behind the last one.
    ended: bool,
    /// Whether the line was lost in it, or the like.
    over: bool,
}

/// Why a record does not go on.
enum Stop {
    /// It has no more scenarios.
    Missing,
    /// It has another scenario, of this name.
    Other(String),
}

impl QualifiedBench for RunRecord<'_> {
    type Stop = Stop;

    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, Stop> {
        let case = self.cases.pop_front().ok_or(Stop::Missing)?;
        if case.sum != sum(entry.source.text.as_bytes()) {
            return Err(Stop::Other(case.name));
        }
        self.over |= case.ends_the_run;
        Ok(case.played)
    }

    fn over(&mut self) -> bool {
        self.over || self.ended && self.cases.is_empty()
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        twin(self.rig, header)
    }

    fn tell(&mut self, _: &str) -> Result<(), Stop> {
        Ok(())
    }

    fn show(&mut self, _: &RingScenario, _: &PlayedScenario) -> Result<(), Stop> {
        Ok(())
    }
}

/// The record of a part, behind its selected scenarios, in place of a rig.
struct PartRecord<'r> {
    rig: &'r Rig,
    name: String,
    whole: bool,
    thorough: bool,
    /// What was not asked for yet.
    cases: VecDeque<RecordedCase>,
    /// Whether the line was lost in it, or the like.
    over: bool,
    /// The records of the other parts.
    others: Vec<Self>,
}

impl PartRecord<'_> {
    /// The first case of this text that was not asked for yet.
    fn take(&mut self, sum: &str) -> Option<PlayedScenario> {
        let place = self.cases.iter().position(|case| case.sum == sum)?;
        let case = self.cases.remove(place)?;
        self.over |= case.ends_the_run;
        Some(case.played)
    }
}

impl QualifiedBench for PartRecord<'_> {
    type Stop = Infallible;

    /// What a part has asked its own drives follows from what it has heard: such a trial may be of another part. What no part has played stays
    /// open.
    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, Infallible> {
        let (name, sum) = (entry.short_name(), sum(entry.source.text.as_bytes()));
        let is_trial = TRIALS.iter().any(|trial| name.starts_with(trial));
        let played = self.take(&sum);
        let mut others = self.others.iter_mut().filter(|_| is_trial);
        let played = played.or_else(|| others.find_map(|other| other.take(&sum)));
        Ok(played.unwrap_or_else(|| PlayedScenario::skipped(Why::RunEnded.into())))
    }

    fn over(&mut self) -> bool {
        self.over || !self.whole && self.cases.is_empty()
    }

    fn others(&mut self) -> &mut [Self] {
        &mut self.others
    }

    fn part(&self) -> String {
        self.name.clone()
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        twin(self.rig, header)
    }

    fn tell(&mut self, _: &str) -> Result<(), Infallible> {
        Ok(())
    }

    fn show(&mut self, _: &RingScenario, _: &PlayedScenario) -> Result<(), Infallible> {
        Ok(())
    }
}
