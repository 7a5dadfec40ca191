//! How telegrams of PROFIBUS read: a row a telegram, JSON, CSV, a capture, a picture.

pub(crate) mod csv;
pub(crate) mod curves;
pub(crate) mod diff;
pub(crate) mod json;
pub(crate) mod live;
pub(crate) mod pcapng;
pub(crate) mod sequence;
pub(crate) mod table;
mod words;

pub(crate) use words::Reader;
pub(super) use words::{CONTROL, PRM};

use harness_bench::bus_name::BusName;
use harness_bench::capture::runs::said;
use harness_bench::html::Html;
use harness_bench::traffic::{SegmentReport, SharedForm, drawn, no_form};
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::io::{Error, Write};
use std::ops::Range;

/// How telegrams are shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TelegramReport;

impl SegmentReport for TelegramReport {
    fn carries(&self) -> &'static str {
        "telegrams of PROFIBUS"
    }

    fn counted(&self, traces: &[Trace]) -> (usize, &'static str) {
        let telegrams = traces.iter().map(|trace| said(trace).len());
        (telegrams.sum(), "telegram")
    }

    fn difference(
        &self,
        [left, right]: [&[Trace]; 2],
        tolerance: Span,
        names: [&str; 2],
    ) -> Option<(bool, String)> {
        let found = diff::difference(left, right, tolerance);
        Some((found.is_none(), found.show(names)))
    }

    fn rows(&self, trace: &Trace, wanted: Option<Range<usize>>, at_most: Option<usize>) -> String {
        table::table(trace, wanted, at_most)
    }

    fn pictures(&self, trace: &Trace, id: &str, title: &str) -> Vec<(&'static str, Html)> {
        drawn(
            |html| sequence::sequence(html, id, title, trace),
            |html| curves::curves(html, id, trace),
        )
    }

    fn write(&self, traces: &[Trace], form: SharedForm, out: &mut dyn Write) -> Result<(), Error> {
        match form {
            SharedForm::Json => json::write(BusName::Nordac, traces, out),
            SharedForm::Csv => csv::write(traces, out),
            SharedForm::Pcapng => pcapng::write(traces, out),
            SharedForm::Candump => Err(no_form(self.carries(), form)),
        }
    }
}
