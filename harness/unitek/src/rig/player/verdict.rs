//! The verdict of an attempt in which a line was not met, or right drives would have sent something else.

use super::worlds::Shown;
use super::{AtRest, Other, Own, PHASES, Player};
use crate::judge::World;
use harness_bench::rig::segment::observed::LinkTimes;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::run::outcome::Mismatch;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use std::collections::BTreeSet;

/// Why a line that was not met accuses nothing.
const LATE_ALONE: &str = "right drives send the same where frames are as late as these: the line is not met for that reason alone";

impl Player {
    /// Whether a line that was not met accuses the drive.
    pub(super) fn judged(
        &mut self,
        own: &Own,
        outcome: Outcome,
        way: LinkTimes,
        (unlike, shown): (&[(u8, u8)], &Shown),
    ) -> Outcome {
        match (outcome.verdict, shown) {
            (Verdict::Failed | Verdict::Passed, Shown::Wrong(why)) => {
                return wronged(own, outcome, why.clone());
            }
            (Verdict::Failed, Shown::Complete) => {
                if let Some(goes_on) = self.excuses(own, &outcome, unlike) {
                    let late = right_but_late(outcome);
                    let verdict = match goes_on {
                        // What stands behind the line is played in the next attempt.
                        true => Verdict::Marginal,
                        false => Verdict::Passed,
                    };
                    return Outcome { verdict, ..late };
                }
            }
            (Verdict::Passed, Shown::Complete)
                if let Some((_, found)) = self.excused.get(&own.name) =>
            {
                let why = [LATE_ALONE.to_owned(), found.clone()].into_iter();
                let remarks = why.chain(outcome.remarks).collect();
                let outcome = Outcome { remarks, ..outcome };
                return outcome.judged_by(&own.plan);
            }
            (Verdict::Passed, Shown::Right | Shown::Unknown)
                if self.excused.contains_key(&own.name) =>
            {
                return not_compared(outcome);
            }
            (Verdict::Passed, Shown::Unknown) if own.by_frames => return not_compared(outcome),
            _ => {}
        }
        if outcome.verdict != Verdict::Failed {
            return outcome.judged_by(&own.plan);
        }
        let asks_for = own.asks_for();
        let unlike = unlike
            .iter()
            .find(|(_, register)| asks_for.contains(register));
        let real = way.tolerance > Span::ZERO;
        let why = if real && way.late > way.tolerance {
            Some(format!(
                "the computer was late by {}: this may not be the drive's fault",
                way.late
            ))
        } else if real && way.longest > way.tolerance {
            Some(format!(
                "a request and its reply took {} over the adapter: this may not be the drive's fault",
                way.longest
            ))
        } else if let Some((node, register)) = unlike {
            Some(format!(
                "register {register:02X} ({}) of drive {node} differs at rest from that of the model of the drive: the scenario may be for \
                 another firmware",
                Register::of(*register).name
            ))
        } else {
            self.left_open(own, way).map(|property| {
                format!(
                    "a correct drive with {property} does not meet it either, and this is not known"
                )
            })
        };
        match why {
            None => outcome,
            Some(why) => Outcome {
                verdict: Verdict::Inconclusive,
                remarks: std::iter::once(why).chain(outcome.remarks).collect(),
                ..outcome
            },
        }
    }

    /// Takes the contents of the line that was not met, and of those behind it, from what the lines judge, where right drives are compared in
    /// all that they ask for; returns whether more is asked for behind it. `None` where it is not so, or was done before.
    fn excuses(&mut self, own: &Own, outcome: &Outcome, unlike: &[(u8, u8)]) -> Option<bool> {
        let found = outcome.finding.as_ref()?;
        let compared = |register| {
            let differs = unlike.iter().any(|own| own.1 == register);
            World::compares(register) && !differs
        };
        let (lines, goes_on) = own.lines_from(found.span.start, compared)?;
        let first = || (BTreeSet::new(), found.message.clone());
        let excused = self.excused.entry(own.name.clone()).or_insert_with(first);
        if excused.0.contains(&found.span.start) {
            return None;
        }
        excused.0.extend(lines);
        Some(goes_on)
    }

    /// A difference from the model with which a correct drive does not meet the scenario either: the first property that is not
    /// settled, the place of its clock, or times in which frames leave.
    fn left_open(&self, own: &Own, way: LinkTimes) -> Option<String> {
        let fails = |other: Other<'_>| {
            let played = self.rehearse(own, &self.limits, other);
            played.denied.is_some() || played.outcome.verdict != Verdict::Passed
        };
        for phase in PHASES.map(|own| Span::from_micros(own * 1_000 / 32)) {
            let other = Other {
                phase,
                ..Other::default()
            };
            if fails(other) {
                return Some(format!("its clock of 1 ms ahead by {phase}"));
            }
        }
        for slow in way.slow() {
            let other = Other {
                slow: Some(slow),
                ..Other::default()
            };
            if fails(other) {
                return Some(format!(
                    "an adapter through which frames leave {} late",
                    slow.by
                ));
            }
        }
        for (place, known) in self.known().iter().enumerate() {
            for (words, other) in known.candidates() {
                let drives = self.known().iter().enumerate();
                let all: Vec<_> = drives
                    .map(|(at, own)| if at == place { other } else { own.properties })
                    .collect();
                let other = Other {
                    properties: Some(&all),
                    ..Other::default()
                };
                if fails(other) {
                    return Some(words);
                }
            }
        }
        None
    }
}

/// An attempt in which a drive did what no right one does, in a sentence.
fn wronged(own: &Own, outcome: Outcome, wrong: String) -> Outcome {
    let last = own.plan.steps.last();
    let found = outcome.finding.unwrap_or_else(|| Mismatch {
        span: last.map_or(TextSpan::default(), |step| step.span),
        message: wrong.clone(),
        difference: None,
        in_error: String::new(),
    });
    Outcome {
        verdict: Verdict::Failed,
        finding: Some(found),
        remarks: std::iter::once(wrong).chain(outcome.remarks).collect(),
        ..outcome
    }
}

/// An attempt of which only the frames judge, and these were not compared.
fn not_compared(outcome: Outcome) -> Outcome {
    let why = "what came was not compared to its end: there are too many worlds, or something beside the bus has changed the drive";
    Outcome {
        verdict: Verdict::Inconclusive,
        remarks: std::iter::once(why.to_owned())
            .chain(outcome.remarks)
            .collect(),
        ..outcome
    }
}

/// An attempt in which the drives did what right ones do, and a line is not met since frames were late.
fn right_but_late(outcome: Outcome) -> Outcome {
    let found = outcome.finding.map(|own| own.message);
    let why = std::iter::once(LATE_ALONE.to_owned()).chain(found);
    Outcome {
        finding: None,
        remarks: why.chain(outcome.remarks).collect(),
        ..outcome
    }
}

/// The registers in which drives and their models read differently at rest, by number and register.
pub(super) fn unlike(drives: &AtRest, models: &AtRest) -> Vec<(u8, u8)> {
    let mask = |(node, register, bits): &(u8, u8, u32)| {
        (*node, *register, bits & Register::of(*register).mask())
    };
    let models: BTreeSet<_> = models.iter().map(mask).collect();
    let drives: BTreeSet<_> = drives.iter().map(mask).collect();
    let differing = drives.symmetric_difference(&models);
    let places: BTreeSet<_> = differing
        .map(|(node, register, _)| (*node, *register))
        .collect();
    places.into_iter().collect()
}
