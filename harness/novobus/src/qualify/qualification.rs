//! A qualification: what it plays behind the selected scenarios, and what it makes of all of it.
//!
//! It runs twice: on a rig in use, and on the record of that run, from which `verify` makes `profile.toml` and `deviations.txt` again.

use super::blame::exchange;
use super::delays::{DELAYS, held_back};
use super::diagnose::{deviating_masters, name};
use super::eeprom::{dumps, marches};
use super::findings::Findings;
use super::parts::{Parts, ProbeOutcome};
use super::pinned::questions;
use super::probes::{Probe, ProbeTarget, SELF_TEST_BUS, conversations, probes, thorough};
use super::settle::{ProbeAnswer, answer, silence};
use crate::language::read::RingScenario;
use crate::language::syntax::Header;
use crate::rig::OnRings;
use crate::rig::Run;
use crate::rig::walk::Walks;
use crate::twin::{Exactness, SILENCED, Twin};
use harness_bench::link::{Link as _, Octets as _};
use harness_bench::rig::playing::Qualified;
use harness_bench::rig::{Attempt, PlayedScenario, Profile, Rig};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::collections::{BTreeMap, BTreeSet};

/// The most deviations of the master that are listed.
const MOST_TOLD: usize = 8;

/// The message if a run ended early.
const ENDED: &str = "the run ended before everything was played";

/// How often a probe is played until a value explains it: a busy computer is late sometimes.
const PROBED: usize = 3;

/// What plays the scenarios of a qualification: a rig in use, or the record of one.
pub(crate) trait QualifiedBench {
    /// Why nothing more is played.
    type Stop;

    /// Plays a scenario.
    ///
    /// # Errors
    /// Nothing more can be played.
    fn play(&mut self, entry: &RingScenario) -> Result<PlayedScenario, Self::Stop>;

    /// Whether nothing more may be played.
    fn over(&mut self) -> bool;

    /// The other parts of a qualification that was split: each has played the same, on drives of its own.
    fn others(&mut self) -> &mut [Self]
    where
        Self: Sized,
    {
        &mut []
    }

    /// Which part it is, where there are several.
    fn part(&self) -> String {
        String::new()
    }

    /// A fresh twin of the drives, set up as the rig's file and this header say.
    ///
    /// # Errors
    /// The header has mistakes.
    fn twin(&self, header: &Header) -> Result<Twin, Problems>;

    /// Reports a result.
    ///
    /// # Errors
    /// It cannot be written.
    fn tell(&mut self, text: &str) -> Result<(), Self::Stop>;

    /// Reports the outcome of a conversation.
    ///
    /// # Errors
    /// It cannot be written.
    fn show(&mut self, entry: &RingScenario, played: &PlayedScenario) -> Result<(), Self::Stop>;
}

/// What is known of a qualification before anything is played.
#[derive(Clone, Debug)]
pub(crate) struct QualificationFacts {
    pub rig: Rig,
    /// How long a byte takes.
    pub byte_time: Span,
    /// How exactly the twin is compared.
    pub exactness: Exactness,
    /// Whether every drive is reset before a scenario.
    pub resets: bool,
    /// On which links of the first ring faults can be put, counted from the master's outgoing one.
    pub reached: Vec<usize>,
}

impl QualificationFacts {
    /// Those of a qualification that begins on a rig in use.
    pub(crate) fn of(run: &mut Run<'_>) -> Self {
        let rig = run.session().rig().clone();
        let links = 0..usize::from(rig.ring_size());
        Self {
            rig,
            byte_time: run.session().link().byte_time(),
            exactness: run.exactness(),
            resets: run.way().anew,
            reached: links
                .filter(|link| run.session().link().reaches(0, *link))
                .collect(),
        }
    }
}

/// A qualification in progress.
pub(crate) struct Qualification {
    facts: QualificationFacts,
    /// When it began, as a date and time of day in UTC.
    began: String,
    /// Whether the long conversations are played too.
    thorough: bool,
    drives: u8,
    findings: Findings,
    /// The choices of the manual that show in every attempt, before the scenario begins.
    assumed: Header,
    ill: bool,
    /// The drives that are silent while they test themselves (11.8).
    silent: BTreeSet<u8>,
    parts: Parts,
    /// Whether a part is missing, or has not been played to its end.
    lacks_a_part: bool,
    /// The conversations that walk the model of a right drive.
    walks: Walks,
    /// The conversations that were played, with their verdicts.
    conversed: Vec<(String, Verdict)>,
}

/// The value of [`SELF_TEST_BUS`] of such a drive.
const SILENT: &str = "silent";

impl Qualification {
    /// One of which nothing was played yet.
    pub(crate) fn new(facts: QualificationFacts) -> Self {
        let drives = facts.rig.ring_size();
        Self {
            drives,
            findings: Findings::new(drives, facts.byte_time, facts.exactness.tolerance),
            assumed: Header::default(),
            ill: false,
            silent: BTreeSet::new(),
            parts: Parts::default(),
            lacks_a_part: false,
            began: String::new(),
            thorough: false,
            walks: Walks::new(&facts.rig),
            conversed: Vec::new(),
            facts,
        }
    }

    /// Notes the outcome of a selected scenario.
    pub(crate) fn note(&mut self, name: &str, played: &PlayedScenario) {
        self.findings.note(name, played);
        self.ill = played.shows_an_ill_rig();
        self.assume(played);
    }

    /// Notes what parts of a qualification have not played, in sentences. How one of them ended is not held against the others.
    pub(crate) fn note_missing(&mut self, missing: &[String]) {
        let missing = missing.iter().cloned();
        missing.for_each(|sentence| self.findings.note_open(sentence));
        self.lacks_a_part = true;
        self.ill = false;
    }

    /// Takes over the choices with which a scenario was compared, for what is asked of the ring later.
    fn assume(&mut self, played: &PlayedScenario) {
        if self.assumed.setups.is_empty() {
            let attempts = played.attempts.iter();
            let mut assumed = attempts.map(|attempt| &attempt.beside().assumed);
            let found = assumed.find(|header| !header.setups.is_empty());
            self.assumed = found.unwrap_or(&self.assumed).clone();
        }
    }

    /// Plays what is judged by the model alone, settles what the manual leaves open, and names the deviations of drives. It `began` at this
    /// date and time of day in UTC, and is `thorough` if the long conversations are played too.
    ///
    /// # Errors
    /// Those of the bench.
    pub(crate) fn settle<B: QualifiedBench>(
        mut self,
        bench: &mut B,
        began: String,
        thorough: bool,
    ) -> Result<Qualified, B::Stop> {
        (self.began, self.thorough) = (began, thorough);
        if bench.over() {
            self.findings.note_open(ENDED.to_owned());
            return Ok(self.qualified(None, self.findings.text(None, &[])));
        }
        if self.ill {
            let why = "the ring is not healthy: nothing more was played";
            self.findings.note_open(why.to_owned());
            let deviations = self.deviations(bench, Some(&Header::default()));
            return Ok(self.qualified(None, deviations));
        }
        if !bench.others().is_empty() {
            self.parts.keep();
        }
        let mut ended = self.converse(bench)?;
        self.on_others(bench, |course, other| course.converse(other).map(drop))?;
        let (profile, settled) = self.profile(bench)?;
        if !ended {
            self.ask_ring(bench)?;
            self.exchange_roles(bench)?;
        }
        ended |= bench.over();
        if ended && !self.lacks_a_part {
            self.findings.note_open(ENDED.to_owned());
        }
        ended |= self.lacks_a_part;
        let mut deviations = self.deviations(bench, (!ended).then_some(&settled));
        deviations.push_str(&self.walks.told(&self.conversed));
        Ok(self.qualified(Some(profile), deviations))
    }

    /// Does something with what each of the other parts has played.
    fn on_others<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        mut act: impl FnMut(&mut Self, &mut B) -> Result<(), B::Stop>,
    ) -> Result<(), B::Stop> {
        for other in bench.others() {
            self.parts.follow(Some(other.part()));
            if !other.over() {
                act(self, other)?;
            }
        }
        self.parts.follow(None);
        Ok(())
    }

    fn qualified(&self, profile: Option<Profile<Header>>, deviations: String) -> Qualified {
        Qualified {
            profile: profile.map(|profile| toml::to_string(&profile).unwrap_or_default()),
            deviations,
            verdict: self.findings.judged(),
        }
    }

    /// Plays the conversations that the model alone judges. Whether nothing more can or may be played.
    fn converse<B: QualifiedBench>(&mut self, bench: &mut B) -> Result<bool, B::Stop> {
        let drives = self.drives;
        let reaches = |place: usize| place == 0 || self.facts.reached.contains(&place);
        let mut entries = conversations(drives, &reaches).unwrap_or_default();
        entries.extend(self.walks.conversations());
        let mut read = Vec::new();
        if self.thorough {
            entries.extend(thorough(drives).unwrap_or_default());
            read = dumps(drives);
        }
        for entry in entries {
            let Some(played) = self.compare(bench, &entry)? else {
                return Ok(true);
            };
            if entry.short_name() == DELAYS {
                self.measure(&played);
            }
        }
        for (drive, entry) in read {
            if self.march(bench, drive, &entry)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Notes which drives hold bytes back. Where times are exact the model has judged them.
    fn measure(&mut self, played: &PlayedScenario) {
        let last = played.last_played().and_then(Attempt::sound);
        let last = last.and_then(|attempt| attempt.beside().conversations.last());
        let last = last.filter(|_| self.facts.exactness.tolerance > Span::ZERO);
        let byte_time = self.facts.byte_time;
        let held = last.map(|conversation| held_back(self.drives, byte_time, conversation));
        for held in held.into_iter().flatten() {
            let what = self.parts.named(&held.to_string());
            self.findings.note_held_back(what);
        }
    }

    /// Plays a conversation that is judged by the model; `None` where nothing more can or may be played.
    fn compare<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        entry: &RingScenario,
    ) -> Result<Option<PlayedScenario>, B::Stop> {
        let played = bench.play(entry)?;
        bench.show(entry, &played)?;
        let name = entry.short_name();
        match (self.parts.repeats(name, &played), &self.parts.other) {
            (true, _) => {}
            (false, None) => {
                let verdict = played.outcome.verdict;
                self.conversed.push((name.to_owned(), verdict));
                self.findings.note(name, &played);
            }
            (false, Some(_)) => {
                let name = self.parts.named(name);
                self.findings.note_other_part(&name, &played);
            }
        }
        self.assume(&played);
        Ok((!bench.over()).then_some(played))
    }

    /// Reads the EEPROM of a drive, and writes and restores its cells one by one. Whether nothing more can or may be played.
    fn march<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        drive: u8,
        read: &RingScenario,
    ) -> Result<bool, B::Stop> {
        let Some(played) = self.compare(bench, read)? else {
            return Ok(true);
        };
        let right = played.outcome.verdict == Verdict::Passed;
        let Some(last) = played.last_played().filter(|_| right) else {
            return Ok(false);
        };
        for entry in marches(self.drives, drive, &last.beside().conversations) {
            if self.compare(bench, &entry)?.is_none() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Asks the ring about what differed, so that it shows which drive it was.
    fn ask_ring<B: QualifiedBench>(&mut self, bench: &mut B) -> Result<(), B::Stop> {
        if !self.facts.resets {
            return Ok(());
        }
        let sightings = self.findings.sightings().to_vec();
        for question in questions(self.drives, &sightings) {
            if bench.over() {
                break;
            }
            let played = bench.play(&question.entry)?;
            let last = played.last_played().and_then(Attempt::sound);
            let shown = last.and_then(|attempt| question.answer(&attempt.beside().conversations));
            shown
                .into_iter()
                .for_each(|pinned| self.findings.note_pinned(pinned));
        }
        Ok(())
    }

    /// Plays again what differed, with the drives' roles exchanged, so that it shows which drive it was. Only where every drive is reset
    /// before: what was written to one must not stay.
    fn exchange_roles<B: QualifiedBench>(&mut self, bench: &mut B) -> Result<(), B::Stop> {
        if !self.facts.resets || self.drives < 2 {
            return Ok(());
        }
        let sightings = self.findings.sightings().to_vec();
        let trials = exchange(self.drives, sightings, &mut |entry: &RingScenario| {
            if bench.over() {
                return Ok(None);
            }
            let played = bench.play(entry)?;
            Ok(self.findings.note_exchanged(&played))
        })?;
        self.findings.note_trials(trials);
        Ok(())
    }

    /// The deviations that explain every byte, and what was compared. The drives of the model have the properties of the bus that this
    /// header settles; `None` where the run ended early, and no deviation is looked for.
    fn deviations<B: QualifiedBench>(&self, bench: &B, settled: Option<&Header>) -> String {
        let known = self.facts.rig.file.deviation.iter();
        let known: Vec<_> = known.map(|entry| entry.name.clone()).collect();
        let seen = self.findings.seen(self.drives, self.facts.exactness);
        let settled = settled.filter(|_| self.findings.differ());
        let named = settled.map(|settled| {
            let twin = |header: &Header| bench.twin(&settled.and(header));
            name(&seen, &twin)
        });
        self.master() + &self.findings.text(named.as_deref(), &known)
    }

    /// The deviation of the bench's own master, if it is wrong.
    fn master(&self) -> String {
        if !self.findings.master_is_wrong {
            return String::new();
        }
        let mut text = String::new();
        for deviation in deviating_masters(&self.findings.driven)
            .iter()
            .take(MOST_TOLD)
        {
            text.push_str(&format!(
                "the master: {} (ND21 {}): {}\n",
                deviation.name, deviation.section, deviation.about
            ));
        }
        if text.is_empty() {
            text.push_str("the bench's master differs from the master of the manual, and no single known deviation explains it\n");
        }
        text.push_str(
            "the bench is wrong, not a drive: its own master deviates, so this run says nothing about the drives\n",
        );
        text
    }

    /// Asks by probes how the drives behave where the manual leaves it open. What has been settled of the bus, or assumed, is part of every later
    /// question and is the second value; a time of a drive is the middle of a span, and no later answer rests on it.
    fn profile<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
    ) -> Result<(Profile<Header>, Header), B::Stop> {
        let rings = self.facts.rig.rings().map(|(_, ring)| ring.drives);
        let rings: Vec<u8> = rings.collect();
        let mut profile = Profile {
            schema: 1,
            rig: self.facts.rig.id().to_owned(),
            date: self.began.clone(),
            rings,
            property: BTreeMap::new(),
            open: BTreeMap::new(),
        };
        let mut known = self.assumed.clone();
        let mut ended = false;
        for probe in probes(self.drives).unwrap_or_default() {
            ended = ended || bench.over();
            if ended {
                profile.leave_open(probe.property, "not asked: the run ended before");
                continue;
            }
            let section = format!("nd21 {}", probe.section);
            let property = probe.property;
            let whose = probe.drive();
            let whose = whose.map_or_else(String::new, |drive| format!("drive {drive}: "));
            match self.ask_all(bench, &probe, &known)? {
                ProbeOutcome::Settled { value, header, .. } => {
                    bench.tell(&format!("{property} ({section}): {whose}{value}\n"))?;
                    match probe.asked {
                        ProbeTarget::Ring => known = known.and(&header),
                        ProbeTarget::Drive(drive, _)
                            if (property, &value[..]) == (SELF_TEST_BUS, SILENT) =>
                        {
                            self.silent.insert(drive);
                        }
                        ProbeTarget::Drive(..) => {}
                    }
                    profile.settle(property, &section, &format!("{whose}{value}"), &header);
                }
                ProbeOutcome::NotDone(why) | ProbeOutcome::Open(why) => {
                    bench.tell(&format!("{property} ({section}): {whose}{why}\n"))?;
                    profile.leave_open(property, &format!("{whose}{why}"));
                }
            }
        }
        Ok((profile, known))
    }

    /// Asks a probe in every part.
    fn ask_all<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        probe: &Probe,
        known: &Header,
    ) -> Result<ProbeOutcome, B::Stop> {
        let mut all = vec![self.ask(bench, probe, known)?];
        self.on_others(bench, |course, other| {
            all.push(course.ask(other, probe, known)?);
            Ok(())
        })?;
        let agreed = ProbeOutcome::agreed(probe.property, probe.drive(), all);
        Ok(agreed.unwrap_or_else(|values| {
            let differ = format!("its values differ from part to part: {values}");
            let name = probe.name();
            self.findings
                .note_open(format!("the probe of {name}: {differ}"));
            ProbeOutcome::Open(differ)
        }))
    }

    /// Asks a probe, and notes that it was asked.
    fn ask<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        probe: &Probe,
        known: &Header,
    ) -> Result<ProbeOutcome, B::Stop> {
        let answer = match self.answer(bench, probe, known)? {
            Ok(answer) => answer,
            Err(why) => return Ok(ProbeOutcome::Open(format!("not asked: {why}"))),
        };
        if self.parts.other.is_none() {
            self.findings.note_probe();
        }
        Ok(match answer {
            ProbeAnswer::Settled {
                value,
                header,
                span,
            } => ProbeOutcome::Settled {
                value,
                header,
                span,
            },
            ProbeAnswer::NoDifference => ProbeOutcome::Open(
                "every value explains the bytes received: the drive was not in a state that shows the property".to_owned(),
            ),
            ProbeAnswer::Several(values) => ProbeOutcome::Open(format!(
                "the bytes received do not tell which: {values}"
            )),
            ProbeAnswer::NotDone(time) => ProbeOutcome::NotDone(format!(
                "longer than {time}: not finished when asked for the last time"
            )),
            ProbeAnswer::Unexplained => {
                let why = "no value explains the bytes received";
                let name = self.parts.named(&probe.name());
                self.findings
                    .note_open(format!("the probe of {name}: {why}"));
                ProbeOutcome::Open(why.to_owned())
            }
        })
    }

    /// Plays a probe, and again where no value explains it. The inner error says why it cannot be asked.
    fn answer<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        probe: &Probe,
        known: &Header,
    ) -> Result<Result<ProbeAnswer, String>, B::Stop> {
        if let (Some(entry), ProbeTarget::Drive(drive, _)) = (&probe.of_silent, probe.asked)
            && self.silent.contains(&drive)
        {
            return self.answer_of_silent(bench, (probe.property, drive), entry);
        }
        let exactness = self.facts.exactness;
        let exactness = Exactness {
            // A fresh twin does not hold what earlier scenarios have left in drives that are not reset.
            knows_cells: exactness.knows_cells && self.facts.resets,
            ..exactness
        };
        // Simulated drives answer alike each time.
        let most = match exactness.tolerance {
            Span::ZERO => 1,
            _ => PROBED,
        };
        let mut last = Vec::new();
        let mut silenced = false;
        for turn in 1..=most {
            let mut conversations = Vec::new();
            last.clear();
            silenced = false;
            let mut late = false;
            for entry in &probe.entries {
                let played = bench.play(entry)?;
                let Some(attempt) = played.last_played().filter(|last| last.was_played()) else {
                    self.findings.note_attempts(entry.short_name(), &played);
                    return Ok(Err(played.outcome.remarks.join("; ")));
                };
                silenced |= attempt.is_silenced();
                late |= attempt.untimely().is_some();
                conversations.push(attempt.beside().conversations.clone());
                last.push((entry.short_name(), played));
            }
            if self.parts.repeats_probe(&conversations) {
                return Ok(Ok(ProbeAnswer::NoDifference));
            }
            let twin = |header: &Header| bench.twin(&known.and(header));
            match answer(probe, self.drives, &conversations, exactness, &twin) {
                Ok(ProbeAnswer::Unexplained) => {}
                // A question that a late computer has asked says little of a time. A drive is as late at each turn.
                Ok(answer) if !late || turn == most => return Ok(Ok(answer)),
                Ok(_) => {}
                Err(problems) => return Ok(Err(problems.to_string())),
            }
            if bench.over() {
                break;
            }
        }
        if silenced {
            return Ok(Err(SILENCED.to_owned()));
        }
        for (name, played) in &last {
            self.findings.note_attempts(name, played);
        }
        Ok(Ok(ProbeAnswer::Unexplained))
    }
}

impl Qualification {
    /// Asks a drive that is silent while it tests itself for how long it does. The inner error says why it cannot be asked.
    fn answer_of_silent<B: QualifiedBench>(
        &mut self,
        bench: &mut B,
        (property, drive): (&str, u8),
        entry: &RingScenario,
    ) -> Result<Result<ProbeAnswer, String>, B::Stop> {
        let played = bench.play(entry)?;
        let Some(attempt) = played.last_played().and_then(Attempt::sound) else {
            return Ok(Err(played.outcome.remarks.join("; ")));
        };
        let mut conversations = attempt.beside().conversations.iter();
        let last = conversations.rfind(|conversation| conversation.has_steps());
        let place = (self.drives, drive);
        let byte_time = self.facts.byte_time;
        let answer = last.map(|conversation| silence(property, place, conversation, byte_time));
        Ok(Ok(answer.unwrap_or(ProbeAnswer::Unexplained)))
    }
}
