//! Campaigns: one conversation, disturbed at every place and in every way or at a sample of them, and the outcomes.
//!
//! Here is what campaigns of all buses have in common. The folder of a bus says how a case is played and what its outcomes are.

pub mod counts;
pub mod line;
mod page;
pub mod pairs;
pub mod played;
pub mod share;

pub use page::page;

use crate::report::html::Section;
use crate::scenario::problem::Problems;
use include_dir::Dir;
use pairs::FaultPairs;
use std::fmt::Debug;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutcomeClass {
    /// Its name in files and tables.
    pub name: &'static str,
    pub about: &'static str,
    /// A letter, for readers who see no colours.
    pub letter: char,
    /// How serious it is, as pages count the classes of all campaigns: 0 to 6.
    pub gravity: u8,
}

impl OutcomeClass {
    /// The class of its colour in pages.
    #[must_use]
    pub fn colour(&self) -> String {
        format!("k{}", self.gravity)
    }
}

/// A campaign that was read, and whose conversation was played without a fault.
pub trait Campaign: Debug {
    /// Its name, for messages: a path, or the name of a built-in one.
    fn name(&self) -> &str;

    /// The texts of its file, and of its scenario where that is one of its own.
    fn texts(&self) -> Vec<&str>;

    /// The names of its cases, in order.
    fn names(&self) -> Vec<String>;

    /// The figures that its file pins: of a class, or of all `cases`.
    fn pinned(&self) -> Vec<(&'static str, u64)>;

    /// Keeps only the cases at the places for which this is true, and no pinned figure, as these are of all cases.
    fn keep(&mut self, at: &dyn Fn(usize) -> bool);

    /// How many cases it has.
    fn cases(&self) -> usize;

    /// The scenario that replays the case of this name.
    ///
    /// # Errors
    /// There is no such case, in a sentence with the remedy; or it is a defect of the bench.
    fn scenario(&self, case: &str) -> Result<String, CaseFailure>;

    /// Plays every case, in order, on up to `threads` threads; `progress` is called with the number of cases done since its last call.
    ///
    /// # Errors
    /// A case fits no class: a defect of the bench, in a sentence.
    fn run(
        &self,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Box<dyn PlayedCampaign>, String>;

    /// Pairs of its cases; `None` for a bus of which they are not played.
    fn pairs(&self) -> Option<&dyn FaultPairs> {
        None
    }
}

/// What is wrong with a campaign.
#[derive(Debug)]
pub enum CampaignError {
    /// In a sentence with file, place and remedy.
    Said(String),
    /// Its file or its scenario has mistakes.
    Mistakes(Box<Problems>),
}

/// Why a case cannot be replayed, in a sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CaseFailure {
    /// There is no such case.
    Unknown(String),
    /// It fits no class.
    Defect(String),
}

/// A campaign that was played.
pub trait PlayedCampaign {
    fn name(&self) -> &str;

    /// The classes, the least serious first.
    fn classes(&self) -> &'static [OutcomeClass];

    /// How many cases there are of the class at a place.
    fn count(&self, class: usize) -> u64;

    /// How many cases there are.
    fn cases(&self) -> u64;

    /// The figures that its file pins: of a class, or of all `cases`.
    fn pinned(&self) -> &[(&'static str, u64)];

    /// The pinned figures that were not met: what is counted, expected, found.
    fn differs(&self) -> Vec<(&'static str, u64, u64)> {
        let place = |name: &str| self.classes().iter().position(|class| class.name == name);
        let found = |name: &str| place(name).map_or(self.cases(), |place| self.count(place));
        let pinned = self.pinned().iter();
        let compared = pinned.map(|(name, expected)| (*name, *expected, found(name)));
        compared
            .filter(|(_, expected, found)| expected != found)
            .collect()
    }

    /// How many drives it has, and how much is disturbed, each with its heading.
    fn size(&self) -> [(String, u64); 2];

    /// How many cases there are of each class, what differs from the file, and the worst cases.
    fn table(&self) -> String;

    /// The cases of a class, one a line.
    fn lines(&self, class: usize) -> String;

    /// The campaign for tools; with `only`, the cases of that class alone.
    fn json(&self, class: Option<usize>) -> serde_json::Value;

    /// A section of a page; `number` counts its sections from 1.
    fn section(&self, number: usize) -> Section;
}

/// The place of the class with this name.
pub fn class_of(played: &dyn PlayedCampaign, name: &str) -> Option<usize> {
    played.classes().iter().position(|class| class.name == name)
}

/// The names of built-in campaigns, in order: `prefix` and the name of the file.
pub fn names(built_in: &Dir<'_>, prefix: &str) -> Vec<String> {
    let paths = built_in.files().map(|file| file.path());
    let bare = paths.filter_map(|path| path.to_str()?.strip_suffix(".toml"));
    let mut names: Vec<_> = bare.map(|name| format!("{prefix}{name}")).collect();
    names.sort_unstable();
    names
}
