//! A run tries case after case, keeps those that show something new, and confirms and records every difference from the model.

use super::again::file_of;
use super::confirm::Confirmation;
use super::dice::Dice;
use super::error::ExploreError;
use super::record::{FuzzRecord, FuzzSettings, KeptRun, LogLine, Progress};
use super::swarm::{ROUND, Swarm};
use super::target::{Rehearsal, Target};
use super::{Differing, Finding, FuzzCase, Pool};
use harness_proto::time::Span;
use std::collections::BTreeMap;

/// After how many flaky sightings a difference is ignored.
const SETTLED: u8 = 3;

/// The bounds of a run.
#[derive(Clone, Copy, Debug)]
pub struct Bounds {
    pub cases: u64,
    /// The longest time that the line is used.
    pub wire: Option<Span>,
    /// The run ends after this many findings.
    pub findings: usize,
    /// After how many cases the progress is written.
    pub every: u64,
}

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// All cases were tried.
    Cases,
    /// The next case would use the line for too long.
    Wire,
    /// Enough was found.
    Findings,
    /// The rig or the user has ended it, for this reason.
    Over(String),
}

/// Receives the events of a run.
pub trait Watcher<C: FuzzCase> {
    /// A round begins, with what its cases may have.
    fn round(&mut self, round: u64, swarm: &Swarm<C::Spice>);

    /// Something was found; `file` is the name of its files.
    fn found(&mut self, finding: &Finding<C>, file: &str);

    /// The state so far.
    fn progress(&mut self, progress: &Progress, pool: &Pool<C>);
}

#[derive(Debug)]
pub struct FuzzRun<C: FuzzCase> {
    about: FuzzSettings<C>,
    scope: C::Scope,
    pool: Pool<C>,
    progress: Progress,
    /// How often each difference was flaky, by its key; `SETTLED` for a confirmed one.
    known: BTreeMap<String, u8>,
    /// The queries of the drives before the first random case.
    tour: Vec<C>,
    /// How many findings count.
    confirmed: usize,
    flaky: usize,
}

impl<C: FuzzCase> FuzzRun<C> {
    /// A run that begins.
    #[must_use]
    pub fn new(about: FuzzSettings<C>, scope: C::Scope) -> Self {
        Self {
            tour: C::tour(&scope, &about),
            about,
            scope,
            pool: Pool::default(),
            progress: Progress::default(),
            known: BTreeMap::new(),
            confirmed: 0,
            flaky: 0,
        }
    }

    /// A resumed run: its pool and its findings are those of the record.
    ///
    /// # Errors
    /// The model cannot be made.
    pub(crate) fn resumed(
        kept: &KeptRun<C>,
        scope: C::Scope,
        target: &mut dyn Target<C>,
    ) -> Result<Self, ExploreError> {
        let mut campaign = Self::new(kept.about.clone(), scope);
        for line in &kept.lines {
            match line {
                LogLine::Kept { case, .. } => {
                    let rehearsal = target.rehearse(case)?;
                    campaign.pool.offer(case, &rehearsal.features);
                }
                LogLine::Finding {
                    signature,
                    confirmed,
                    ..
                } => campaign.note(signature, *confirmed),
                _ => {}
            }
        }
        campaign.progress = kept.progress;
        Ok(campaign)
    }

    fn note(&mut self, signature: &str, confirmed: bool) {
        count_finding(&mut self.known, signature, confirmed);
        match confirmed {
            true => self.confirmed += 1,
            false => self.flaky += 1,
        }
    }

    /// Whether this difference was found already, or was flaky often enough.
    fn is_settled(&self, difference: &C::Difference) -> bool {
        let times = self.known.get(&difference.key());
        times.is_some_and(|times| *times >= SETTLED)
    }

    #[must_use]
    pub const fn progress(&self) -> &Progress {
        &self.progress
    }

    /// How many findings were seen again often enough, and how many were not.
    #[must_use]
    pub const fn findings(&self) -> (usize, usize) {
        (self.confirmed, self.flaky)
    }

    #[must_use]
    pub const fn pool(&self) -> &Pool<C> {
        &self.pool
    }

    /// The case of a number: it depends on the seed, the number and what was kept before.
    fn case(&self, number: u64, swarm: &Swarm<C::Spice>) -> C {
        let mut dice = Dice::of_part(self.about.seed, number);
        C::made(
            &self.scope,
            swarm,
            (&self.tour, number),
            &self.pool,
            &mut dice,
        )
    }

    /// Goes on up to the bounds. The record, where there is one, holds everything when it ends, and when it fails on the way.
    ///
    /// # Errors
    /// The rig or the record fails.
    pub fn run(
        &mut self,
        target: &mut dyn Target<C>,
        mut record: Option<&mut FuzzRecord>,
        bounds: &Bounds,
        watcher: &mut dyn Watcher<C>,
    ) -> Result<RunEnd, ExploreError> {
        let mut swarm = None;
        let end = loop {
            if let Some(end) = self.end(bounds, target) {
                break end;
            }
            let number = self.progress.cases;
            let round = number / ROUND;
            let drawn = match swarm.take() {
                Some((known, drawn)) if known == round => drawn,
                _ => {
                    let drawn = C::swarm(self.about.seed, round, &self.scope);
                    watcher.round(round, &drawn);
                    if number.is_multiple_of(ROUND) {
                        let spices = drawn.names().into_iter().map(str::to_owned).collect();
                        write::<C>(&mut record, || LogLine::Swarm { round, spices })?;
                    }
                    drawn
                }
            };
            let case = self.case(number, &drawn);
            swarm = Some((round, drawn));
            let rehearsal = target.rehearse(&case)?;
            if self.too_long(bounds, rehearsal.took) {
                break RunEnd::Wire;
            }
            self.one(&case, &rehearsal, target, &mut record, watcher)?;
            self.progress.cases += 1;
            if self.progress.cases.is_multiple_of(bounds.every) {
                write(&mut record, || LogLine::<C>::Progress(self.progress))?;
                watcher.progress(&self.progress, &self.pool);
            }
        };
        write(&mut record, || LogLine::<C>::Progress(self.progress))?;
        watcher.progress(&self.progress, &self.pool);
        Ok(end)
    }

    /// Tries these cases in order, within the wire's time. Differences are confirmed and recorded as in a run.
    ///
    /// # Errors
    /// The rig or the record fails.
    pub fn replay(
        &mut self,
        cases: &[C],
        target: &mut dyn Target<C>,
        mut record: Option<&mut FuzzRecord>,
        bounds: &Bounds,
        watcher: &mut dyn Watcher<C>,
    ) -> Result<RunEnd, ExploreError> {
        let mut end = RunEnd::Cases;
        for case in cases {
            if let Some(reason) = self.end(bounds, target) {
                end = reason;
                break;
            }
            let rehearsal = target.rehearse(case)?;
            if self.too_long(bounds, rehearsal.took) {
                end = RunEnd::Wire;
                break;
            }
            self.one(case, &rehearsal, target, &mut record, watcher)?;
            self.progress.cases += 1;
            write(&mut record, || LogLine::<C>::Progress(self.progress))?;
        }
        watcher.progress(&self.progress, &self.pool);
        Ok(end)
    }

    fn end(&self, bounds: &Bounds, target: &mut dyn Target<C>) -> Option<RunEnd> {
        if let Some(why) = target.over() {
            return Some(RunEnd::Over(why));
        }
        if self.confirmed >= bounds.findings {
            return Some(RunEnd::Findings);
        }
        (self.progress.cases >= bounds.cases).then_some(RunEnd::Cases)
    }

    /// Whether the line would be used for longer than it may.
    fn too_long(&self, bounds: &Bounds, more: Span) -> bool {
        let used = self.progress.wire_ns.saturating_add(more.as_nanos());
        bounds.wire.is_some_and(|most| used > most.as_nanos())
    }

    fn use_line(&mut self, took: Span) {
        self.progress.wire_ns = self.progress.wire_ns.saturating_add(took.as_nanos());
    }

    fn one(
        &mut self,
        case: &C,
        rehearsal: &Rehearsal<C>,
        target: &mut dyn Target<C>,
        record: &mut Option<&mut FuzzRecord>,
        watcher: &mut dyn Watcher<C>,
    ) -> Result<(), ExploreError> {
        if rehearsal.denied.is_some() {
            self.progress.not_sent += 1;
            return Ok(());
        }
        let tried = target.attempt(case, rehearsal)?;
        self.use_line(tried.took);
        let number = self.progress.cases;
        match tried.difference {
            None if tried.not_played.is_some() => self.progress.not_sent += 1,
            None => {
                let new = self.pool.offer(case, &rehearsal.features);
                if new > 0 {
                    let case = case.clone();
                    write(record, || LogLine::Kept { number, new, case })?;
                }
            }
            Some(difference) if self.is_settled(&difference) => {
                self.progress.repeats += 1;
            }
            Some(difference) => {
                let mut finding = Finding {
                    schema: Finding::<C>::SCHEMA,
                    rig: self.about.rig.clone(),
                    ports: self.about.ports,
                    seed: self.about.seed,
                    number,
                    seen_again: 0,
                    of: 0,
                    confirmed: false,
                    shrunk_in: None,
                    difference,
                    setup: self.about.setup.clone(),
                    case: case.clone(),
                    attempts: Vec::new(),
                };
                finding.attempts.extend(target.recorded());
                let (confirm, of) = (self.about.confirm, self.about.of);
                let mut confirmation = Confirmation::new(confirm, of, &self.known);
                let before = tried.before.as_deref();
                C::confirm(&mut confirmation, &mut finding, rehearsal, before, target)?;
                let took = confirmation.took;
                self.use_line(took);
                let signature = finding.difference.key();
                self.note(&signature, finding.confirmed);
                let file = file_of(number);
                if let Some(record) = record {
                    finding.write(record.folder(), &file)?;
                    record.line(&LogLine::<C>::Finding {
                        number,
                        signature,
                        confirmed: finding.confirmed,
                        file: file.clone(),
                    })?;
                }
                watcher.found(&finding, &file);
            }
        }
        Ok(())
    }
}

/// Counts a finding by the key of its difference: how often it was flaky, or `SETTLED` for a confirmed one.
pub(crate) fn count_finding(known: &mut BTreeMap<String, u8>, key: &str, confirmed: bool) {
    let times = known.entry(key.to_owned()).or_default();
    *times = match confirmed {
        true => SETTLED,
        false => times.saturating_add(1),
    };
}

fn write<C: FuzzCase>(
    record: &mut Option<&mut FuzzRecord>,
    line: impl FnOnce() -> LogLine<C>,
) -> Result<(), ExploreError> {
    match record {
        Some(record) => record.line(&line()),
        None => Ok(()),
    }
}
