//! What the buses try their campaigns with.

use super::disturbed::{Conversation, DisturbedLine, LineCampaign};
use super::line_names;
use crate::campaign::{Campaign as _, PlayedCampaign as _};
use crate::scenario::language::Language;
use crate::scenario::run::AtMismatch;
use crate::scenario::settled::{BenchSize, settle};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_sim::record::Trace;
use std::path::Path;

/// The page with the figures.
const PAGE: &str = include_str!("../../../../../corpora/campaigns/README.md");

/// The built-in campaigns of a bus, those with the fewest cases first.
pub fn built_in<L: DisturbedLine>() -> Vec<LineCampaign<L>> {
    let names = line_names::<L>();
    assert!(names.len() >= 2, "{names:?}");
    let read = |name: &String| LineCampaign::find(Path::new(name)).expect("it is there");
    let read = names.iter().map(|name| read(name).expect("it can be read"));
    let mut all: Vec<LineCampaign<L>> = read.collect();
    all.sort_by_key(|campaign| campaign.cases());
    all
}

/// Every class of these campaigns is pinned and met, and the page has the same figures.
pub fn have_the_figures_that_they_pin<L: DisturbedLine>(campaigns: &[LineCampaign<L>]) {
    let mut wrong = String::new();
    for campaign in campaigns {
        let (name, pinned) = (campaign.name(), campaign.pinned());
        let of = |name| pinned.iter().find(|(pinned, _)| *pinned == name);
        let of = |name| of(name).map(|(_, count)| *count);
        let classes = L::TABLE.classes;
        let figures = classes.map(|class| of(class.name).expect("every class is pinned"));
        let all = figures.iter().sum();
        assert_eq!(of("cases"), Some(all), "{name}");
        let played = campaign.played(1, &|_| {}).expect("every case");
        if !played.differs().is_empty() {
            wrong.push_str(&played.table());
        }
        let figures = figures.map(|figure| figure.to_string()).join(" | ");
        let row = format!("| `{name}` | {all} | {figures} |");
        if !PAGE.contains(&row) {
            wrong.push_str(&format!("corpora/campaigns/README.md: {row}\n"));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// One in `step` cases of each built-in campaign as a scenario, and every case of the class `always`: a right drive meets it, and
/// `carries_the_same` compares its text and what the line carried with the case.
pub fn cases_are_scenarios<L: DisturbedLine, W: Language>(
    step: usize,
    always: Option<&str>,
    carries_the_same: impl Fn(&str, &Trace, &Conversation<L>),
) {
    for campaign in built_in::<L>() {
        for (place, case) in campaign.cases.iter().enumerate() {
            if place % step > 0 && always.is_none() {
                continue;
            }
            let (class, played) = campaign.play(case).expect("played");
            let class = L::TABLE.classes[class].name;
            if place % step > 0 && always != Some(class) {
                continue;
            }
            let text = campaign.scenario(&case.0.name()).expect("a case");
            assert!(text.contains(&format!("\n# {class}: ")), "{text}");
            carries_the_same(&text, &replayed::<W>(&text), &played);
        }
        let why = campaign.scenario("0:lost").expect_err("there is none");
        let such = format!("such as `{}`", campaign.cases[0].0.name());
        assert!(format!("{why:?}").contains(&such), "{why:?}");
    }
}

/// Plays the scenario of a case, which a right drive must meet: what the line carried.
fn replayed<W: Language>(text: &str) -> Trace {
    let source = Source {
        name: "a case".to_owned(),
        text: text.to_owned().into(),
    };
    let settled = settle::<W>(&source, BenchSize::Own);
    let (_, plan) = settled.unwrap_or_else(|problems| panic!("{text}\n{problems:?}"));
    let mut link = plan.simulate();
    let played = plan.play(&mut *link, AtMismatch::Stop);
    assert_eq!(played.verdict, Verdict::Passed, "{text}\n{played:?}");
    link.trace(0)
}

/// The class of the only case of a file that has this name.
pub fn class<L: DisturbedLine>(text: &str, name: &str) -> &'static str {
    let campaign = LineCampaign::<L>::new("a", text).expect("a campaign");
    let mut found = campaign
        .cases
        .iter()
        .filter(|(case, _)| case.name() == name);
    let case = found.next().expect("a case of this name");
    assert!(found.next().is_none(), "{name}");
    L::TABLE.classes[campaign.play(case).expect("played").0].name
}

/// Each text has a mistake, which is named with its file.
pub fn mistakes_are_named<L: DisturbedLine>(mistakes: &[(String, &str)]) {
    for (text, says) in mistakes {
        let error = LineCampaign::<L>::new("a.toml", text).expect_err(says);
        let named = error.starts_with("a.toml: ") && error.contains(says);
        assert!(named, "{error}");
    }
}
