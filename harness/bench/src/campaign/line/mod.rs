//! Campaigns on buses whose stations share one line: a conversation of the master with a drive, disturbed at every frame or telegram.
//!
//! What is disturbed, and which classes of outcomes there are, only the bus knows: it implements [`DisturbedLine`]. What came of a campaign
//! is data in no bus's words, and this module shows it.

mod disturbed;
mod html;
mod report;
#[cfg(any(test, feature = "trials"))]
pub mod trials;

pub use disturbed::{
    Conversation, DisturbedLine, LineCampaign, LineKeys, LineTable, LineText, MasterPiece, found,
    line_names,
};

use super::{OutcomeClass, PlayedCampaign};
use crate::report::html::Section;

/// The lowest gravity of the worst cases.
const SERIOUS: u8 = 4;

/// A fault at a frame or telegram, in words.
#[derive(Clone, Debug)]
pub struct LineCase {
    /// The frame or telegram, counted from 1.
    pub place: u64,
    pub fault: String,
    /// The fault and its place in a step of a scenario.
    pub step: String,
    /// What is disturbed, as the bus writes it.
    pub disturbed: String,
}

impl LineCase {
    /// Its name, of place and fault.
    fn name(&self) -> String {
        format!("{}:{}", self.place, self.fault)
    }
}

/// A case that was played.
#[derive(Clone, Debug)]
struct LineOutcome {
    case: LineCase,
    /// The class, as a place in the list of the campaign's classes.
    class: usize,
    /// What happened, in a line.
    happened: String,
    /// How each step ended.
    steps: Vec<String>,
    /// What the master reported besides.
    troubles: Vec<String>,
}

/// A campaign that was played.
struct PlayedLine {
    name: String,
    /// What it shows, in a line.
    title: String,
    table: &'static LineTable,
    /// How many frames or telegrams the conversation has without a fault.
    count: usize,
    /// The figures that its file pins: of a class, or of all `cases`.
    expect: Vec<(&'static str, u64)>,
    /// Every case, in order.
    outcomes: Vec<LineOutcome>,
}

impl PlayedLine {
    fn of(&self, outcome: &LineOutcome) -> &'static OutcomeClass {
        &self.table.classes[outcome.class]
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
        &self.table.classes
    }

    fn count(&self, class: usize) -> u64 {
        let of_class = |outcome: &&LineOutcome| outcome.class == class;
        self.outcomes.iter().filter(of_class).count() as u64
    }

    fn cases(&self) -> u64 {
        self.outcomes.len() as u64
    }

    fn pinned(&self) -> &[(&'static str, u64)] {
        &self.expect
    }

    fn size(&self) -> [(String, u64); 2] {
        let (first, rest) = self.table.units.split_at(1);
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
