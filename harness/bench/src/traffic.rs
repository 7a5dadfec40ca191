//! How a bus whose stations share one line shows what was carried. A ring has tables and pictures of its own.

use crate::html::Html;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, Trace};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt::Debug;
use std::io::{Error, ErrorKind, Write};
use std::ops::Range;

/// A form in which the traffic of a shared line is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SharedForm {
    /// JSON for tools.
    Json,
    /// The log of candump.
    Candump,
    /// A row a frame or telegram, for spreadsheets.
    Csv,
    /// A capture for Wireshark.
    Pcapng,
}

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

    /// Compares two runs piece by piece: whether they are the same within the tolerance of times, and how they differ. `None` for a bus whose
    /// runs are compared frame by frame.
    fn difference(
        &self,
        sides: [&[Trace]; 2],
        tolerance: Span,
        names: [&str; 2],
    ) -> Option<(bool, String)> {
        let _not_compared = (sides, tolerance, names);
        None
    }

    /// A line of heads, and a row a frame or telegram: the rows that are wanted, counted from 0, and of them `at_most`.
    fn rows(&self, trace: &Trace, wanted: Option<Range<usize>>, at_most: Option<usize>) -> String;

    /// Pictures, each with its heading: what was said, and values against time. `id` names their parts.
    fn pictures(&self, trace: &Trace, id: &str, title: &str) -> Vec<(&'static str, Html)> {
        let _not_drawn = (trace, id, title);
        Vec::new()
    }

    /// Writes what was carried.
    ///
    /// # Errors
    /// Those of `out`, and [`ErrorKind::Unsupported`] for a form that the bus does not have.
    fn write(&self, traces: &[Trace], form: SharedForm, out: &mut dyn Write) -> Result<(), Error> {
        let _not_written = (traces, out);
        Err(no_form(self.carries(), form))
    }
}

/// The error of a bus that does not write a form.
pub fn no_form(carries: &str, form: SharedForm) -> Error {
    Error::new(
        ErrorKind::Unsupported,
        format!("{carries} are not written as {form:?}"),
    )
}

/// Two pictures: what was said, and values against time. Each function draws into a part of a page and returns whether it has drawn.
pub fn drawn(
    said: impl FnOnce(&mut Html) -> bool,
    values: impl FnOnce(&mut Html) -> bool,
) -> Vec<(&'static str, Html)> {
    let mut parts = Vec::new();
    let mut html = Html::new();
    if said(&mut html) {
        parts.push(("What was said", html));
    }
    let mut html = Html::new();
    if values(&mut html) {
        parts.push(("Values against time", html));
    }
    parts
}

/// The last rows of a table, at most `most` behind the line of heads: playing stops at the first line that is not met.
pub fn last_rows(report: &dyn SegmentReport, trace: &Trace, most: usize) -> String {
    let all = report.rows(trace, None, None);
    let lines: Vec<_> = all.lines().collect();
    let Some((head, rest)) = lines.split_first() else {
        return String::new();
    };
    let rest = &rest[rest.len().saturating_sub(most)..];
    let shown: Vec<_> = std::iter::once(*head).chain(rest.iter().copied()).collect();
    shown.join("\n") + "\n"
}

/// The bytes of every link in order of time; at one instant in order of links. Gives the link's place and the byte's.
pub fn in_time(links: &[Channel]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let first = links.iter().enumerate().filter_map(|(place, link)| {
        let byte = link.octets().first()?;
        Some(Reverse((byte.at, place, 0)))
    });
    let mut heap: BinaryHeap<Reverse<(Instant, usize, usize)>> = first.collect();
    std::iter::from_fn(move || {
        let mut top = heap.peek_mut()?;
        let Reverse((at, place, index)) = *top;
        match links[place].octets().get(index + 1) {
            // A capture may be out of order: then its own order counts.
            Some(next) => *top = Reverse((next.at.max(at), place, index + 1)),
            None => drop(std::collections::binary_heap::PeekMut::pop(top)),
        }
        Some((place, index))
    })
}
