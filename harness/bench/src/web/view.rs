//! What a bench shows on its page, in words and numbers of no bus: columns, rows and places for faults.

use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Rows of the picture in one [`LiveNews`] at most.
pub const MAX_ROWS: usize = 400;
/// Cells of these rows at most.
pub const MAX_CELLS: usize = 12_000;

/// What does not change while a page is open.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveScene {
    /// What the bench is: `3 drives, 38400 bit/s`.
    pub title: String,
    /// Heads of the table of stations.
    pub stations: Vec<&'static str>,
    /// Heads of the table of traffic.
    pub traffic: Vec<&'static str>,
    /// The picture; `None` where the bench shows only tables.
    pub picture: Option<LivePicture>,
    /// Where a fault can happen.
    pub places: Vec<FaultPlace>,
    /// The faults, in words.
    pub faults: Vec<&'static str>,
    /// What the bench can play by itself, in words.
    pub scripts: Vec<String>,
    /// Why the page is read-only, if it is.
    pub read_only: Option<String>,
}

/// The picture of what the bus carries: time goes down.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LivePicture {
    pub heading: &'static str,
    /// How it is read, in some sentences.
    pub note: &'static str,
    pub columns: Vec<String>,
    /// What a row represents where rows are [folded](LiveRow::fold): singular and plural.
    pub folded: [&'static str; 2],
    /// The classes of cells and what they mean.
    pub legend: Vec<(char, &'static str)>,
}

/// The legend of a picture of [arrows](LiveRow::arrow).
pub const ARROWS: [(char, &str); 3] = [
    ('a', "\u{25CF} the sender"),
    ('b', "\u{25B6} the receiver"),
    ('x', "\u{2715} no receiver has it, or not as it was sent"),
];

/// A place for faults: a button of the page.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FaultPlace {
    pub name: String,
    /// The column whose head is the button; `None` for a button above the picture.
    pub column: Option<usize>,
}

/// What has happened since the last time.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveNews {
    /// The time of the bench.
    pub at: String,
    /// Whether a master other than the bench is connected.
    pub master: bool,
    /// The rows of the table of stations.
    pub stations: Vec<Vec<String>>,
    /// The rows of the table of traffic.
    pub traffic: Vec<Vec<String>>,
    /// The newest rows of the picture, at most [`MAX_ROWS`].
    pub rows: Vec<LiveRow>,
    /// Number of rows before them that are omitted.
    pub left_out: u64,
    /// What a reader of the bus concludes, in sentences.
    pub notes: Vec<String>,
}

/// A row of the picture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveRow {
    pub at: String,
    /// The cells of its columns.
    pub cells: Vec<LiveCell>,
    /// What it means; may be empty.
    pub words: String,
    /// Number of equal rows that it represents, described by `words`; 0 for a single row. Their cells are not drawn.
    pub fold: u64,
}

impl LiveRow {
    /// The column of the station that sends, in a row of a shared line.
    pub fn sender(&self) -> Option<usize> {
        let sender = self.cells.iter().find(|cell| cell.2 == ARROWS[0].0);
        sender.map(|cell| cell.0)
    }

    /// Whether no receiver has what a row of a shared line shows, or not as it was sent.
    pub fn is_damaged(&self) -> bool {
        self.cells.iter().any(|cell| cell.2 == ARROWS[2].0)
    }

    /// A row of a shared line: what one station sends goes to another, or to all where `to` is `None`. There are `columns` stations.
    pub fn arrow(
        columns: usize,
        (from, to): (usize, Option<usize>),
        arrived: bool,
        at: String,
        words: String,
    ) -> Self {
        let head = if arrived { 'b' } else { 'x' };
        let ends = match to {
            Some(to) => from.min(to)..=from.max(to),
            None => 0..=columns.saturating_sub(1),
        };
        let cell = |column: usize| {
            let is_end = to.is_none_or(|to| to == column);
            match column.cmp(&from) {
                Ordering::Equal => LiveCell(column, "\u{25CF}".to_owned(), 'a'),
                _ if !is_end => LiveCell(column, String::new(), 'w'),
                _ if !arrived => LiveCell(column, "\u{2715}".to_owned(), head),
                Ordering::Less => LiveCell(column, "\u{25C0}".to_owned(), head),
                Ordering::Greater => LiveCell(column, "\u{25B6}".to_owned(), head),
            }
        };
        Self {
            at,
            cells: ends.map(cell).collect(),
            words,
            fold: 0,
        }
    }
}

/// A cell of the picture: its column, its text, and its class, a letter of the legend or a blank.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LiveCell(pub usize, pub String, pub char);

/// An order of a page, by numbers of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum LiveOrder {
    Fault {
        place: usize,
        fault: usize,
    },
    /// A conversation of the bench's own.
    Play {
        script: usize,
    },
}

/// A bench that shows itself on a page.
pub trait LiveView {
    /// What does not change.
    fn scene(&self) -> LiveScene;

    /// Begins to record what the page shows, or ends it.
    fn watch(&mut self, on: bool);

    /// What has happened since the last call.
    fn news(&mut self) -> LiveNews;

    /// Executes an order of a page. Returns what was done, in a sentence.
    ///
    /// # Errors
    /// It cannot be done now, in a sentence with the remedy.
    fn order(&mut self, order: LiveOrder) -> Result<String, String>;
}
