//! Attempts at a scenario: what they come to together, and whether there is another one.

use super::{Rig, SessionError};
use crate::link::{LinkEvent, Sink};
use crate::scenario::run::{Outcome, Skip, Unready, Why};
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::BTreeSet;
use std::sync::Arc;

/// How often a scenario is played whose bytes are right and come at other times than the model says.
const MOST_UNTIMELY: usize = 3;

/// How often a scenario is played at most in which the computer was late each time.
const MOST_LATE: usize = 4;

/// How often a scenario that does not pass is played on a bus of frames in real time: a busy computer moves frames against each other.
const ON_A_SEGMENT: u8 = 3;

/// How often drives are made ready before one that gives no answer has failed.
const MOST_UNREADY: usize = 3;

/// Two delays are the same within this part of the rig's tolerance.
const ALIKE: u64 = 4;

/// A byte that came at another time than the model says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LateByte {
    /// Which byte it is, in words that are the same at each attempt.
    pub which: String,
    /// How late it was, in nanoseconds; negative if it was early.
    pub by: i128,
}

impl LateByte {
    /// Whether it is the same byte, as late. A drive is late by the same time, a computer by any.
    fn is_like(&self, other: &Self, tolerance: Span) -> bool {
        let apart = self.by.abs_diff(other.by);
        self.which == other.which && apart <= u128::from(tolerance.as_nanos() / ALIKE)
    }
}

/// Whether the byte that was late in the last attempt that was played was as late in each of them.
pub fn late_each_time(attempts: &[Attempt], tolerance: Span) -> bool {
    let mut played = attempts.iter().filter(|attempt| attempt.was_played());
    let last = attempts.iter().rfind(|attempt| attempt.was_played());
    last.and_then(|last| last.late.as_ref())
        .is_some_and(|late| {
            played.all(|attempt| {
                let there = attempt.late.as_ref();
                there.is_some_and(|there| there.is_like(late, tolerance))
            })
        })
}

/// One attempt at a scenario.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// The outcome, after the comparison with the model where there is one.
    pub outcome: Outcome,
    /// What the links carried in the scenario itself, ring by ring.
    pub traces: Vec<Trace>,
    /// Number of line errors that the transport reported without their bytes.
    pub unplaced: u64,
    /// Whether that is what the master of the manual does.
    pub master_is_right: bool,
    /// How the bytes received before the drives were reset compare with a ring at rest; `None` where they are judged with the rest.
    pub opening: Option<String>,
    /// The first byte that was late, where the bus compares times.
    pub late: Option<LateByte>,
    /// What the bus keeps of it beside that.
    pub own: Option<Arc<dyn Any + Send + Sync>>,
}

impl Attempt {
    /// An attempt of which nothing else is known.
    #[must_use]
    pub const fn new(outcome: Outcome, traces: Vec<Trace>) -> Self {
        Self {
            outcome,
            traces,
            unplaced: 0,
            master_is_right: true,
            opening: None,
            late: None,
            own: None,
        }
    }

    /// Whether its steps were played: the drives were ready for them.
    #[must_use]
    pub fn was_played(&self) -> bool {
        self.outcome.unready.is_none() && self.outcome.verdict != Verdict::Skipped
    }

    /// Why the drives could not be made ready, where a drive gave no answer: the computer may have been the cause.
    fn unanswered(&self) -> Option<&str> {
        let why = self.outcome.remarks.first().map(String::as_str);
        why.filter(|_| self.outcome.unready == Some(Unready::NoAnswer))
    }

    /// Whether it did not end as the scenario says, apart from times.
    fn failed(&self) -> bool {
        let right = [Verdict::Passed, Verdict::Marginal, Verdict::Skipped];
        !right.contains(&self.outcome.verdict) && self.unanswered().is_none()
    }

    /// Whether it accuses no drive and speaks for none, for a reason that another attempt need not have: the drives were not ready, or the
    /// computer was late.
    fn showed_nothing(&self) -> bool {
        let outcome = &self.outcome;
        outcome.verdict == Verdict::Inconclusive
            && (outcome.unready.is_some() || outcome.shows_nothing)
    }
}

/// Records attempts: events as they happen, and the outcome of each.
pub trait Keeper: Sink {
    /// An attempt begins; the first has the number 1.
    fn begins(&mut self, attempt: usize);

    /// It has ended.
    fn ends(&mut self, number: usize, attempt: &Attempt);
}

/// A scenario that was played as often as the rig's file says.
#[derive(Clone, Debug)]
pub struct PlayedScenario {
    /// The outcome of all attempts together.
    pub outcome: Outcome,
    /// The attempts, in order; none where it was skipped.
    pub attempts: Vec<Attempt>,
}

impl PlayedScenario {
    pub fn skipped(skip: Skip) -> Self {
        Self {
            outcome: Outcome::skipped(skip),
            attempts: Vec::new(),
        }
    }

    /// Plays attempts on a rig in use, into what keeps them, while there are more.
    ///
    /// # Errors
    /// That of an attempt.
    pub fn play<R>(
        run: &mut R,
        mut keeper: Option<&mut dyn Keeper>,
        attempt: impl Fn(&mut R, &mut dyn Sink) -> Result<Attempt, SessionError>,
        more: impl Fn(&mut R, &[Attempt]) -> bool,
    ) -> Result<Self, SessionError> {
        let mut attempts = Vec::new();
        while attempts.is_empty() || more(run, &attempts) {
            let number = attempts.len() + 1;
            let attempt = match &mut keeper {
                Some(keeper) => {
                    keeper.begins(number);
                    let attempt = attempt(run, &mut **keeper)?;
                    keeper.ends(number, &attempt);
                    attempt
                }
                None => attempt(run, &mut Vec::<LinkEvent>::new())?,
            };
            attempts.push(attempt);
        }
        Ok(Self::of(attempts))
    }

    /// The last attempt that was played speaks for all; one whose bytes are right is flaky where another one failed. Where none was
    /// played and each time another drive gave no answer, it may have been the computer.
    pub fn of(attempts: Vec<Attempt>) -> Self {
        let mut played = Self {
            outcome: Outcome::skipped(Why::RunEnded.into()),
            attempts,
        };
        // What could not be played again takes nothing back.
        if let Some(last) = played.last_played() {
            played.outcome = last.outcome.clone();
        }
        let (outcome, attempts) = (&mut played.outcome, &played.attempts);
        if attempts.len() > 1 {
            let verdicts: Vec<_> = attempts
                .iter()
                .map(|attempt| attempt.outcome.verdict.name())
                .collect();
            let remark = format!("{} attempts: {}", attempts.len(), verdicts.join(", "));
            outcome.remarks.push(remark);
            let why = attempts.iter().find_map(Attempt::unanswered);
            let why = why.map(str::to_owned);
            let why = why.filter(|why| !outcome.remarks.contains(why));
            outcome.remarks.extend(why);
            let right = matches!(outcome.verdict, Verdict::Passed | Verdict::Marginal);
            let differed = |attempt: &Attempt| attempt.failed() && !attempt.showed_nothing();
            if right && attempts.iter().any(differed) {
                outcome.verdict = Verdict::Flaky;
            }
            let differing = outcome.unready == Some(Unready::NoAnswer)
                && unanswered_each_time(attempts).is_none();
            if differing && outcome.verdict == Verdict::Failed {
                outcome.verdict = Verdict::Inconclusive;
            }
        }
        played
    }

    /// Whether the rig failed, and not the bench's own master: nothing more can be played.
    #[must_use]
    pub fn shows_an_ill_rig(&self) -> bool {
        let last = self.attempts.last();
        self.outcome.verdict == Verdict::RigError
            && last.is_none_or(|attempt| attempt.master_is_right)
    }

    /// The last attempt that was played; the last one at all where none was.
    #[must_use]
    pub fn last_played(&self) -> Option<&Attempt> {
        let played = self.attempts.iter().rfind(|attempt| attempt.was_played());
        played.or(self.attempts.last())
    }
}

/// Which drive gave no answer, where it was the same at every attempt.
fn unanswered_each_time(attempts: &[Attempt]) -> Option<&str> {
    let why = attempts.first()?.unanswered()?;
    let same = |attempt: &Attempt| attempt.unanswered() == Some(why);
    attempts.iter().all(same).then_some(why)
}

/// When a scenario is played once more.
#[derive(Clone, Debug)]
pub struct RetryRule {
    /// How late a byte may be; zero where time is virtual.
    tolerance: Span,
    /// How often a scenario that does not pass is played, at most.
    most: usize,
    /// How often drives are made ready where one gives no answer.
    unready: usize,
    /// Which drives gave no answer at every attempt at a scenario: it is the drive, then, and not the computer.
    hopeless: BTreeSet<String>,
}

impl RetryRule {
    /// On a rig with this tolerance: as often as its file says, and in real time often enough to tell a drive from a busy computer.
    pub fn of(rig: &Rig, tolerance: Span, qualifies: bool) -> Self {
        let least = match (tolerance > Span::ZERO, rig.port().is_some()) {
            (true, true) => ON_A_SEGMENT,
            (true, false) if qualifies => 2,
            _ => 1,
        };
        Self::new(tolerance, usize::from(rig.file.retry.attempts.max(least)))
    }

    /// With this tolerance; zero where time is virtual: no computer is busy, and drives that are not ready never will be. A scenario that
    /// does not pass is played `most` times.
    pub fn new(tolerance: Span, most: usize) -> Self {
        Self {
            tolerance,
            most,
            unready: if tolerance > Span::ZERO {
                MOST_UNREADY
            } else {
                1
            },
            hopeless: BTreeSet::new(),
        }
    }

    /// Whether there is another attempt after these.
    pub fn after(&mut self, attempts: &[Attempt]) -> bool {
        let Some(last) = attempts.last() else {
            return true;
        };
        let played = attempts.len();
        match last.outcome.verdict {
            Verdict::Passed | Verdict::RigError | Verdict::Skipped => false,
            // What disturbed a drive that gave no answer may have been the computer.
            _ if played < self.unready && last.unanswered().is_some() => {
                let hopeless = |why| self.hopeless.contains(why);
                !last.unanswered().is_some_and(hopeless)
            }
            _ if last.unanswered().is_some() => {
                let why = unanswered_each_time(attempts);
                self.hopeless.extend(why.map(str::to_owned));
                false
            }
            // A busy computer is late sometimes, a drive at the same byte each time. Where another byte was late before, one more attempt shows
            // nothing else.
            Verdict::Marginal => {
                let elsewhere = last.late.is_some() && !late_each_time(attempts, self.tolerance);
                played < MOST_UNTIMELY && !elsewhere
            }
            // So is it at a byte that a silence has changed.
            _ => {
                let (late, failed): (Vec<_>, Vec<_>) = attempts
                    .iter()
                    .filter(|attempt| attempt.failed())
                    .partition(|attempt| attempt.outcome.shows_nothing);
                failed.len() < self.most && late.len() < self.most.max(MOST_LATE)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Verdict::{Failed, Flaky, Inconclusive, Marginal, Passed};

    const TOLERANCE: Span = Span::from_millis(20);

    const SILENT: &str = "cell FF00 of drive 1: it does not answer ResetH8";
    const OTHER: &str = "cell FF00 of drive 0: it does not answer ResetH8";
    const DIFFERS: &str = "cell FE20 of drive 0: 56 was written, 00 is read";

    /// An attempt that ended like this; with one of the remarks above, before its first step.
    fn attempt(verdict: Verdict, remark: &str) -> Attempt {
        let unready = match remark {
            SILENT | OTHER => Some(Unready::NoAnswer),
            DIFFERS => Some(Unready::Differs),
            _ => None,
        };
        let outcome = Outcome {
            verdict,
            unready,
            ..Outcome::rig_error(remark.to_owned())
        };
        Attempt::new(outcome, Vec::new())
    }

    fn of(ends: &[(Verdict, &str)]) -> Verdict {
        let attempts = ends.iter().map(|(verdict, why)| attempt(*verdict, why));
        PlayedScenario::of(attempts.collect()).outcome.verdict
    }

    #[test]
    fn attempts_together() {
        let (passed, failed, late) = ((Passed, ""), (Failed, ""), (Marginal, ""));
        let (silent, other, differs) = ((Failed, SILENT), (Failed, OTHER), (Failed, DIFFERS));
        assert_eq!(of(&[passed]), Passed);
        assert_eq!(of(&[failed, passed]), Flaky);
        assert_eq!(of(&[failed, late]), Flaky);
        assert_eq!(of(&[late, failed, failed]), Failed);
        assert_eq!(of(&[late, passed]), Passed);
        assert_eq!(of(&[failed, silent]), Failed);
        assert_eq!(of(&[late, silent]), Marginal);
        assert_eq!(of(&[silent]), Failed);
        assert_eq!(of(&[silent, silent]), Failed);
        assert_eq!(of(&[silent, other, silent]), Inconclusive);
        assert_eq!(of(&[silent, passed]), Passed);
        assert_eq!(of(&[silent, failed]), Failed);
        // No computer makes a cell hold another value.
        assert_eq!(of(&[differs]), Failed);
        assert_eq!(of(&[differs, passed]), Flaky);
        assert_eq!(of(&[late, differs]), Flaky);
        // A slave whose watchdog ran out while the computer was busy refuses what makes it ready.
        assert_eq!(of(&[(Inconclusive, DIFFERS), passed]), Passed);
        assert_eq!(of(&[(Inconclusive, ""), passed]), Flaky);
    }

    /// How many attempts there are where each ends like this, the last over and over.
    fn attempts(again: &mut RetryRule, most: usize, ends: &[(Verdict, &str)]) -> usize {
        let mut played: Vec<Attempt> = Vec::new();
        again.most = most;
        while again.after(&played) {
            let end = ends.get(played.len()).or(ends.last());
            let (verdict, remark) = *end.expect("an end");
            played.push(attempt(verdict, remark));
        }
        played.len()
    }

    #[test]
    fn whatever_does_not_pass_is_played_again_as_often_as_it_may_be() {
        let again = &mut RetryRule::new(TOLERANCE, 1);
        assert_eq!(attempts(again, 3, &[(Passed, "")]), 1);
        assert_eq!(attempts(again, 3, &[(Verdict::RigError, "")]), 1);
        assert_eq!(attempts(again, 1, &[(Failed, "")]), 1);
        assert_eq!(attempts(again, 5, &[(Failed, "")]), 5);
        assert_eq!(attempts(again, 5, &[(Failed, ""), (Passed, "")]), 2);
        assert_eq!(attempts(again, 1, &[(Marginal, "")]), MOST_UNTIMELY);
        // What was late before takes no attempt from what fails.
        let late = [(Marginal, ""), (Marginal, ""), (Failed, "")];
        assert_eq!(attempts(again, 1, &late), 3);
        assert_eq!(attempts(again, 2, &late), 4);
        let turns = [(Failed, ""), (Marginal, ""), (Failed, ""), (Marginal, "")];
        assert_eq!(attempts(again, 3, &turns), 4);
    }

    /// An attempt in which this byte was late by ms.
    fn late(which: &str, by: i128) -> Attempt {
        let late = Some(LateByte {
            which: which.to_owned(),
            by: by * 1_000_000,
        });
        Attempt {
            late,
            ..attempt(Marginal, "")
        }
    }

    /// Bytes that are late at other places each time were late in the computer: a third attempt shows nothing else.
    #[test]
    fn bytes_that_are_late_elsewhere_end_the_attempts() {
        let mut again = RetryRule::new(TOLERANCE, 3);
        let mut more = |played: &[Attempt]| again.after(played);
        assert!(more(&[late("a", 40)]));
        assert!(more(&[late("a", 40), late("a", 45)]));
        assert!(!more(&[late("a", 40), late("b", 40)]));
        assert!(!more(&[late("a", 40), late("a", 90)]));
        assert!(more(&[late("a", 40), attempt(Failed, "")]));
    }

    /// ND21 9.9: drives that monitor time-outs change their bytes after a silence of the computer.
    #[test]
    fn a_late_computer_takes_no_attempt_from_what_fails() {
        let late = || {
            let mut late = attempt(Inconclusive, "");
            late.outcome.shows_nothing = true;
            late
        };
        let more = |played: &[Attempt], most| RetryRule::new(TOLERANCE, most).after(played);
        assert!(more(&[late()], 1));
        assert!(more(&[late(), late(), late()], 2));
        assert!(!more(&[late(), late(), late(), late()], 2));
        assert!(!more(&[late(), attempt(Failed, "")], 1));
        assert!(more(&[late(), attempt(Failed, ""), late()], 2));
        assert!(!more(&[late(), attempt(Passed, "")], 2));
        let played = vec![late(), late(), attempt(Passed, "")];
        assert_eq!(PlayedScenario::of(played).outcome.verdict, Passed);
    }

    #[test]
    fn a_silent_drive_is_made_ready_again_as_the_computer_may_have_disturbed_it() {
        let again = &mut RetryRule::new(TOLERANCE, 1);
        assert_eq!(attempts(again, 1, &[(Failed, DIFFERS)]), 1);
        let disturbed = [(Failed, SILENT), (Passed, "")];
        assert_eq!(attempts(again, 1, &disturbed), 2);
        let mixed = [(Failed, SILENT), (Failed, OTHER), (Failed, SILENT)];
        assert_eq!(attempts(again, 1, &mixed), MOST_UNREADY);
        assert_eq!(attempts(again, 1, &disturbed), 2);
        assert_eq!(attempts(again, 1, &[(Failed, SILENT)]), MOST_UNREADY);
        // It has been silent at every attempt at a scenario: it is the drive.
        assert_eq!(attempts(again, 1, &[(Failed, SILENT)]), 1);
    }

    #[test]
    fn nothing_disturbs_a_drive_where_time_is_virtual() {
        let again = &mut RetryRule::new(Span::ZERO, 1);
        assert_eq!(attempts(again, 1, &[(Failed, SILENT)]), 1);
    }

    #[test]
    fn a_reason_is_told_once() {
        let same = vec![attempt(Failed, SILENT), attempt(Failed, SILENT)];
        let told = ["2 attempts: failed, failed", SILENT];
        let mut remarks = PlayedScenario::of(same).outcome.remarks;
        remarks.sort_unstable();
        assert_eq!(remarks, told);
        let passed = vec![attempt(Failed, SILENT), attempt(Passed, "well")];
        let told = ["well", "2 attempts: failed, passed", SILENT];
        assert_eq!(PlayedScenario::of(passed).outcome.remarks, told);
    }
}
