//! What is read of a bench, and how its bus wants it to be shown.

use harness_proto::time::Span;
use std::collections::BTreeMap;

/// Maximum number of kinds of events listed; further kinds are only counted.
const MOST_KINDS: usize = 64;

/// How drives of a bus are shown.
#[derive(Debug, PartialEq, Eq)]
pub struct TopForm {
    /// What a drive is called, in the singular.
    pub drive: &'static str,
    /// The columns of the table. The first has the name of the drive, and the last takes the width that is left.
    pub columns: &'static [TopColumn],
    /// The columns that a narrow terminal leaves out, by their places, in this order.
    pub give_way: &'static [usize],
    /// The states that a drive can be in, the most serious one first.
    pub states: &'static [&'static str],
}

/// A column of the table.
#[derive(Debug, PartialEq, Eq)]
pub struct TopColumn {
    /// Its heading, with the unit.
    pub head: &'static str,
    /// Its least width, in characters.
    pub width: usize,
    /// Whether it has words, aligned left, and not numbers.
    pub has_words: bool,
}

/// The heading of the page, which does not change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heading {
    /// The bench's name.
    pub rig: String,
    /// How its drives are shown.
    pub form: &'static TopForm,
    /// What each of its rings or ports is: `ring 1: 3 drives, serial /dev/ttyUSB0, 38400 8O1`.
    pub parts: Vec<String>,
}

/// A line above the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeadLine {
    pub text: String,
    /// Whether it is about an error.
    pub is_error: bool,
}

/// What a drive showed last.
#[derive(Clone, Debug, PartialEq)]
pub struct TopRow {
    /// Its state, by the place in [`TopForm::states`].
    pub state: usize,
    /// Whether it is in error.
    pub in_error: bool,
    /// Its actual speed, in a unit that all drives of the bench share.
    pub speed: Option<f64>,
    /// The code of its error, if it shows one.
    pub error: Option<u32>,
    /// The texts of the columns.
    pub cells: Vec<String>,
}

/// Something that happened on the bench.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopEvent {
    pub what: String,
    /// Whether it is an error.
    pub is_error: bool,
    pub count: u64,
    pub last: Span,
}

/// Everything that was read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// How long the view has been on.
    pub at: Span,
    /// What was read of each part of the heading. Lines of a part that the heading does not have come last.
    pub parts: Vec<Vec<HeadLine>>,
    /// The drives that have been read, by their places on the bench.
    pub drives: BTreeMap<usize, TopRow>,
    /// What happened, in the order of its first time.
    pub events: Vec<TopEvent>,
    /// Events of kinds for which there was no more room.
    pub others: u64,
}

impl TopForm {
    /// The headings of the columns.
    #[must_use]
    pub fn heads(&self) -> Vec<&'static str> {
        self.columns.iter().map(|column| column.head).collect()
    }

    /// The place of a state; the most serious one for a state that is not in the list.
    #[must_use]
    pub fn state(&self, name: &str) -> usize {
        let place = self.states.iter().position(|state| *state == name);
        place.unwrap_or(0)
    }
}

impl TopColumn {
    /// A column of words.
    #[must_use]
    pub const fn words(head: &'static str, width: usize) -> Self {
        Self {
            head,
            width,
            has_words: true,
        }
    }

    /// A column of numbers.
    #[must_use]
    pub const fn numbers(head: &'static str, width: usize) -> Self {
        Self {
            head,
            width,
            has_words: false,
        }
    }
}

impl HeadLine {
    /// A line about no error.
    #[must_use]
    pub const fn plain(text: String) -> Self {
        Self {
            text,
            is_error: false,
        }
    }
}

impl Snapshot {
    /// Notes at [`Self::at`] that something was disturbed or failed.
    pub fn disturbed(&mut self, what: String) {
        self.happened(what, true);
    }

    /// Notes at [`Self::at`] that something was done.
    pub fn done(&mut self, what: String) {
        self.happened(what, false);
    }

    fn happened(&mut self, what: String, is_error: bool) {
        let last = self.at;
        if let Some(known) = self.events.iter_mut().find(|known| known.what == what) {
            known.count += 1;
            known.last = last;
        } else if self.events.len() < MOST_KINDS {
            self.events.push(TopEvent {
                what,
                is_error,
                count: 1,
                last,
            });
        } else {
            self.others += 1;
        }
    }
}
