//! What came of a campaign, for people and for tools, whatever its bus.

use super::share::{counts, gravity, table};
use super::{OutcomeClass, PlayedCampaign};
use crate::html::Html;
use crate::report::html::{FoldedPart, Section};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// How many of the worst cases a table shows.
const WORST: usize = 10;

/// How many of the worst cases a page shows.
const WORST_OF_A_PAGE: usize = 100;

/// How many cases a thread takes at once.
const BATCH: usize = 32;

/// A case that was played.
pub trait PlayedCase: Sized {
    /// The lowest gravity of the worst cases.
    const SERIOUS: u8;

    /// Whether a page explains the classes by letters of its own.
    const LETTERS: bool;

    /// The class, as a place in the list of the campaign's classes.
    fn class(&self) -> usize;

    /// Its name, by which it is played again.
    fn name(&self) -> String;

    /// What was disturbed, where its name does not say so.
    fn disturbed(&self) -> Option<&str>;

    /// What happened, in a line.
    fn happened(&self) -> String;

    /// What tools get beside its name and class.
    fn json(&self) -> Value;

    /// The maps of a page, each with its heading: which classes there are where.
    fn maps(played: &CampaignResult<Self>) -> Vec<(String, Html)>;

    /// Name, what was disturbed, and what happened.
    fn line(&self) -> String {
        let (name, happened) = (self.name(), self.happened());
        let line = match self.disturbed() {
            Some(disturbed) => format!("{name:20} {disturbed:22} {happened}"),
            None => format!("{name:28} {happened}"),
        };
        line.trim_end().to_owned()
    }
}

/// A campaign that was played.
#[derive(Clone, Debug)]
pub struct CampaignResult<C> {
    pub name: String,
    /// What it shows, in a line.
    pub title: String,
    /// The name of the scenario that is disturbed; `None` where the conversation stands in the campaign's file.
    pub scenario: Option<String>,
    pub drives: u8,
    /// How many bytes, frames or telegrams the conversation has without a fault.
    pub count: u64,
    /// What those are, in the plural.
    pub units: &'static str,
    /// The classes, the least serious first.
    pub classes: &'static [OutcomeClass],
    /// The figures that its file pins: of a class, or of all `cases`.
    pub expect: Vec<(&'static str, u64)>,
    /// What tools get of the whole campaign beside that.
    pub facts: Map<String, Value>,
    /// Every case, in order.
    pub outcomes: Vec<C>,
}

impl<C: PlayedCase> CampaignResult<C> {
    /// The class of a case.
    pub fn of(&self, outcome: &C) -> &'static OutcomeClass {
        &self.classes[outcome.class()]
    }

    /// How many drives it has, and how much is disturbed of what.
    fn about(&self) -> String {
        let s = if self.drives == 1 { "" } else { "s" };
        format!("{} drive{s}, {} {}", self.drives, self.count, self.units)
    }

    /// The serious cases, the worst class first.
    fn serious(&self) -> Vec<&C> {
        let serious = |outcome: &&C| self.of(outcome).gravity >= C::SERIOUS;
        let mut worst: Vec<_> = self.outcomes.iter().filter(serious).collect();
        worst.sort_by_key(|outcome| std::cmp::Reverse(outcome.class()));
        worst
    }

    fn of_class(&self, class: Option<usize>) -> impl Iterator<Item = &C> {
        let wanted = move |outcome: &&C| class.is_none_or(|class| outcome.class() == class);
        self.outcomes.iter().filter(wanted)
    }

    /// A case of the table, with its class.
    fn row(&self, outcome: &C) -> String {
        format!("{:18} {}\n", self.of(outcome).name, outcome.line())
    }

    fn worst(&self) -> Option<Html> {
        let worst = self.serious();
        let disturbed = worst.first()?.disturbed().is_some();
        let mut html = Html::new();
        html.element("table", &[], |html| {
            let caption = "The most serious cases, each with the command that plays it again";
            html.line("caption", &[], caption);
            let mut heads = vec!["Class", "Case", "What happened", "Reproduce with"];
            if disturbed {
                heads.insert(2, "Disturbed");
            }
            html.heads(&heads);
            for outcome in worst.into_iter().take(WORST_OF_A_PAGE) {
                let case = outcome.name();
                html.element("tr", &[], |html| {
                    html.line("td", &[], self.of(outcome).name);
                    html.line("th", &[("scope", &"row")], &case);
                    if let Some(disturbed) = outcome.disturbed() {
                        html.line("td", &[], disturbed);
                    }
                    html.line("td", &[], outcome.happened());
                    let again = format!("drivebench campaign {} --case '{case}'", self.name);
                    html.line("td", &[("class", &"n")], again);
                });
            }
        });
        Some(html)
    }
}

impl<C: PlayedCase> PlayedCampaign for CampaignResult<C> {
    fn name(&self) -> &str {
        &self.name
    }

    fn classes(&self) -> &'static [OutcomeClass] {
        self.classes
    }

    fn count(&self, class: usize) -> u64 {
        self.of_class(Some(class)).count() as u64
    }

    fn cases(&self) -> u64 {
        self.outcomes.len() as u64
    }

    fn pinned(&self) -> &[(&'static str, u64)] {
        &self.expect
    }

    fn size(&self) -> [(String, u64); 2] {
        let (first, rest) = self.units.split_at(1);
        let units = first.to_uppercase() + rest;
        [
            ("Drives".to_owned(), self.drives.into()),
            (units, self.count),
        ]
    }

    fn table(&self) -> String {
        let (name, title, all) = (&self.name, &self.title, self.outcomes.len());
        let scenario = self.scenario.as_ref();
        let of = scenario.map_or(String::new(), |scenario| format!(" of {scenario}"));
        let mut text = format!("{title}\n{name}: {all} cases; {}{of}\n\n", self.about());
        text += &counts(self);
        let worst = self.serious();
        if !worst.is_empty() {
            text.push_str("\n  the worst\n");
        }
        for outcome in worst.into_iter().take(WORST) {
            // Writing to a String cannot fail.
            let _infallible = write!(text, "  {}", self.row(outcome));
        }
        text
    }

    fn lines(&self, class: usize) -> String {
        let outcomes = self.of_class(Some(class));
        outcomes.map(|outcome| self.row(outcome)).collect()
    }

    fn json(&self, class: Option<usize>) -> Value {
        let case = |outcome: &C| {
            let mut case = outcome.json();
            case["case"] = json!(outcome.name());
            case["class"] = json!(self.of(outcome).name);
            case
        };
        let counts = self.classes.iter().enumerate();
        let counts =
            counts.map(|(place, class)| json!({ "class": class.name, "cases": self.count(place) }));
        let differs = self.differs().into_iter();
        let differs = differs.map(|(name, expected, found)| {
            let class = Some(name).filter(|name| *name != "cases");
            json!({ "class": class, "expected": expected, "found": found })
        });
        let mut all = json!({
            "name": self.name,
            "title": self.title,
            "drives": self.drives,
            self.units: self.count,
            "classes": counts.collect::<Vec<_>>(),
            "differs": differs.collect::<Vec<_>>(),
            "cases": self.of_class(class).map(case).collect::<Vec<_>>(),
        });
        for (name, value) in &self.facts {
            all[name] = value.clone();
        }
        if let Some(scenario) = &self.scenario {
            all["scenario"] = json!(scenario);
        }
        all
    }

    fn section(&self, number: usize) -> Section {
        let name = &self.name;
        let mut html = Html::new();
        html.line("p", &[], &self.title);
        let scenario = self.scenario.as_ref();
        let of = scenario.map_or(String::new(), |scenario| format!(" of {scenario}"));
        let (all, about) = (self.outcomes.len(), self.about());
        html.line("p", &[], format_args!("{all} cases{of}: {about}."));
        table(&mut html, self, C::LETTERS);
        let worst = self.worst().map(|html| ("The worst".to_owned(), html));
        let parts = C::maps(self).into_iter().chain(worst);
        let parts = parts.map(|(heading, html)| FoldedPart {
            heading,
            html,
            instead: format!("It is in: drivebench campaign {name} --format json"),
        });
        Section {
            heading: name.to_owned(),
            id: format!("s{number}"),
            gravity: gravity(self),
            html,
            parts: parts.collect(),
        }
    }
}

/// Plays every case on `threads` threads, each with a player of its own; `progress` is called with the number of cases done since its last
/// call. The outcomes are in the order of the cases, and do not depend on the number of threads.
///
/// # Errors
/// The first case, in order, that cannot be played.
pub fn each_on_threads<C: Sync, O: Send, E: Send, P: FnMut(&C) -> Result<O, E>>(
    cases: &[C],
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
    player: impl Fn() -> P + Sync,
) -> Result<Vec<O>, E> {
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let done = Mutex::new(Vec::with_capacity(cases.len() / BATCH + 1));
    let work = || {
        let mut play = player();
        while !failed.load(Ordering::Relaxed) {
            let first = next.fetch_add(BATCH, Ordering::Relaxed);
            let Some(rest) = cases.get(first..).filter(|rest| !rest.is_empty()) else {
                return;
            };
            let batch = rest.iter().take(BATCH);
            let outcomes: Vec<_> = batch.map(&mut play).collect();
            if outcomes.iter().any(Result::is_err) {
                failed.store(true, Ordering::Relaxed);
            }
            progress(outcomes.len() as u64);
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            done.push((first, outcomes));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.max(1) {
            scope.spawn(work);
        }
        work();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(first, _)| *first);
    done.into_iter()
        .flat_map(|(_, outcomes)| outcomes)
        .collect()
}
