//! Campaigns on buses whose stations share one line: a conversation of the master with a drive, disturbed at every frame or telegram.
//!
//! What is disturbed, and which classes of outcomes there are, only the bus knows: it implements [`DisturbedLine`]. What came of a campaign
//! is data in no bus's words, and this module shows it.

mod disturbed;
#[cfg(any(test, feature = "trials"))]
pub mod trials;

pub use disturbed::{
    Conversation, DisturbedLine, LineCampaign, LineKeys, LineTable, LineText, MasterPiece, found,
    line_names,
};

use super::played::{CampaignResult, PlayedCase};
use crate::html::Html;
use serde_json::{Value, json};

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
pub struct LineOutcome {
    case: LineCase,
    table: &'static LineTable,
    class: usize,
    happened: String,
    /// How each step ended.
    steps: Vec<String>,
    /// What the master reported besides.
    troubles: Vec<String>,
}

impl PlayedCase for LineOutcome {
    const SERIOUS: u8 = 4;
    const LETTERS: bool = true;

    fn class(&self) -> usize {
        self.class
    }

    fn name(&self) -> String {
        self.case.name()
    }

    fn disturbed(&self) -> Option<&str> {
        Some(&self.case.disturbed)
    }

    fn happened(&self) -> String {
        self.happened.clone()
    }

    fn json(&self) -> Value {
        let unit = self.table.units.trim_end_matches('s');
        json!({
            unit: self.case.disturbed, "steps": self.steps, "troubles": self.troubles,
        })
    }

    /// A row for each thing that was disturbed, a column a fault. Colours only repeat the letters.
    fn maps(played: &CampaignResult<Self>) -> Vec<(String, Html)> {
        let Some(first) = played.outcomes.first() else {
            return Vec::new();
        };
        let mut faults: Vec<&str> = Vec::new();
        for outcome in &played.outcomes {
            if !faults.contains(&outcome.case.fault.as_str()) {
                faults.push(&outcome.case.fault);
            }
        }
        let mut html = Html::new();
        html.element("table", &[], |html| {
            html.line("caption", &[], "The class of each case");
            let mut heads = vec!["Number", first.table.heading];
            heads.extend(&faults);
            html.heads(&heads);
            for row in played
                .outcomes
                .chunk_by(|a, b| a.case.place == b.case.place)
            {
                html.element("tr", &[], |html| {
                    html.line("th", &[("scope", &"row")], row[0].case.place);
                    html.line("td", &[], &row[0].case.disturbed);
                    for fault in &faults {
                        match row.iter().find(|outcome| outcome.case.fault == *fault) {
                            Some(outcome) => {
                                let class = played.of(outcome);
                                html.line("td", &[("class", &class.colour())], class.letter)
                            }
                            None => html.line("td", &[], ""),
                        }
                    }
                });
            }
        });
        let heading = format!("Where: faults across, {} down", played.units);
        vec![(heading, html)]
    }
}
