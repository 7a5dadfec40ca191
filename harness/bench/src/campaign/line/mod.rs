//! Campaigns on buses whose stations share one line: a conversation of the master with a drive, disturbed at every frame or telegram.
//!
//! What is disturbed, and which classes of outcomes there are, only the bus knows. What came of a campaign is data in no bus's words, and
//! this module shows it.

mod html;
mod report;

use super::{CaseFailure, OutcomeClass, PlayedCampaign};
use crate::report::html::Section;
use harness_proto::time::Instant;

/// From this gravity on a case stands among the worst.
const SERIOUS: u8 = 4;

/// A case that was played.
#[derive(Clone, Debug)]
pub struct LineOutcome {
    /// Its name, of place and fault.
    pub case: String,
    /// The frame or telegram, counted from 1.
    pub place: u64,
    pub fault: String,
    /// What was disturbed, as the bus writes it.
    pub disturbed: String,
    /// The class, as a place in the list of the campaign's classes.
    pub class: usize,
    /// What happened, in a line.
    pub happened: String,
    /// How each step ended.
    pub steps: Vec<String>,
    /// What the master reported besides.
    pub troubles: Vec<String>,
}

/// A campaign that was played.
#[derive(Clone, Debug)]
pub struct PlayedLine {
    pub name: String,
    /// The name of its bus.
    pub bus: &'static str,
    /// What it shows, in a line.
    pub title: String,
    /// What is disturbed, in the plural: frames or telegrams.
    pub units: &'static str,
    /// How many of them the conversation has without a fault.
    pub count: usize,
    /// The heading above what was disturbed.
    pub heading: &'static str,
    /// The classes, the least serious first.
    pub classes: &'static [OutcomeClass],
    /// The figures that its file pins: of a class, or of all `cases`.
    pub expect: Vec<(&'static str, u64)>,
    /// Every case, in order.
    pub outcomes: Vec<LineOutcome>,
}

impl PlayedLine {
    /// How many cases there are of the class at a place.
    #[must_use]
    pub fn count(&self, class: usize) -> u64 {
        let of_class = |outcome: &&LineOutcome| outcome.class == class;
        self.outcomes.iter().filter(of_class).count() as u64
    }

    /// The place of the class with this name.
    #[must_use]
    pub fn class(&self, name: &str) -> Option<usize> {
        self.classes.iter().position(|own| own.name == name)
    }

    /// The pinned figures that were not met: what is counted, expected, found.
    #[must_use]
    pub fn differs(&self) -> Vec<(&'static str, u64, u64)> {
        let found = |name: &str| match self.class(name) {
            Some(class) => self.count(class),
            None => self.outcomes.len() as u64,
        };
        let pinned = self.expect.iter();
        let compared = pinned.map(|(name, expected)| (*name, *expected, found(name)));
        compared
            .filter(|(_, expected, found)| expected != found)
            .collect()
    }

    fn of(&self, outcome: &LineOutcome) -> &'static OutcomeClass {
        &self.classes[outcome.class]
    }

    /// The serious cases, the worst class first.
    fn serious(&self) -> Vec<&LineOutcome> {
        let serious = |outcome: &&LineOutcome| self.of(outcome).gravity >= SERIOUS;
        let mut worst: Vec<_> = self.outcomes.iter().filter(serious).collect();
        worst.sort_by_key(|outcome| std::cmp::Reverse(outcome.class));
        worst
    }
}

impl PlayedCampaign for PlayedLine {
    fn name(&self) -> &str {
        &self.name
    }

    fn classes(&self) -> &'static [OutcomeClass] {
        self.classes
    }

    fn count(&self, class: usize) -> u64 {
        Self::count(self, class)
    }

    fn cases(&self) -> u64 {
        self.outcomes.len() as u64
    }

    fn differs(&self) -> Vec<(&'static str, u64, u64)> {
        Self::differs(self)
    }

    fn size(&self) -> [(String, u64); 2] {
        let (first, rest) = self.units.split_at(1);
        let units = first.to_uppercase() + rest;
        [("Drives".to_owned(), 1), (units, self.count as u64)]
    }

    fn table(&self) -> String {
        report::table(self)
    }

    fn lines(&self, class: usize) -> String {
        report::only(self, class)
    }

    fn json(&self, class: Option<usize>) -> serde_json::Value {
        report::json(self, class)
    }

    fn section(&self, number: usize) -> Section {
        html::section(number, self)
    }
}

/// The case of this name among those of a campaign.
///
/// # Errors
/// There is none.
pub fn case_of<C: Copy>(
    cases: &[C],
    name: &str,
    named: impl Fn(&C) -> String,
) -> Result<C, CaseFailure> {
    let found = cases.iter().find(|own| named(own) == name);
    found.copied().ok_or_else(|| {
        let such = cases.first().map(named).unwrap_or_default();
        CaseFailure::Unknown(format!(
            "there is no case `{name}`; a name that --format json lists expected, such as `{such}`"
        ))
    })
}

/// What stands in front of the steps of a case's scenario: its header lines and, as remarks, its class and what happened.
pub fn header_of_case(
    (campaign, case): (&str, &str),
    source_and_drive: &str,
    class: &OutcomeClass,
    happened: &str,
) -> String {
    let campaign = campaign.trim_end_matches(".toml");
    format!(
        "title   {case} of {campaign}\n{source_and_drive}\n# {}: {}\n# {happened}\n",
        class.name, class.about
    )
}

/// A time of a case, in milliseconds, as a scenario has it.
pub fn time_of_case(at: Instant) -> String {
    let nanos = at.since_start().as_nanos();
    match nanos % 1_000_000 {
        0 => format!("{}ms", nanos / 1_000_000),
        rest => format!("{}.{rest:06}ms", nanos / 1_000_000),
    }
}

/// Plays the scenario of a case, which a right drive must meet and which states its class: the text, and what the line carried.
#[cfg(any(test, feature = "trials"))]
pub fn replayed<L: crate::scenario::language::Language>(
    campaign: &dyn super::Campaign,
    case: &str,
    class: OutcomeClass,
) -> (String, harness_sim::record::Trace) {
    use crate::scenario::run::AtMismatch;
    use crate::scenario::settled::{BenchSize, settle};
    use crate::scenario::verdict::Verdict;
    let text = campaign.scenario(case).expect("a case");
    assert!(text.contains(&format!("\n# {}: ", class.name)), "{text}");
    let source = crate::scenario::source::Source {
        name: case.to_owned(),
        text: text.clone().into(),
    };
    let settled = settle::<L>(&source, BenchSize::Own);
    let (_, plan) = settled.unwrap_or_else(|problems| panic!("{text}\n{problems:?}"));
    let mut link = plan.simulate();
    let played = plan.play(&mut *link, AtMismatch::Stop);
    assert_eq!(played.verdict, Verdict::Passed, "{text}\n{played:?}");
    let trace = link.trace(0);
    (text, trace)
}
