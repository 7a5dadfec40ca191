//! What a run comes to: how many scenarios of each verdict, what was not played and why, and the exit code.

use super::exit::Exit;
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::fmt::Write as _;

/// The verdicts of a run so far.
#[derive(Debug, Default)]
pub(super) struct Tally {
    verdicts: Vec<Verdict>,
    took: Span,
    /// Why scenarios were skipped, and how many for each reason, in the order in which the reasons came up.
    skipped: Vec<(String, usize)>,
    /// Some were selected and not reached.
    ended_early: bool,
}

impl Tally {
    /// Counts a scenario.
    pub(super) fn note(&mut self, outcome: &Outcome) {
        self.verdicts.push(outcome.verdict);
        self.took = self.took + outcome.took;
        if let Some(reason) = outcome.reason_to_skip() {
            match self.skipped.iter_mut().find(|(own, _)| own == reason) {
                Some((_, count)) => *count += 1,
                None => self.skipped.push((reason.to_owned(), 1)),
            }
        }
    }

    /// Counts a scenario that the run did not come to; without it the run is incomplete.
    pub(super) fn not_reached(&mut self, outcome: &Outcome) {
        self.note(outcome);
        self.ended_early = true;
    }

    /// The exit code; `require_all` counts skipped scenarios as missing.
    pub(super) fn exit(&self, require_all: bool) -> Exit {
        Exit::of(&self.verdicts, require_all || self.ended_early)
    }

    /// The counts in a line, and another one for what was not played.
    pub(super) fn summary(&self) -> String {
        let count = |wanted: Verdict| self.verdicts.iter().filter(|v| **v == wanted).count();
        let mut text = format!(
            "{} passed, {} failed",
            count(Verdict::Passed),
            count(Verdict::Failed)
        );
        // Writing to a String cannot fail.
        for verdict in Verdict::REST {
            if count(verdict) > 0 {
                let _infallible = write!(text, ", {} {verdict}", count(verdict));
            }
        }
        let (all, took) = (self.verdicts.len(), self.took);
        let _infallible = writeln!(text, " ({all} scenarios, {took} on the line)");
        let reasons = self.skipped.iter();
        let reasons: Vec<_> = reasons
            .map(|(reason, count)| format!("{count} ({reason})"))
            .collect();
        if !reasons.is_empty() {
            let _infallible = writeln!(text, "not played: {}", reasons.join(", "));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(outcomes: &[Outcome]) -> Tally {
        let mut tally = Tally::default();
        outcomes.iter().for_each(|outcome| tally.note(outcome));
        tally
    }

    fn skipped(why: &str) -> Outcome {
        Outcome::skipped(why.to_owned())
    }

    fn passed() -> Outcome {
        Outcome {
            verdict: Verdict::Passed,
            ..skipped("")
        }
    }

    #[test]
    fn what_was_not_played_is_named_in_groups() {
        let tally = of(&[
            skipped("the rig has no interposer at 1->0"),
            passed(),
            skipped("the rig has no power, no tap"),
            skipped("the rig has no interposer at 2->1"),
            skipped("it is for rings of another size (100 drives, the rig has 3)"),
            skipped("the rig's [limits] do not let it be played to its end: ring 1: byte 4"),
        ]);
        assert_eq!(
            tally.summary(),
            "1 passed, 0 failed, 5 skipped (6 scenarios, 0.000 ms on the line)\n\
             not played: 2 (the rig has no interposer), 1 (the rig has no power, no tap), \
             1 (it is for rings of another size), 1 (the rig's [limits] do not let it be played to its end)\n"
        );
        assert_eq!(of(&[passed()]).summary().lines().count(), 1);
    }

    #[test]
    fn a_run_that_ended_early_is_incomplete() {
        let mut tally = of(&[passed(), skipped("the rig has no tap")]);
        assert_eq!(tally.exit(false), Exit::Passed);
        assert_eq!(tally.exit(true), Exit::Incomplete);
        tally.not_reached(&skipped("the run ended before it"));
        assert_eq!(tally.exit(false), Exit::Incomplete);
    }
}
