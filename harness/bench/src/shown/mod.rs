//! How a bus shows what was carried, and the page of a run.
//!
//! | file | what it makes |
//! |---|---|
//! | `summary.rs` | the verdicts of a run in a table |
//! | `scenario.rs` | the section of a scenario: verdict, section of the manual, expected beside received |

mod scenario;
mod summary;

pub use scenario::{ScenarioView, section};
pub use summary::{Head, ShownScenario, colour, run};

use crate::capture::Capture;
use crate::capture::frame_diff::frame_diff;
use crate::html::Html;
use crate::report::html::FoldedPart;
use crate::report::vcd::Signals;
use crate::scenario::run::{CellRecord, Mismatch};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::collections::BTreeMap;
use std::fmt::{Debug, Write as _};
use std::io::{Error, ErrorKind, Write};
use std::ops::Range;

/// A form in which traffic is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileForm {
    /// JSON for tools.
    Json,
    /// The log of candump.
    Candump,
    /// A row a frame, telegram or byte, for spreadsheets.
    Csv,
    /// A capture for Wireshark.
    Pcapng,
    /// The lines bit by bit.
    Vcd(Signals),
    /// A picture of these rows, counted from 0; of all where `None`.
    Svg(RowPlacing, Option<Range<usize>>),
}

impl FileForm {
    const fn name(&self) -> &'static str {
        match self {
            Self::Json => "JSON",
            Self::Candump => "a log of candump",
            Self::Csv => "CSV",
            Self::Pcapng => "pcapng",
            Self::Vcd(_) => "VCD",
            Self::Svg(..) => "SVG",
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowPlacing {
    /// Row n is the n-th byte of each link.
    #[default]
    Index,
    /// A byte is placed at its time.
    Time,
}

/// What part of a table is wanted.
#[derive(Clone, Debug, Default)]
pub struct TablePart {
    /// The rows, counted from 0; all where `None`.
    pub rows: Option<Range<usize>>,
    /// The row to point at, counted from 0; what the master received there is shown in brackets.
    pub pointed: Option<usize>,
    /// Maximum number of rows; the middle of a longer table is omitted.
    pub at_most: Option<usize>,
    /// Maximum number of columns; the middle of a wider table is omitted.
    pub columns_at_most: Option<usize>,
}

/// A run that is to be shown.
#[derive(Clone, Copy, Debug)]
pub struct ShownRun<'s> {
    pub title: &'s str,
    pub traces: &'s [Trace],
    pub records: &'s [CellRecord],
    /// The rate of a ring's line.
    pub rate: Rate,
}

/// One trace of a run, on a page.
#[derive(Clone, Copy, Debug)]
pub struct TraceView<'s> {
    pub trace: &'s Trace,
    /// Which one, counted from 0, and whether there are others.
    pub ring: usize,
    pub one_of_two: bool,
    /// Names the parts of its pictures.
    pub id: &'s str,
    pub title: &'s str,
    /// The rate of a ring's line.
    pub rate: Rate,
    /// The first byte that differs, as the master received it, counted from 1.
    pub differs: Option<usize>,
}

/// Maximum number of rows before the one that differs.
const BEFORE: usize = 12;

/// Rows of a table on a page, at most.
const PAGE_ROWS: usize = 2_000;

/// Tables, pictures and files of one bus. The table is all that a new bus must have.
pub trait SegmentReport: Debug + Sync {
    /// What the bus carries, such as `frames of CAN`.
    fn carries(&self) -> &'static str;

    /// How many pieces there are, and what one is called. By default frames are counted.
    fn counted(&self, traces: &[Trace]) -> (usize, &'static str) {
        let channels = traces.iter().flat_map(|trace| &trace.channels);
        (
            channels.map(|channel| channel.frames().len()).sum(),
            "frame",
        )
    }

    /// Compares two runs piece by piece: whether they are the same within the tolerance of times, and how they differ. By default frames are
    /// compared.
    fn difference(
        &self,
        [left, right]: [&Capture; 2],
        tolerance: Span,
        names: [&str; 2],
    ) -> (bool, String) {
        let found = frame_diff(left, right, tolerance);
        (found.same(), found.show(names))
    }

    /// A line of heads, and a row a frame, a telegram or a byte time.
    fn rows(&self, trace: &Trace, part: &TablePart) -> String;

    /// What the signs in the rows mean; empty where there are none.
    fn legend(&self) -> &'static str {
        ""
    }

    /// What arrived damaged, a line each.
    fn damaged(&self, trace: &Trace) -> String {
        let _nothing = trace;
        String::new()
    }

    /// Cables that damaged bytes though the scenario damages none, and how often.
    fn damaging_cables(&self, traces: &[Trace]) -> BTreeMap<String, usize> {
        let _unknown = traces;
        BTreeMap::new()
    }

    /// The part of the table that a finding is about, after an empty line, and the sections that say what is right.
    fn around(&self, finding: &Mismatch, traces: &[Trace], sources: &[String]) -> String {
        let _all_of_the_end = finding;
        let mut text = String::new();
        for trace in traces {
            // Writing to a String cannot fail.
            let _infallible = write!(text, "\n{}", self.last_rows(trace, BEFORE));
        }
        text + &see(sources)
    }

    /// The last rows of a table, at most `most` after the line of heads: playing stops at the first line that is not met.
    fn last_rows(&self, trace: &Trace, most: usize) -> String {
        let all = self.rows(trace, &TablePart::default());
        let lines: Vec<_> = all.lines().collect();
        let Some((head, rest)) = lines.split_first() else {
            return String::new();
        };
        let rest = &rest[rest.len().saturating_sub(most)..];
        let shown: Vec<_> = std::iter::once(*head).chain(rest.iter().copied()).collect();
        shown.join("\n") + "\n"
    }

    /// Pictures, each with its heading: what was said, and values against time.
    fn pictures(&self, view: &TraceView<'_>) -> Vec<(String, Html)> {
        let _not_drawn = view;
        Vec::new()
    }

    /// The rows as a part of a page; `None` where the pictures show them.
    fn page_rows(&self, trace: &Trace) -> Option<FoldedPart> {
        let part = TablePart {
            at_most: Some(PAGE_ROWS),
            ..TablePart::default()
        };
        let rows = self.rows(trace, &part);
        let mut html = Html::new();
        html.element("pre", &[], |html| html.line("code", &[], rows));
        Some(FoldedPart {
            heading: "Frames".to_owned(),
            html,
            instead: String::new(),
        })
    }

    /// Writes what was carried.
    ///
    /// # Errors
    /// Writing to `out` fails, or [`ErrorKind::Unsupported`] for a form that the bus does not have.
    fn write(&self, run: &ShownRun<'_>, form: FileForm, out: &mut dyn Write) -> Result<(), Error> {
        let _not_written = (run, out);
        Err(no_form(self.carries(), &form))
    }
}

/// A line with the sections of the manual; empty where there is none.
pub fn see(sources: &[String]) -> String {
    match sources {
        [] => String::new(),
        sources => format!("see {}\n", sources.join(", ")),
    }
}

/// The error of a bus that does not write a form.
pub fn no_form(carries: &str, form: &FileForm) -> Error {
    Error::new(
        ErrorKind::Unsupported,
        format!("{carries} are not written as {}", form.name()),
    )
}

/// Two pictures: what was said, and values against time. Each function draws into a part of a page and returns whether it has drawn.
pub fn drawn(
    said: impl FnOnce(&mut Html) -> bool,
    values: impl FnOnce(&mut Html) -> bool,
) -> Vec<(String, Html)> {
    let mut parts = Vec::new();
    let mut html = Html::new();
    if said(&mut html) {
        parts.push(("What was said".to_owned(), html));
    }
    let mut html = Html::new();
    if values(&mut html) {
        parts.push(("Values against time".to_owned(), html));
    }
    parts
}
