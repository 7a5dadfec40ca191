//! Campaigns on buses whose stations share one line: a conversation of the master with a drive, disturbed at every frame or telegram.
//!
//! What is disturbed, and which classes of outcomes there are, only the bus knows. What came of a campaign is data in no bus's words, and
//! this module shows it.

mod html;
mod report;

pub(crate) use html::section;
pub(crate) use report::{json, only, table};

use std::fmt::Debug;

/// A class of outcomes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineClass {
    /// Its name in files and tables.
    pub name: &'static str,
    /// What it means.
    pub about: &'static str,
    /// A letter, for readers who see no colours.
    pub letter: char,
    /// How serious it is, as pages count the classes of all campaigns: 0 to 6.
    pub gravity: u8,
}

/// From this gravity on a case stands among the worst.
const SERIOUS: u8 = 4;

/// A case that was played.
#[derive(Clone, Debug)]
pub struct LineOutcome {
    /// Its name, of place and fault.
    pub case: String,
    /// The frame or telegram, counted from 1.
    pub place: u64,
    /// The fault.
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
    /// Its name.
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
    pub classes: &'static [LineClass],
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

    fn of(&self, outcome: &LineOutcome) -> &'static LineClass {
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

/// A campaign that was read, and whose conversation was played without a fault.
pub trait LineCampaign: Debug {
    /// Its name, for messages: a path, or the name of a built-in one.
    fn name(&self) -> &str;

    /// How many cases it has.
    fn cases(&self) -> usize;

    /// Plays every case, in order; `progress` is called behind each.
    fn run(&self, progress: &dyn Fn(u64)) -> PlayedLine;
}
