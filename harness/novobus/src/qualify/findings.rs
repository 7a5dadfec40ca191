//! What a qualification compared with the model, and what differed.

use super::blame::{Culprit, Meant, Sighting, Trial, agreed, culprit};
use super::diagnose::{NamedDeviation, RingSeen};
use super::pinned::PinnedDrive;
use crate::rig::DriverAttempt;
use crate::rig::{OnRings, PlayedOnRings};
use crate::twin::{Conversation, Exactness};
use harness_bench::counted::counted;
use harness_bench::rig::{Attempt, PlayedScenario};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::fmt::Write as _;

/// The most deviations that are listed.
const MOST_TOLD: usize = 8;

/// The most scenarios and probes listed that were not compared, or not equal.
const MOST_LISTED: usize = 12;

/// Why a conversation that passed was compared in part: drives of any kind race here.
const RACE: &str =
    "drives sent bytes by themselves, so the order of the bytes behind them is open (ND21 9.9)";

/// The most sections that are listed for a drive whose deviation has no name.
const MOST_SECTIONS: usize = 3;

/// What was played, and what of it differed from the model.
#[derive(Default)]
pub(super) struct Findings {
    /// How many drives the ring has, the time of a byte, and how far times may be apart.
    drives: u8,
    byte_time: Span,
    tolerance: Span,
    /// Where attempts differed, each with the name of its scenario.
    sightings: Vec<(String, Sighting)>,
    /// The outcomes of those that were tried with the drives' roles exchanged.
    trials: Vec<Trial>,
    /// What questions to the ring have shown.
    pinned: Vec<PinnedDrive>,
    /// The conversations of each attempt that differed.
    differing: Vec<Vec<Conversation>>,
    /// Those in which the driver had a part: it waits and tries again, which takes long to be explained and says no more.
    with_driver: Vec<Vec<Conversation>>,
    /// Those of attempts in which nothing differed.
    alike: Vec<Vec<Conversation>>,
    /// The drives that the telegrams around a difference name.
    suspects: Vec<u8>,
    /// What the bench's own master did, and whether it was ever wrong.
    pub(super) driven: Vec<DriverAttempt>,
    pub(super) master_is_wrong: bool,
    /// Scenarios and conversations that were played, and that were compared to their end and equal.
    played: usize,
    equal: usize,
    /// Those that were not played because the rig cannot, or may not.
    skipped: usize,
    /// Bytes compared, and bytes whose values only the drives know.
    bytes: u64,
    unknown: u64,
    /// How many probes were asked.
    probes: usize,
    /// Whether a scenario or a probe has failed.
    failed: bool,
    /// What was not compared, or not equal, with its name.
    open: Vec<String>,
    /// What drives of any kind show only in part on this rig, with its name: it says nothing against them.
    in_part: Vec<String>,
    /// How many scenarios and conversations had a byte that differed and accuses no drive.
    unsettled: usize,
    /// The bytes that drives hold back, as far as the tolerance permits.
    held_back: Vec<String>,
}

impl Findings {
    /// Those of a ring of `drives` on which nothing was played yet.
    pub(super) fn new(drives: u8, byte_time: Span, tolerance: Span) -> Self {
        Self {
            drives,
            byte_time,
            tolerance,
            ..Self::default()
        }
    }

    /// Notes the outcome of a scenario.
    pub(super) fn note(&mut self, name: &str, played: &PlayedScenario) {
        let Some(last) = played.last_played() else {
            self.skipped += 1;
            return;
        };
        self.note_attempts(name, played);
        self.played += 1;
        for comparison in &last.beside().comparisons {
            let unknown = comparison.measured + comparison.adopted.len() as u64;
            self.bytes += comparison.compared.saturating_sub(unknown);
            self.unknown += unknown;
        }
        match self.why_open(played, last) {
            None => {
                self.equal += 1;
                self.alike.push(last.beside().conversations.clone());
            }
            Some(RACE) => self.in_part.push(format!("{name}: {RACE}")),
            Some(why) => self.note_unequal(name, why, played, last),
        }
    }

    /// Notes a conversation that another part has played, and whose bytes or verdict are not those of the first part. It is not counted again.
    pub(super) fn note_other_part(&mut self, name: &str, played: &PlayedScenario) {
        let Some(last) = played.last_played() else {
            self.open.push(format!("{name}: not played there"));
            return;
        };
        self.note_attempts(name, played);
        match self.why_open(played, last) {
            None => self.alike.push(last.beside().conversations.clone()),
            Some(RACE) => {}
            Some(why) => self.note_unequal(name, why, played, last),
        }
    }

    fn note_unequal(&mut self, name: &str, why: &str, played: &PlayedScenario, last: &Attempt) {
        let flaky = played.outcome.verdict == Verdict::Flaky;
        self.unsettled += usize::from(differs(last) || flaky);
        self.open.push(format!("{name}: {why}"));
    }

    /// Why a scenario was not compared to its end, or not equal; `None` where it was both.
    fn why_open(&self, played: &PlayedScenario, last: &Attempt) -> Option<&'static str> {
        let differs = differs(last);
        let comparisons = &last.beside().comparisons;
        let left_out = comparisons.iter().any(|compared| compared.left_out);
        let monitored = comparisons.iter().any(|compared| compared.monitored);
        let whole = comparisons.len() == last.beside().conversations.len() && !left_out;
        Some(match played.outcome.verdict {
            Verdict::Skipped => "the drives could not be made ready",
            Verdict::Inconclusive if last.is_silenced() => {
                "the computer was late or left the line silent before the first byte that differs (ND21 9.9)"
            }
            Verdict::Inconclusive if differs => {
                "a byte differed where the manual leaves the drive a choice"
            }
            _ if differs => "a byte differed",
            Verdict::Failed => "it failed, although every byte is as the model says",
            Verdict::Inconclusive => "it settles nothing",
            Verdict::Flaky => "a byte differed once, and not again",
            Verdict::Aborted => "it was aborted",
            Verdict::RigError => "the rig failed",
            Verdict::Marginal if played.late_each_time(self.tolerance).is_some() => {
                "a byte was late by the same time at each attempt: the computer or a drive is slow"
            }
            Verdict::Passed | Verdict::Marginal if !whole && !monitored => {
                "a drive sent bytes by itself, and none monitors the line"
            }
            Verdict::Passed | Verdict::Marginal if !whole => RACE,
            Verdict::Passed | Verdict::Marginal => return None,
        })
    }

    /// Notes the attempts at a scenario or a probe, for the deviations that explain them.
    pub(super) fn note_attempts(&mut self, name: &str, played: &PlayedScenario) {
        self.failed |= played.outcome.verdict == Verdict::Failed;
        for attempt in &played.attempts {
            self.driven.extend(attempt.beside().driven.clone());
            self.master_is_wrong |= !attempt.master_is_right;
            let sighting = self.sighting(attempt);
            self.sightings
                .extend(sighting.map(|sighting| (name.to_owned(), sighting)));
        }
        let Some((attempt, divergences)) = played.telling(self.tolerance > Span::ZERO) else {
            return;
        };
        let attempts = match attempt.beside().driven {
            Some(_) => &mut self.with_driver,
            None => &mut self.differing,
        };
        attempts.push(attempt.beside().conversations.clone());
        for there in divergences {
            self.suspects
                .extend(there.drive.into_iter().chain(there.role.drive()));
        }
        self.suspects.sort_unstable();
        self.suspects.dedup();
    }

    /// Where an attempt differed.
    fn sighting(&self, attempt: &Attempt) -> Option<Sighting> {
        let mut comparisons = attempt.beside().comparisons.iter().enumerate();
        let found = comparisons.find(|(_, comparison)| comparison.divergence.is_some());
        let found = found.filter(|_| attempt.outcome.verdict == Verdict::Failed)?;
        Sighting::of(
            &attempt.beside().conversations,
            found,
            self.drives,
            self.byte_time,
        )
    }

    /// Where attempts differed, each with the name of its scenario.
    pub(super) fn sightings(&self) -> &[(String, Sighting)] {
        &self.sightings
    }

    /// Notes an attempt with the drives' roles exchanged: to whom the byte belonged at which it differed, if it did. `None` where it says
    /// nothing.
    pub(super) fn note_exchanged(&mut self, played: &PlayedScenario) -> Option<Option<Meant>> {
        let last = played.last_played().and_then(Attempt::sound)?;
        let found = match (differs(last), self.sighting(last)) {
            (true, Some(sighting)) => Some(sighting.meant),
            (true, None) => Some(Meant::Nobody),
            (false, _) => None,
        };
        let conversations = last.beside().conversations.clone();
        match played.telling(self.tolerance > Span::ZERO) {
            Some(_) => self.differing.push(conversations),
            None if found.is_none() => self.alike.push(conversations),
            None => return None,
        }
        Some(found)
    }

    /// Notes the outcomes of sightings that were tried with the roles exchanged.
    pub(super) fn note_trials(&mut self, trials: Vec<Trial>) {
        self.trials.extend(trials);
    }

    /// Notes what a question to the ring has shown.
    pub(super) fn note_pinned(&mut self, pinned: PinnedDrive) {
        self.pinned.push(pinned);
    }

    /// The drive that alone explains where attempts differed, as far as the bytes and the trials say.
    fn culprit(&self) -> Option<Culprit> {
        // What was seen only once may be a byte that was damaged on its way.
        let seen = self.sightings.iter().map(|(_, sighting)| sighting.meant);
        let seen: Vec<_> = seen.collect();
        let found = culprit(self.drives, &seen, &self.trials, &self.pinned);
        found.filter(|_| seen.len() > 1)
    }

    /// Notes a probe that was asked.
    pub(super) fn note_probe(&mut self) {
        self.probes += 1;
    }

    /// Notes something that was not compared, or not equal.
    pub(super) fn note_open(&mut self, why: String) {
        self.open.push(why);
    }

    /// Notes that a drive holds a byte back each time.
    pub(super) fn note_held_back(&mut self, what: String) {
        self.held_back.push(what);
    }

    /// Whether something differed that a drive is to blame for.
    pub(super) fn differ(&self) -> bool {
        !self.differing.is_empty() || !self.with_driver.is_empty() || self.culprit().is_some()
    }

    /// The verdict of the findings: a drive has failed only where a scenario or a probe has.
    pub(super) fn judged(&self) -> Verdict {
        match self.master_is_wrong {
            true => Verdict::RigError,
            false if self.differ() && self.failed => Verdict::Failed,
            false if self.differ() || self.is_open() || !self.held_back.is_empty() => {
                Verdict::Inconclusive
            }
            false => Verdict::Passed,
        }
    }

    /// Whether something was not compared, or not equal.
    pub(super) fn is_open(&self) -> bool {
        !self.open.is_empty()
    }

    /// What is to be explained. Where the driver's part shows nothing new it is left out.
    pub(super) fn seen(&self, drives: u8, exactness: Exactness) -> RingSeen<'_> {
        RingSeen {
            drives,
            suspects: &self.suspects,
            differing: match self.differing.is_empty() {
                true => &self.with_driver,
                false => &self.differing,
            },
            alike: &self.alike,
            exactness,
        }
    }

    /// The deviations that explain what differed, `None` where they were not looked for, and what was compared; `known` are those that the
    /// rig's file names.
    pub(super) fn text(&self, named: Option<&[NamedDeviation]>, known: &[String]) -> String {
        let mut text = self.verdict(named, known);
        if self.is_open() {
            text.push_str("not compared, or not equal:\n");
        }
        // Writing to a String cannot fail.
        for open in self.open.iter().take(MOST_LISTED) {
            let _infallible = writeln!(text, "  {open}");
        }
        if self.open.len() > MOST_LISTED {
            let more = self.open.len() - MOST_LISTED;
            let _infallible = writeln!(text, "  and {more} more");
        }
        for note in &self.in_part {
            let _infallible = writeln!(text, "compared in part: {note}");
        }
        text
    }

    /// Which deviations there are, as far as is known.
    fn verdict(&self, named: Option<&[NamedDeviation]>, known: &[String]) -> String {
        let held_back = self.held_back.iter();
        let lines = held_back.map(|held| format!("deviation: {held}\n"));
        let mut text: String = lines.collect();
        let count = self.counts();
        // Writing to a String cannot fail.
        if self.differ() && named.is_none() {
            let _infallible = writeln!(
                text,
                "deviations: the drives differ from the model; no explanation was looked for, because not everything was played: {count}"
            );
        } else if let Some(named) = named.filter(|_| self.differ()) {
            let (culprit, named) = agreed(self.culprit(), named);
            for one in named.iter().take(MOST_TOLD) {
                let _infallible = writeln!(text, "deviation: {one}");
            }
            match named.len() {
                0 => text.push_str(&self.unnamed(culprit)),
                1 => {}
                2..=MOST_TOLD => text.push_str(
                    "each of these explains every byte: the bytes do not tell which one it is\n",
                ),
                more => {
                    let more = more - MOST_TOLD;
                    let _infallible = writeln!(
                        text,
                        "each of these, and {more} more, explains every byte: the bytes do not tell which one it is"
                    );
                }
            }
            let _infallible = writeln!(text, "compared: {count}");
        } else if self.is_open() || self.equal == 0 || !self.held_back.is_empty() {
            let what = match self.unsettled {
                0 => "no byte is known to differ, but not everything was compared".to_owned(),
                some => format!(
                    "bytes differed in {}, and it is not known that a drive is the cause",
                    counted(some, "scenario")
                ),
            };
            let _infallible = writeln!(text, "deviations: not known; {what}: {count}");
        } else if known.is_empty() {
            let compared = match self.in_part.is_empty() {
                true => "every byte",
                false => "every byte that was compared",
            };
            let _infallible = writeln!(
                text,
                "deviations: none; {compared} is as the model of the manual says: {count}"
            );
        } else {
            let known = known.join(", ");
            let _infallible = writeln!(
                text,
                "deviations: none beside the known ones ({known}): {count}"
            );
        }
        text
    }

    /// The report if no known deviation explains every byte.
    fn unnamed(&self, culprit: Option<Culprit>) -> String {
        let Some(culprit) = culprit else {
            return "deviations: the drives differ from the model, and no single known deviation explains every byte; not known which drive\n".to_owned();
        };
        let pinned = self.pinned.iter();
        let shown = pinned.filter(|pinned| pinned.drive == culprit.drive);
        let mut shown: Vec<String> = shown
            .map(|pinned| {
                format!(
                    "deviation: {culprit}: no known deviation explains it (ND21 {}): {pinned}\n",
                    pinned.section
                )
            })
            .collect();
        shown.dedup();
        if !shown.is_empty() {
            return shown.concat();
        }
        let mut sections: Vec<(&str, usize, &(String, Sighting))> = Vec::new();
        for seen @ (_, sighting) in &self.sightings {
            match sections
                .iter_mut()
                .find(|(known, ..)| *known == sighting.section)
            {
                Some((_, count, _)) => *count += 1,
                None => sections.push((sighting.section, 1, seen)),
            }
        }
        sections.sort_by_key(|(_, count, _)| std::cmp::Reverse(*count));
        let lines = sections.iter().take(MOST_SECTIONS).map(|(section, count, (name, sighting))| {
            format!(
                "deviation: {culprit}: no known deviation explains it (ND21 {section}): seen in {}, one of them at {name}: {}\n",
                counted(*count, "attempt"),
                sighting.about
            )
        });
        lines.collect()
    }

    /// How much was compared.
    fn counts(&self) -> String {
        format!(
            "{} of {} scenarios played match the model to their end, {} were skipped; {} compared, {} more have values that only the drives know; {} asked",
            self.equal,
            self.played,
            self.skipped,
            counted(self.bytes, "byte"),
            self.unknown,
            counted(self.probes, "probe")
        )
    }
}

/// Whether a byte of an attempt differs from the model's.
fn differs(attempt: &Attempt) -> bool {
    let mut comparisons = attempt.beside().comparisons.iter();
    comparisons.any(|comparison| comparison.divergence.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played() -> Findings {
        Findings {
            played: 3,
            equal: 3,
            bytes: 90,
            ..Findings::default()
        }
    }

    /// A run ends with exit code 1 only where something has failed: what differed once and passed at the next attempt settles nothing.
    #[test]
    fn a_drive_has_failed_only_where_a_scenario_has() {
        let mut differs = played();
        assert_eq!(differs.judged(), Verdict::Passed);
        differs.differing.push(Vec::new());
        assert_eq!(differs.judged(), Verdict::Inconclusive);
        differs.failed = true;
        assert_eq!(differs.judged(), Verdict::Failed);
        let mut open = played();
        open.note_open("the run ended before everything was played".to_owned());
        assert_eq!(open.judged(), Verdict::Inconclusive);
    }

    #[test]
    fn none_is_said_only_where_everything_was_compared_and_equal() {
        let none = "deviations: none; every byte is as the model of the manual says: 3 of 3";
        assert!(played().text(Some(&[]), &[]).starts_with(none));
        let nothing = Findings::default().text(Some(&[]), &[]);
        assert!(!nothing.contains("none"), "{nothing}");
        let mut ended = played();
        ended.note_open("the run ended before everything was played".to_owned());
        for named in [None, Some(&[][..])] {
            let text = ended.text(named, &["known".to_owned()]);
            assert!(!text.contains("none"), "{text}");
            assert!(
                text.contains("\n  the run ended before everything was played\n"),
                "{text}"
            );
        }
        let mut raced = played();
        raced.in_part.push(format!("9.9-master-silent: {RACE}"));
        assert_eq!(raced.judged(), Verdict::Passed);
        let text = raced.text(Some(&[]), &[]);
        assert!(text.starts_with("deviations: none; every byte that was compared"));
        assert!(
            text.contains("\ncompared in part: 9.9-master-silent: "),
            "{text}"
        );
        let mut unsettled = played();
        unsettled.unsettled = 2;
        unsettled.note_open("10.2-march: a byte differed once, and not again".to_owned());
        let text = unsettled.text(Some(&[]), &[]);
        assert!(text.contains("bytes differed in 2 scenarios, "), "{text}");
        let mut differs = played();
        differs.differing.push(Vec::new());
        for named in [None, Some(&[][..])] {
            let text = differs.text(named, &[]);
            assert!(
                text.starts_with("deviations: the drives differ from the model"),
                "{text}"
            );
        }
    }
}
