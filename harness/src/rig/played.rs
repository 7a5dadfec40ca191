//! Attempts at a scenario: what they come to together, and whether there is another one.

use super::Driven;
use super::Rig;
use crate::buses::syntax::Header;
use crate::buses::twin::{Comparison, Conversation, Divergence};
use crate::rig::left_open::Explanation;
use crate::scenario::run::{Outcome, Skip, Unready, Why};
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::collections::BTreeSet;

/// How often a scenario is played whose bytes are right and come at other times than the model says.
const MOST_UNTIMELY: usize = 3;

/// How often a scenario that does not pass is played on a bus of frames in real time: a busy computer moves frames against each other.
const ON_A_SEGMENT: u8 = 3;

/// How often a scenario that does not pass is played, at most: as often as the rig's file says, and in real time often enough to tell a drive
/// from a busy computer.
pub(crate) fn attempts_of(rig: &Rig, real_time: bool, qualifies: bool) -> usize {
    let least = match (real_time, rig.port().is_some()) {
        (true, true) => ON_A_SEGMENT,
        (true, false) if qualifies => 2,
        _ => 1,
    };
    usize::from(rig.file.retry.attempts.max(least))
}

/// How often drives are made ready before one that gives no answer has failed.
const MOST_UNREADY: usize = 3;

/// One attempt at a scenario.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// The outcome, after the comparison with the twin.
    pub outcome: Outcome,
    /// The conversations, those of the health check and of what is set up before among them.
    pub conversations: Vec<Conversation>,
    /// How they compare with the twin's.
    pub comparisons: Vec<Comparison>,
    /// What the links carried in the scenario itself, ring by ring.
    pub traces: Vec<Trace>,
    /// Number of line errors that the transport reported without their bytes.
    pub unplaced: u64,
    /// What the bench's own master did in it on a simulated rig, if it had a part.
    pub driven: Option<Driven>,
    /// Whether that is what the master of the manual does.
    pub master_is_right: bool,
    /// How the bytes received before the drives were reset compare with a ring at rest; `None` where they are judged with the rest.
    pub opening: Option<String>,
    /// The choices of the manual with which it was compared, where the model's defaults do not explain what came before the scenario.
    pub assumed: Header,
}

impl Attempt {
    /// An attempt on simulated rings of its own, which no twin stands beside.
    #[must_use]
    pub fn on_own_rings(outcome: Outcome, traces: Vec<Trace>) -> Self {
        Self {
            outcome,
            traces,
            conversations: Vec::new(),
            comparisons: Vec::new(),
            unplaced: 0,
            driven: None,
            master_is_right: true,
            opening: None,
            assumed: Header::default(),
        }
    }

    /// The attempt, compared with drives of these choices.
    pub(crate) fn beside(self, assumed: Option<Explanation>) -> Self {
        match assumed {
            None => self,
            Some(found) => Self {
                comparisons: found.comparisons,
                assumed: found.header,
                ..self
            },
        }
    }

    /// Whether its steps were played: the drives were ready for them.
    #[must_use]
    pub fn was_played(&self) -> bool {
        self.outcome.unready.is_none()
    }

    /// Whether the first byte that differs follows a silence or a delay of the bench, which may be its cause.
    #[must_use]
    pub fn is_silenced(&self) -> bool {
        self.comparisons.iter().any(|own| own.silenced)
    }

    /// The attempt, if its steps were played and the bench's own lateness is no cause of a difference in it.
    #[must_use]
    pub fn sound(&self) -> Option<&Self> {
        (self.was_played() && !self.is_silenced()).then_some(self)
    }

    /// Why the drives could not be made ready, where a drive gave no answer: the computer may have been the cause.
    fn unanswered(&self) -> Option<&str> {
        let why = self.outcome.remarks.first().map(String::as_str);
        why.filter(|_| self.outcome.unready == Some(Unready::NoAnswer))
    }

    /// Whether something differed in it, apart from times.
    fn failed(&self) -> bool {
        let right = [Verdict::Passed, Verdict::Marginal, Verdict::Skipped];
        !right.contains(&self.outcome.verdict) && self.unanswered().is_none()
    }

    /// The first byte that came at another time than the model says.
    pub(crate) fn untimely(&self) -> Option<&Divergence> {
        self.comparisons.iter().find_map(|c| c.untimely.as_ref())
    }
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
    pub(crate) fn skipped(skip: Skip) -> Self {
        Self {
            outcome: Outcome::skipped(skip),
            attempts: Vec::new(),
        }
    }

    /// The last attempt that was played speaks for all; one whose bytes are right is flaky where another one failed. Where none was
    /// played and each time another drive gave no answer, it may have been the computer.
    pub(crate) fn of(attempts: Vec<Attempt>) -> Self {
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
            if right && attempts.iter().any(Attempt::failed) {
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

    /// The last attempt played and its differences from the model, if they say something about the drives. A difference that was not seen
    /// again may be due to the computer: drives that could not be made ready once, and, in real time, every byte that was late.
    #[must_use]
    pub fn telling(&self, real_time: bool) -> Option<(&Attempt, Vec<&Divergence>)> {
        let last = self.last_played()?;
        let divergences: Vec<_> = match self.outcome.verdict {
            Verdict::Passed | Verdict::Flaky | Verdict::Inconclusive => Vec::new(),
            // What the bench or its line could not do says nothing about a drive.
            Verdict::Aborted | Verdict::RigError if real_time => Vec::new(),
            Verdict::Marginal if real_time => Vec::new(),
            Verdict::Marginal => last.untimely().into_iter().collect(),
            _ => {
                let all = last.comparisons.iter();
                all.filter_map(|c| c.divergence.as_ref()).collect()
            }
        };
        (!divergences.is_empty()).then_some((last, divergences))
    }

    /// Whether the rig failed, and not the bench's own master: nothing more can be played.
    #[must_use]
    pub fn shows_an_ill_rig(&self) -> bool {
        let last = self.attempts.last();
        self.outcome.verdict == Verdict::RigError && last.is_none_or(|own| own.master_is_right)
    }

    /// The last attempt that was played; the last one at all where none was.
    #[must_use]
    pub fn last_played(&self) -> Option<&Attempt> {
        let played = self.attempts.iter().rfind(|own| own.was_played());
        played.or(self.attempts.last())
    }

    /// The first byte of the last attempt that came late, if a byte was late at every attempt, at the same place and by the same time.
    #[must_use]
    pub fn late_each_time(&self, tolerance: Span) -> Option<&Divergence> {
        let late = self.last_played()?.untimely()?;
        let mut played = self.attempts.iter().filter(|own| own.was_played());
        let like = |attempt: &Attempt| {
            let there = attempt.untimely();
            there.is_some_and(|there| there.is_like(late, tolerance))
        };
        (self.outcome.verdict == Verdict::Marginal && played.all(like)).then_some(late)
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
pub(crate) struct Again {
    /// How often drives are made ready where one gives no answer.
    unready: usize,
    /// Which drives gave no answer at every attempt at a scenario: it is the drive, then, and not the computer.
    hopeless: BTreeSet<String>,
}

impl Again {
    /// On a rig whose time is real; where it is virtual, no computer is busy, and drives that are not ready never will be.
    pub(crate) fn new(real_time: bool) -> Self {
        Self {
            unready: if real_time { MOST_UNREADY } else { 1 },
            hopeless: BTreeSet::new(),
        }
    }

    /// Whether there is another attempt behind these; `most` is how often the rig's file has one that does not pass.
    pub(crate) fn after(&mut self, attempts: &[Attempt], most: usize) -> bool {
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
            // A busy computer is late sometimes, a drive at the same byte each time.
            Verdict::Marginal => played < MOST_UNTIMELY,
            _ => attempts.iter().filter(|own| own.failed()).count() < most,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::twin::{Role, Symptom};
    use Verdict::{Failed, Flaky, Inconclusive, Marginal, Passed};
    use harness_proto::line::Received;

    use harness_proto::time::Instant;

    const SILENT: &str = "cell FF00 of drive 1: it does not answer ResetH8";
    const OTHER: &str = "cell FF00 of drive 0: it does not answer ResetH8";
    const DIFFERS: &str = "cell FE20 of drive 0: 56 was written, 00 is read";

    /// An attempt that ended like this; with one of the remarks above, before its first step.
    fn attempt(verdict: Verdict, remark: &str) -> Attempt {
        Attempt {
            driven: None,
            master_is_right: true,
            opening: None,
            assumed: Header::default(),
            outcome: Outcome {
                verdict,
                unready: match remark {
                    SILENT | OTHER => Some(Unready::NoAnswer),
                    DIFFERS => Some(Unready::Differs),
                    _ => None,
                },
                ..Outcome::rig_error(remark.to_owned())
            },
            conversations: Vec::new(),
            comparisons: Vec::new(),
            traces: Vec::new(),
            unplaced: 0,
        }
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
    }

    /// How many attempts there are where each ends like this, the last over and over.
    fn attempts(again: &mut Again, most: usize, ends: &[(Verdict, &str)]) -> usize {
        let mut played: Vec<Attempt> = Vec::new();
        while again.after(&played, most) {
            let end = ends.get(played.len()).or(ends.last());
            let (verdict, remark) = *end.expect("an end");
            played.push(attempt(verdict, remark));
        }
        played.len()
    }

    #[test]
    fn whatever_does_not_pass_is_played_again_as_often_as_it_may_be() {
        let again = &mut Again::new(true);
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

    #[test]
    fn a_silent_drive_is_made_ready_again_as_the_computer_may_have_disturbed_it() {
        let again = &mut Again::new(true);
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

    /// An attempt in which the byte at a place of the scenario differs: it is `late` milliseconds late, or has another value.
    fn differing(attempt: Attempt, step: usize, late: Option<u64>) -> Attempt {
        let byte = |at| Some((Instant::START + Span::from_millis(at), Received::good(0x80)));
        let divergence = Divergence {
            ring: 0,
            byte: step + 7,
            what: late.map_or(Symptom::Value, |_| Symptom::Time),
            expected: byte(100),
            received: byte(100 + late.unwrap_or(0)),
            role: Role::Foreign,
            rule: Role::Foreign.rule(),
            step: Some(step),
            drive: Some(1),
        };
        let comparison = Comparison {
            divergence: late.is_none().then(|| divergence.clone()),
            untimely: late.map(|_| divergence),
            ..Comparison::default()
        };
        Attempt {
            comparisons: vec![comparison],
            ..attempt
        }
    }

    fn tells(attempts: Vec<Attempt>) -> bool {
        PlayedScenario::of(attempts).telling(true).is_some()
    }

    #[test]
    fn nothing_disturbs_a_drive_where_time_is_virtual() {
        let again = &mut Again::new(false);
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

    #[test]
    fn what_did_not_come_again_tells_nothing_of_the_drives() {
        let failed = || differing(attempt(Failed, ""), 3, None);
        assert!(tells(vec![failed()]));
        assert!(tells(vec![failed(), failed()]));
        assert!(!tells(vec![failed(), attempt(Passed, "")]));
        assert!(!tells(vec![attempt(Failed, "")]));
        assert!(!tells(vec![differing(attempt(Inconclusive, ""), 3, None)]));
        let unready = || differing(attempt(Failed, SILENT), 0, None);
        assert!(tells(vec![unready(), unready(), unready()]));
        assert!(!tells(vec![unready(), attempt(Passed, "")]));
        assert!(!tells(vec![unready(), attempt(Failed, OTHER)]));
        assert!(tells(vec![unready(), failed()]));
        assert!(tells(vec![differing(attempt(Failed, DIFFERS), 0, None)]));
    }

    /// A computer can be as late at every attempt: in real time that is no difference of the drives.
    #[test]
    fn bytes_that_are_late_each_time_are_told_and_blame_no_drive() {
        let late = |step, by| differing(attempt(Marginal, ""), step, Some(by));
        let each_time = |attempts: Vec<Attempt>| {
            let played = PlayedScenario::of(attempts);
            assert!(played.telling(true).is_none());
            assert_eq!(
                played.telling(false).is_some(),
                played.outcome.verdict == Marginal
            );
            played.late_each_time(Span::from_millis(20)).is_some()
        };
        assert!(each_time(vec![late(3, 40), late(3, 45), late(3, 25)]));
        assert!(!each_time(vec![late(3, 40), late(3, 90), late(3, 40)]));
        assert!(!each_time(vec![late(3, 40), late(5, 40), late(3, 40)]));
        let passed = attempt(Passed, "");
        assert!(!each_time(vec![late(3, 40), late(3, 40), passed]));
        let unready = differing(attempt(Failed, SILENT), 0, None);
        assert!(each_time(vec![late(3, 40), unready, late(3, 40)]));
    }
}
