//! Derives the verdict of each scenario again from its attempts, and checks the reasons of skipped scenarios.

use super::attempt::RecordedVerdict;
use super::files::{SCENARIOS, sum};
use super::record::RecordLine;
use super::verify::{JudgedAttempt, OpenedFolder};
use crate::counted::counted;
use crate::library::Entry;
use crate::link::LinkEvent;
use crate::rig::{Attempt, PlayedScenario, RetryRule, Rig};
use crate::scenario::run::{Outcome, Skip, Why};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;

/// Gives the text of a scenario by its name, or why there is none.
type Texts<'t> = &'t dyn Fn(&str) -> Result<String, String>;

/// What of the lines `case` and `end` does not follow from the attempts.
pub(super) fn differences(
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
    texts: Texts<'_>,
) -> Vec<String> {
    let header = &opened.header;
    let mut settling = Settling {
        opened,
        texts,
        retries: RetryRule::of(&opened.rig, header.tolerance, header.qualified),
        wrong: Vec::new(),
        verdicts: Vec::new(),
    };
    let mut left = judged;
    let mut pending = 0;
    let is_case = |line: &RecordLine| matches!(line, RecordLine::Case { .. });
    let last = opened.lines.iter().rposition(is_case);
    for (place, line) in opened.lines.iter().enumerate() {
        match line {
            RecordLine::Scenario { .. } => pending += 1,
            RecordLine::Case { .. } => {
                let (attempts, rest) = left.split_at(pending.min(left.len()));
                settling.case(line, attempts, Some(place) == last);
                (left, pending) = (rest, 0);
            }
            RecordLine::End { verdicts, safe } => settling.end(verdicts, *safe, &left[..pending]),
            _ => {}
        }
    }
    settling.wrong
}

struct Settling<'s> {
    opened: &'s OpenedFolder,
    texts: Texts<'s>,
    retries: RetryRule,
    wrong: Vec<String>,
    verdicts: Vec<String>,
}

impl Settling<'_> {
    fn case(&mut self, line: &RecordLine, attempts: &[JudgedAttempt<'_>], is_last: bool) {
        let RecordLine::Case {
            name,
            title,
            drives,
            verdict,
            finding,
            remarks,
            took,
            sha256,
        } = line
        else {
            return;
        };
        self.verdicts.push(verdict.clone());
        let text = match (self.texts)(name) {
            Ok(text) => text,
            Err(_) if self.opened.header.schema < 2 && attempts.is_empty() => return,
            Err(why) => return self.wrong.push(format!("case {name}: {why}")),
        };
        let mut must = |what: &str, stated: &str, expected: &str| {
            if stated != expected {
                self.wrong.push(format!(
                    "case {name}: the record has the {what} \"{stated}\", its attempts give \"{expected}\""
                ));
            }
        };
        if self.opened.header.schema > 1 {
            let stated = sha256.as_deref().unwrap_or("none");
            must("sum of its text", stated, &sum(text.as_bytes()));
        }
        let entry = match self.opened.entry(name, &text) {
            Ok(entry) => entry,
            Err(why) => return self.wrong.push(format!("{SCENARIOS}/{name}.scn: {why}")),
        };
        must("title", title, &entry.scenario.title);
        must("drives", drives, &entry.drives());
        for attempt in attempts {
            must("name", name, &attempt.recorded.name);
        }
        // What is wrong with an attempt has been reported.
        if attempts.iter().any(|attempt| attempt.differs.is_some()) {
            return;
        }
        let mut verdicts = attempts.iter().map(|attempt| &attempt.recorded.verdict);
        if verdicts.any(Option::is_none) {
            return must("verdict", verdict, Verdict::RigError.name());
        }
        let outcome = match attempts {
            [] => self.opened.skipped(&entry, remarks).unwrap_or_else(|| {
                Outcome::rig_error("nothing keeps it from being played, and it was not".to_owned())
            }),
            _ => PlayedScenario::of(settled(attempts)).outcome,
        };
        must("verdict", verdict, outcome.verdict.name());
        let found = outcome.finding.as_ref().map(|found| found.message.as_str());
        must(
            "finding",
            finding.as_deref().unwrap_or("nothing"),
            found.unwrap_or("nothing"),
        );
        must("remarks", &remarks.join("; "), &outcome.remarks.join("; "));
        must(
            "time",
            &Span::from_units(*took).units().to_string(),
            &outcome.took.units().to_string(),
        );
        self.numbers(name, attempts, is_last);
    }

    /// Attempts are counted from 1, and there are as many as the rig's file asks for. A run on a rig with ports ends after an attempt whose
    /// drives are not seen in their safe state, which no record shows.
    fn numbers(&mut self, name: &str, attempts: &[JudgedAttempt<'_>], is_last: bool) {
        let header = &self.opened.header;
        let numbers = attempts.iter().map(|attempt| attempt.recorded.attempt);
        if !numbers.eq(1..=attempts.len()) {
            self.wrong
                .push(format!("case {name}: its attempts are not numbered from 1"));
        }
        if header.own_rings || header.schema < 2 || attempts.is_empty() {
            return;
        }
        let all = settled(attempts);
        let too_many = (1..all.len()).any(|n| !self.retries.after(&all[..n]));
        let trouble = attempts.iter().any(|attempt| match &attempt.again {
            Ok((_, again)) => again.trouble,
            Err(_) => true,
        });
        let may_end = trouble || is_last && !header.simulated;
        let too_few = self.retries.after(&all) && !may_end;
        if too_many || too_few {
            let count = attempts.len();
            self.wrong.push(format!(
                "case {name}: {}, not as many as the rig's file asks for",
                counted(count, "attempt")
            ));
        }
    }

    fn end(&mut self, verdicts: &[String], safe: Option<bool>, left: &[JudgedAttempt<'_>]) {
        if let Some(attempt) = left.first() {
            self.wrong.push(format!(
                "{}: the record has its attempts and no line of what came of them",
                attempt.recorded.name
            ));
        }
        if *verdicts != self.verdicts {
            self.wrong.push(format!(
                "the last line has the verdicts {}, the scenarios have {}",
                verdicts.join(", "),
                self.verdicts.join(", ")
            ));
        }
        let wrong = match (self.opened.header.simulated, safe) {
            (true, Some(true)) => {
                "of simulated drives only a safe state that is not reached is told, and the last line has one that is"
            }
            (false, None) => "the last line does not tell of the safe state",
            _ => "",
        };
        if !wrong.is_empty() {
            self.wrong.push(wrong.to_owned());
        }
    }
}

/// The attempts as they were judged again.
fn settled(attempts: &[JudgedAttempt<'_>]) -> Vec<Attempt> {
    let settled = attempts.iter().filter_map(JudgedAttempt::attempt);
    settled.collect()
}

impl RecordedVerdict {
    /// An attempt as it was judged again, with faults that never happened, which only the run knows. Which byte was late decides whether there is
    /// another attempt.
    fn settles(&self, again: &Attempt) -> Attempt {
        let outcome = Outcome {
            remarks: self.remarks.clone(),
            // On a simulated rig the record lacks the time of bytes that were not fetched; playing it again shows it.
            took: self.took,
            ..again.outcome.clone()
        };
        Attempt {
            outcome,
            ..again.clone()
        }
    }
}

impl JudgedAttempt<'_> {
    /// Whether the rig's line was lost in it, or the like: nothing is played after it.
    pub(super) fn ends_the_run(&self) -> bool {
        let mut events = self.recorded.events.iter();
        events.any(|event| matches!(event, LinkEvent::Trouble(trouble) if trouble.ends_a_run()))
    }

    /// The attempt as it was judged again.
    pub(super) fn attempt(&self) -> Option<Attempt> {
        let (_, again) = self.again.as_ref().ok()?;
        Some(self.recorded.verdict.as_ref()?.settles(&again.attempt))
    }
}

impl OpenedFolder {
    /// A scenario of the folder, settled for the rings of the rig.
    pub(super) fn entry(&self, name: &str, text: &str) -> Result<Entry, String> {
        let source = Source {
            name: name.to_owned(),
            text: text.to_owned().into(),
        };
        // A rig on another bus has no ring for which a scenario could be made.
        let rings = self.header.of_rings.then_some(&self.header.drives);
        let drives = rings.and_then(|rings| rings.first()).copied();
        Entry::fitting(source, drives).map_err(|problems| problems.to_string())
    }

    /// Why a scenario is not played on this rig; `None` where it is.
    fn skipped(&self, entry: &Entry, remarks: &[String]) -> Option<Outcome> {
        if let Some(judge) = self.judge().ok()? {
            return judge.not_begun(&entry.source, remarks);
        }
        Some(Outcome::skipped(too_large(entry, &self.rig)?))
    }
}

/// Why a scenario does not fit the rings of a rig on which each scenario has rings of its own; `None` where it does.
#[must_use]
pub fn too_large(entry: &Entry, rig: &Rig) -> Option<Skip> {
    if let Some(port) = rig.port() {
        let settled = &entry.settled;
        let drives = port.drives.len();
        if entry.scenario.bus != port.bus.bus() {
            return Some(Skip::not_on_rig(entry.scenario.bus));
        }
        let why = format!(
            "it is for {} drives, and the rig has {drives}",
            settled.size()
        );
        return (settled.size() != drives.to_string()).then(|| Why::OtherDrives(why).into());
    }
    let rings = entry.settled.rings()?;
    let sizes: Vec<_> = rig.rings().map(|(_, ring)| ring.drives).collect();
    (rings.drives != sizes).then(|| Skip::other_size(rings.sizes, sizes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::LateByte;
    use harness_proto::time::Span;

    /// A run ends after two attempts in which other bytes were late, and so does its record.
    #[test]
    fn which_byte_was_late_decides_how_many_attempts_there_are() {
        let tolerance = Span::from_millis(20);
        let ends_after = |bytes: [&str; 2]| {
            let attempts = bytes.map(|which| {
                let outcome = Outcome {
                    verdict: Verdict::Marginal,
                    ..Outcome::rig_error("late".to_owned())
                };
                let by = 40_000_000;
                let which = which.to_owned();
                let again = Attempt {
                    late: Some(LateByte { which, by }),
                    ..Attempt::new(outcome, Vec::new())
                };
                let recorded = RecordedVerdict {
                    verdict: Verdict::Marginal.name().to_owned(),
                    finding: None,
                    remarks: Vec::new(),
                    took: Span::ZERO,
                    unplaced: 0,
                    opening: None,
                };
                recorded.settles(&again)
            });
            !RetryRule::new(tolerance, 3).after(&attempts)
        };
        assert!(ends_after(["byte 3", "byte 5"]));
        assert!(!ends_after(["byte 3", "byte 3"]));
    }
}
