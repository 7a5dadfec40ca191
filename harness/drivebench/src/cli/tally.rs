//! What a run comes to: how many scenarios of each verdict, which tables of the manual it covered, what was not played and why, and the
//! exit code.

use crate::command::exit::Exit;
use crate::counted::counted;
use crate::evidence::Earlier;
use crate::library::Entry;
use crate::scenario::files::is_named;
use crate::scenario::run::{Outcome, Unlock, Why, together};
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fmt::Write as _;
use std::path::PathBuf;

/// The most changes of a rig that a summary names, each with how many more scenarios it would let be played.
const NAMED_UNLOCKS: usize = 8;

/// The verdicts of a run so far.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    verdicts: Vec<Verdict>,
    took: Span,
    /// Why scenarios were skipped, and how many for each reason, in the order in which the reasons came up.
    skipped: Vec<(String, usize)>,
    /// Tables and examples of the manual that the selected scenarios pin, each with whether a scenario of it was judged.
    tables: BTreeMap<String, bool>,
    /// What together would let more scenarios be played, and how many each.
    unlocks: BTreeMap<BTreeSet<Unlock>, usize>,
    /// Some were selected and not reached.
    ended_early: bool,
    /// The files and built-in scenarios that were named one by one.
    named: Vec<PathBuf>,
    /// The rig's limits deny one of those.
    named_denied: bool,
    /// What is not played again.
    earlier: EarlierVerdicts,
}

/// What earlier runs have shown of the selected scenarios that are not played again.
#[derive(Clone, Debug, Default)]
pub(crate) struct EarlierVerdicts {
    verdicts: Vec<Verdict>,
    /// The names of scenarios that did not pass in an earlier run and were not selected now.
    left: Vec<String>,
}

impl EarlierVerdicts {
    /// Divides the selected scenarios: those that are to be played, and what is known of the others.
    pub(crate) fn of(earlier: &Earlier, entries: Vec<Entry>) -> (Vec<Entry>, Self) {
        let left = earlier.left(&entries);
        let verdicts = entries.iter().filter_map(|entry| earlier.shown(entry));
        let verdicts = verdicts.collect();
        let mut entries = entries;
        entries.retain(|entry| earlier.shown(entry).is_none());
        (entries, Self { verdicts, left })
    }
}

impl fmt::Display for EarlierVerdicts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.verdicts.is_empty() {
            let count = counted(self.verdicts.len(), "scenario");
            writeln!(f, "not played again, passed before: {count}")?;
        }
        if !self.left.is_empty() {
            writeln!(
                f,
                "still outstanding, not selected: {}",
                self.left.join(", ")
            )?;
        }
        Ok(())
    }
}

impl Tally {
    /// A run for which the user named these scenarios, files and folders. A scenario that is named itself and denied is the user's mistake.
    pub(crate) fn of_named(named: &[PathBuf], earlier: EarlierVerdicts) -> Self {
        Self {
            named: named.to_vec(),
            ..Self::after(earlier)
        }
    }

    /// A run that plays what earlier runs have not shown.
    pub(crate) fn after(earlier: EarlierVerdicts) -> Self {
        Self {
            earlier,
            ..Self::default()
        }
    }

    /// Counts a scenario, and the tables that it pins.
    pub(crate) fn note(&mut self, entry: &Entry, outcome: &Outcome) {
        let judged = outcome.verdict != Verdict::Skipped;
        for source in &entry.scenario.sources {
            *self.tables.entry(source.text.clone()).or_default() |= judged;
        }
        let unlocks = outcome.skip.as_ref().map(|skip| &skip.unlocks);
        if let Some(unlocks) = unlocks.filter(|unlocks| !unlocks.is_empty()) {
            *self.unlocks.entry(unlocks.clone()).or_default() += 1;
        }
        let why = outcome.skip.as_ref().map(|skip| &skip.why);
        self.named_denied |=
            matches!(why, Some(Why::Denied(_))) && is_named(&self.named, &entry.name);
        self.count(outcome);
    }

    fn count(&mut self, outcome: &Outcome) {
        self.verdicts.push(outcome.verdict);
        self.took = self.took + outcome.took;
        if let Some(reason) = outcome.skip.as_ref().map(|skip| skip.why.group()) {
            match self.skipped.iter_mut().find(|(known, _)| *known == reason) {
                Some((_, count)) => *count += 1,
                None => self.skipped.push((reason, 1)),
            }
        }
    }

    /// Counts a scenario that the run did not come to; without it the run is incomplete.
    pub(crate) fn not_reached(&mut self, entry: &Entry, outcome: &Outcome) {
        self.note(entry, outcome);
        self.ended_early = true;
    }

    /// The exit code; `require_all` counts skipped scenarios as missing. A scenario that was named and is denied asks for what the rig's file
    /// does not permit: wrong usage.
    pub(crate) fn exit(&self, require_all: bool) -> Exit {
        let verdicts = [&self.verdicts[..], &self.earlier.verdicts].concat();
        match Exit::of(&verdicts, require_all || self.ended_early) {
            Exit::Passed | Exit::Incomplete if self.named_denied => Exit::Usage,
            Exit::Passed | Exit::NothingSelected if !self.earlier.left.is_empty() => {
                Exit::Incomplete
            }
            exit => exit,
        }
    }

    /// Which tables were covered, and what would unlock the rest.
    fn coverage(&self) -> String {
        let covered = self.tables.values().filter(|judged| **judged).count();
        let mut text = format!(
            "covered: {} of {} tables and examples of the manual that the selected scenarios pin\n",
            covered,
            self.tables.len()
        );
        let mut unlocks: Vec<_> = self.unlocks.iter().collect();
        unlocks.sort_by_key(|(what, count)| (std::cmp::Reverse(**count), *what));
        let (first, others) = unlocks.split_at(unlocks.len().min(NAMED_UNLOCKS));
        let named = first.iter().map(|(what, count)| (together(what), **count));
        let others: usize = others.iter().map(|(_, count)| **count).sum();
        let others = (others > 0).then(|| ("other rigs".to_owned(), others));
        let unlocks: Vec<_> = named
            .chain(others)
            .map(|(what, count)| format!("{what} ({count})"))
            .collect();
        if !unlocks.is_empty() {
            let _infallible = writeln!(text, "more scenarios with: {}", unlocks.join(", "));
        }
        text
    }

    /// The counts in a line, and others for what was not played and what was covered.
    pub(crate) fn summary(&self) -> String {
        let mut text = counts(&self.verdicts);
        let (all, took) = (self.verdicts.len(), self.took);
        let _infallible = writeln!(text, " ({}, {took} on the line)", counted(all, "scenario"));
        let reasons = self.skipped.iter();
        let reasons: Vec<_> = reasons
            .map(|(reason, count)| format!("{count} ({reason})"))
            .collect();
        if !reasons.is_empty() {
            let _infallible = writeln!(text, "not played: {}", reasons.join(", "));
            text.push_str(&self.coverage());
        }
        let _infallible = write!(text, "{}", self.earlier);
        text
    }
}

/// How many there are of each verdict: `3 passed, 0 failed, 1 skipped`.
pub(crate) fn counts(verdicts: &[Verdict]) -> String {
    let count = |wanted: Verdict| verdicts.iter().filter(|v| **v == wanted).count();
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
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::BUSES;
    use crate::link::Capability;
    use crate::scenario::run::{Skip, Why};
    use crate::scenario::source::Source;
    use harness_proto::limit::LimitSetting;

    fn of(outcomes: &[Outcome]) -> Tally {
        let mut tally = Tally::default();
        note(&mut tally, outcomes);
        tally
    }

    fn note(tally: &mut Tally, outcomes: &[Outcome]) {
        let source = |n: usize| {
            let document = BUSES[0].manual.document;
            let text = format!("title t\nsource {document} 9.{n}\nring 1\n> 80\n");
            Source::from_bytes("t.scn".to_owned(), text.into_bytes()).expect("a text")
        };
        for (outcome, n) in outcomes.iter().zip(1..) {
            let entry = Entry::new(source(n), None).expect("a scenario");
            tally.note(&entry, outcome);
        }
    }

    fn lacks(missing: &[Capability], unlocks: impl IntoIterator<Item = Unlock>) -> Outcome {
        Outcome::skipped(Skip::from(Why::Lacks(missing.to_vec())).and(unlocks))
    }

    fn no_interposer(place: &str) -> Outcome {
        let place = place.to_owned();
        let why = Skip::from(Why::NoInterposer(place.clone()));
        Outcome::skipped(why.and([Unlock::Interposer(place)]))
    }

    fn passed() -> Outcome {
        Outcome {
            verdict: Verdict::Passed,
            ..Outcome::rig_error(String::new())
        }
    }

    #[test]
    fn what_was_not_played_is_named_in_groups() {
        let limits = [LimitSetting::Reset, LimitSetting::Motion].map(Unlock::Limit);
        let denied = Skip::from(Why::Denied("ring 1: byte 4".to_owned())).and(limits);
        let tally = of(&[
            no_interposer("1->0"),
            passed(),
            lacks(
                &[Capability::Power, Capability::Motion],
                [Unlock::Simulated, Unlock::Limit(LimitSetting::Motion)],
            ),
            no_interposer("2->1"),
            Outcome::skipped(Skip::other_size(vec![(100, 100)], vec![3])),
            Outcome::skipped(denied),
        ]);
        assert_eq!(
            tally.summary(),
            "1 passed, 0 failed, 5 skipped (6 scenarios, 0.000 ms on the line)\n\
             not played: 2 (the rig has no interposer), 1 (the rig has no simulator), \
             1 (it is for rings of another size), 1 (the rig's [limits] do not let it be played to its end)\n\
             covered: 1 of 6 tables and examples of the manual that the selected scenarios pin\n\
             more scenarios with: `allow_motion` and `allow_reset` in [limits] and --allow-motion (1), an interposer at 1->0 (1), \
             an interposer at 2->1 (1), a ring of 100 drives (1), a simulated rig (1)\n"
        );
        assert_eq!(of(&[passed()]).summary().lines().count(), 1);
    }

    #[test]
    fn a_long_list_of_what_is_missing_is_short() {
        let at = |place: u8| format!("{}->{place}", place + 1);
        let taps = (0..99).map(|place| Unlock::Tap(at(place)));
        let long = Skip::from(Why::NoTap(at(0))).and(taps.chain([Unlock::Interposer(at(97))]));
        let sizes =
            (1..=9).map(|size| Outcome::skipped(Skip::other_size(vec![(size, size)], vec![20])));
        let outcomes: Vec<_> = [Outcome::skipped(long)].into_iter().chain(sizes).collect();
        let summary = of(&outcomes).summary();
        let line = summary.lines().last();
        assert_eq!(
            line,
            Some(
                "more scenarios with: taps at 99 links and an interposer at 98->97 (1), a ring of 1 drive (1), a ring of 2 drives (1), \
                 a ring of 3 drives (1), a ring of 4 drives (1), a ring of 5 drives (1), a ring of 6 drives (1), a ring of 7 drives (1), \
                 other rigs (2)"
            )
        );
    }

    /// A scenario that was named itself is not skipped in silence where the rig's limits deny it; one of a folder or of all is.
    #[test]
    fn what_was_named_and_is_denied_is_wrong_usage() {
        let denied = || Outcome::skipped(Why::Denied("ring 1: byte 4".to_owned()).into());
        let failed = || Outcome {
            verdict: Verdict::Failed,
            ..passed()
        };
        let exit = |named: &str, outcomes: &[Outcome]| {
            let mut tally = Tally::of_named(&[PathBuf::from(named)], EarlierVerdicts::default());
            note(&mut tally, outcomes);
            tally.exit(false)
        };
        assert_eq!(exit("t.scn", &[denied()]), Exit::Usage);
        assert_eq!(exit("t", &[denied(), passed()]), Exit::Usage);
        assert_eq!(exit("t.scn", &[denied(), failed()]), Exit::Failed);
        assert_eq!(exit("folder", &[denied()]), Exit::Incomplete);
        assert_eq!(exit("folder", &[denied(), passed()]), Exit::Passed);
        assert_eq!(
            exit("t.scn", &[lacks(&[Capability::Tap], [])]),
            Exit::Incomplete
        );
    }

    #[test]
    fn a_run_that_ended_early_is_incomplete() {
        let mut tally = of(&[passed(), lacks(&[Capability::Tap], [])]);
        assert_eq!(tally.exit(false), Exit::Passed);
        assert_eq!(tally.exit(true), Exit::Incomplete);
        tally.ended_early = true;
        assert_eq!(tally.exit(false), Exit::Incomplete);
    }
}
