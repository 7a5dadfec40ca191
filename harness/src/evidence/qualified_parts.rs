//! What the parts of a qualification that was split come to together, judged by all their records as one qualification is by its own.

use super::error::EvidenceError;
use super::files::sum;
use super::qualified::{Case, cases, course, is_thorough};
use super::verify::{Judged, Opened};
use crate::buses::novobus::language::read::RingScenario;
use crate::buses::novobus::qualify::{QualifiedBench, TRIALS};
use crate::buses::novobus::rig::run::twin;
use crate::buses::syntax::Header;
use crate::buses::twin::Twin;
use crate::rig::PlayedScenario;
use crate::rig::segment::Qualified;
use crate::scenario::problem::Problems;
use crate::scenario::run::Why;
use std::cmp::Reverse;
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;

/// A part of a qualification on rings.
pub(super) struct QualifiedPart<'p> {
    /// Which.
    pub(super) name: String,
    /// Its record.
    pub(super) opened: &'p Opened,
    /// Its attempts, judged again.
    pub(super) judged: &'p [Judged],
    /// The places of its scenarios in the list of all.
    pub(super) places: &'p [usize],
    /// Whether it was played to its end.
    pub(super) whole: bool,
}

/// What these parts come to. `missing` says what was not played, in sentences.
///
/// # Errors
/// One of them was played with `--thorough` and another one without, or an attempt cannot be judged again.
pub(super) fn qualified_parts(
    parts: &[QualifiedPart<'_>],
    missing: &[String],
) -> Result<Qualified, EvidenceError> {
    let wrong = |name: &str, why: &str| EvidenceError::Merge(format!("part {name}: {why}"));
    let mut selected = BTreeMap::new();
    let mut records = Vec::new();
    for part in parts {
        let name = &part.name;
        let mut left = cases(part.opened, part.judged).map_err(|why| wrong(name, &why))?;
        let thorough = is_thorough(part.opened, &left);
        let own = part.places.len().min(left.len());
        let own: Vec<_> = left.drain(..own).collect();
        records.push(Record {
            part,
            thorough,
            cases: left,
            over: own.iter().any(|case| case.ends_the_run),
            others: Vec::new(),
        });
        selected.extend(part.places.iter().zip(own));
    }
    let thorough = records.iter().any(|own| own.thorough);
    if let Some(own) = records
        .iter()
        .find(|own| own.part.whole && own.thorough != thorough)
    {
        let why = "it was played without --thorough, and another part with it";
        return Err(wrong(&own.part.name, why));
    }
    let began = parts.iter().map(|part| part.opened.header.started.clone());
    let began = began.min().unwrap_or_default();
    // Beside the others stands one that was played to its end if there is one, or else the one that came the furthest.
    records.sort_by_key(|own| (!own.part.whole, Reverse(own.cases.len())));
    let mut records = records.into_iter();
    let Some(mut first) = records.next() else {
        return Err(EvidenceError::Merge("there is no part".to_owned()));
    };
    first.others = records.collect();
    let mut course = course(first.part.opened, thorough, began);
    for case in selected.values() {
        course.note(&case.name, &case.played);
    }
    if !missing.is_empty() {
        course.note_missing(missing);
    }
    let Ok(made) = course.settle(&mut first);
    Ok(made)
}

/// The record of a part, behind its selected scenarios, in place of a rig.
struct Record<'p> {
    part: &'p QualifiedPart<'p>,
    thorough: bool,
    /// What was not asked for yet.
    cases: VecDeque<Case>,
    /// Whether the line was lost in it, or the like.
    over: bool,
    /// The records of the other parts.
    others: Vec<Self>,
}

impl Record<'_> {
    /// The first case of this text that was not asked for yet.
    fn take(&mut self, sum: &str) -> Option<PlayedScenario> {
        let place = self.cases.iter().position(|case| case.sum == sum)?;
        let case = self.cases.remove(place)?;
        self.over |= case.ends_the_run;
        Some(case.played)
    }
}

impl QualifiedBench for Record<'_> {
    type Stop = Infallible;

    /// What a part has asked its own drives follows from what it has heard: such a trial may be of another part. What no part has played stays
    /// open.
    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, Infallible> {
        let (name, sum) = (entry.short_name(), sum(entry.source.text.as_bytes()));
        let is_trial = TRIALS.iter().any(|own| name.starts_with(own));
        let own = self.take(&sum);
        let mut others = self.others.iter_mut().filter(|_| is_trial);
        let played = own.or_else(|| others.find_map(|other| other.take(&sum)));
        Ok(played.unwrap_or_else(|| PlayedScenario::skipped(Why::RunEnded.into())))
    }

    fn over(&mut self) -> bool {
        self.over || !self.part.whole && self.cases.is_empty()
    }

    fn others(&mut self) -> &mut [Self] {
        &mut self.others
    }

    fn part(&self) -> String {
        self.part.name.clone()
    }

    fn twin(&self, header: &Header) -> Result<Twin, Problems> {
        twin(&self.part.opened.rig, header)
    }

    fn tell(&mut self, _: &str) -> Result<(), Infallible> {
        Ok(())
    }

    fn show(&mut self, _: &RingScenario, _: &PlayedScenario) -> Result<(), Infallible> {
        Ok(())
    }
}
