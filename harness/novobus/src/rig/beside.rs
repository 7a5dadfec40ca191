//! What an attempt on rings has beside its outcome: how it compares with the twin, and what that says of the drives.

use super::driven::DriverAttempt;
use super::explanation::Explanation;
use super::judge::{AttemptFacts, judge, known};
use super::run::{opening, twin};
use crate::language::syntax::Header;
use crate::twin::{Comparison, Conversation, Divergence, Twin};
use harness_bench::link::{Capability, LinkEvent};
use harness_bench::rig::{Attempt, PlayedScenario, late_each_time};
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::sync::Arc;

/// What an attempt on rings has beside its outcome.
#[derive(Clone, Debug)]
pub(crate) struct BesideTwin {
    /// The conversations, those of the health check and of what is set up before among them.
    pub conversations: Vec<Conversation>,
    /// How they compare with the twin's.
    pub comparisons: Vec<Comparison>,
    /// What the bench's own master did in it on a simulated rig, if it had a part.
    pub driven: Option<DriverAttempt>,
    /// The choices of the manual with which it was compared, where the model's defaults do not explain what came before the scenario.
    pub assumed: Header,
}

/// Of an attempt that no twin stands beside.
static NOTHING: BesideTwin = BesideTwin {
    conversations: Vec::new(),
    comparisons: Vec::new(),
    driven: None,
    assumed: Header::NONE,
};

impl BesideTwin {
    /// The same, compared with drives of these choices.
    pub(crate) fn with(self, assumed: Option<Explanation>) -> Self {
        match assumed {
            None => self,
            Some(found) => Self {
                comparisons: found.comparisons,
                assumed: found.header,
                ..self
            },
        }
    }
}

/// Judges an attempt beside a twin, which is replaced where it has heard something else than the drives. `facts` has nothing of what was said.
pub(super) fn judged(
    facts: AttemptFacts<'_>,
    said: Vec<Conversation>,
    (events, capabilities): (&[LinkEvent], &[Capability]),
    mut outcome: Outcome,
    beside: &mut Twin,
) -> Attempt {
    let (rig, way, exactness) = (facts.rig, facts.way, facts.exactness);
    // It was made before.
    let fresh = || twin(rig, &known(rig)).ok();
    let opening = opening(rig, way, &said, exactness);
    let (conversations, anew) = way.compared(said, exactness);
    if anew && let Some(fresh) = fresh() {
        *beside = fresh;
    }
    let (comparisons, stale) = beside.follow_all(&conversations, way.exactness(exactness));
    if stale && let Some(fresh) = fresh() {
        *beside = fresh;
    }
    let recorded = (exactness.tolerance, capabilities);
    let driven = DriverAttempt::new(facts.plan, events, way, recorded, &outcome);
    // In real time a record does not hold every moment at which the master was asked.
    let driven = driven.filter(|_| rig.is_simulated());
    let driver = driven.as_ref();
    let master_is_right = driver.is_none_or(|driver| driver.judge(&mut outcome));
    let facts = AttemptFacts {
        conversations: &conversations,
        comparisons: &comparisons,
        ..facts
    };
    let assumed = judge(&mut outcome, &facts);
    let unplaced = facts.unplaced;
    let beside = BesideTwin {
        conversations,
        comparisons,
        driven,
        assumed: Header::default(),
    };
    Attempt {
        master_is_right,
        unplaced,
        opening,
        ..kept(outcome, beside.with(assumed))
    }
}

/// An attempt with what stands beside its outcome.
fn kept(outcome: Outcome, beside: BesideTwin) -> Attempt {
    let mut comparisons = beside.comparisons.iter();
    let late = comparisons.find_map(|comparison| comparison.untimely.as_ref());
    Attempt {
        late: late.map(Divergence::late_byte),
        own: Some(Arc::new(beside)),
        ..Attempt::new(outcome, Vec::new())
    }
}

/// An attempt on rings.
pub(crate) trait OnRings {
    /// What it has beside its outcome.
    fn beside(&self) -> &BesideTwin;

    /// Whether the first byte that differs follows a silence or a delay of the bench, which may be its cause.
    fn is_silenced(&self) -> bool;

    /// The attempt, if its steps were played and the bench's own lateness is no cause of a difference in it.
    fn sound(&self) -> Option<&Self>;

    /// The first byte that came at another time than the model says.
    fn untimely(&self) -> Option<&Divergence>;
}

impl OnRings for Attempt {
    fn beside(&self) -> &BesideTwin {
        let beside = self.own.as_ref();
        let beside = beside.and_then(|beside| beside.downcast_ref());
        beside.unwrap_or(&NOTHING)
    }

    fn is_silenced(&self) -> bool {
        let mut comparisons = self.beside().comparisons.iter();
        comparisons.any(|comparison| comparison.silenced)
    }

    fn sound(&self) -> Option<&Self> {
        (self.was_played() && !self.is_silenced()).then_some(self)
    }

    fn untimely(&self) -> Option<&Divergence> {
        self.beside()
            .comparisons
            .iter()
            .find_map(|c| c.untimely.as_ref())
    }
}

/// A scenario that was played on rings.
pub(crate) trait PlayedOnRings {
    /// The last attempt played and its differences from the model, if they say something about the drives. A difference that was not seen
    /// again may be due to the computer: drives that could not be made ready once, and, in real time, every byte that was late.
    fn telling(&self, real_time: bool) -> Option<(&Attempt, Vec<&Divergence>)>;

    /// The first byte of the last attempt that came late, if a byte was late at every attempt, at the same place and by the same time.
    fn late_each_time(&self, tolerance: Span) -> Option<&Divergence>;
}

impl PlayedOnRings for PlayedScenario {
    fn telling(&self, real_time: bool) -> Option<(&Attempt, Vec<&Divergence>)> {
        let last = self.last_played()?;
        let divergences: Vec<_> = match self.outcome.verdict {
            Verdict::Passed | Verdict::Flaky | Verdict::Inconclusive => Vec::new(),
            // What the bench or its line could not do says nothing about a drive.
            Verdict::Aborted | Verdict::RigError if real_time => Vec::new(),
            Verdict::Marginal if real_time => Vec::new(),
            Verdict::Marginal => last.untimely().into_iter().collect(),
            _ => {
                let all = last.beside().comparisons.iter();
                all.filter_map(|c| c.divergence.as_ref()).collect()
            }
        };
        (!divergences.is_empty()).then_some((last, divergences))
    }

    fn late_each_time(&self, tolerance: Span) -> Option<&Divergence> {
        let late = self.last_played()?.untimely()?;
        let same = late_each_time(&self.attempts, tolerance);
        (self.outcome.verdict == Verdict::Marginal && same).then_some(late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::{Role, Symptom};
    use Verdict::{Failed, Inconclusive, Marginal, Passed};
    use harness_bench::scenario::run::Unready;
    use harness_proto::line::Received;
    use harness_proto::time::Instant;

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
        let beside = BesideTwin {
            comparisons: vec![comparison],
            ..NOTHING.clone()
        };
        kept(attempt.outcome, beside)
    }

    fn tells(attempts: Vec<Attempt>) -> bool {
        PlayedScenario::of(attempts).telling(true).is_some()
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
        assert!(each_time(vec![late(3, 40), late(3, 45), late(3, 42)]));
        assert!(!each_time(vec![late(3, 40), late(3, 90), late(3, 40)]));
        assert!(!each_time(vec![late(3, 40), late(5, 40), late(3, 40)]));
        let passed = attempt(Passed, "");
        assert!(!each_time(vec![late(3, 40), late(3, 40), passed]));
        let unready = differing(attempt(Failed, SILENT), 0, None);
        assert!(each_time(vec![late(3, 40), unready, late(3, 40)]));
    }
}
