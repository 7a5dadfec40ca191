//! How telegrams of PROFIBUS read: a row a telegram, JSON, CSV, a capture, a picture.

pub(crate) mod csv;
pub(crate) mod curves;
pub(crate) mod diff;
pub(crate) mod json;
pub(crate) mod live;
pub(crate) mod pcapng;
pub(crate) mod sequence;
pub(crate) mod table;
mod vcd;
mod words;

pub(crate) use words::Reader;
pub(super) use words::{CONTROL, PRM};

use harness_bench::bus_name::BusName;
use harness_bench::capture::Capture;
use harness_bench::capture::runs::said;
use harness_bench::html::Html;
use harness_bench::shown::{
    FileForm, SegmentReport, ShownRun, TablePart, TraceView, drawn, no_form,
};
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::io::{Error, Write};

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
        [left, right]: [&Capture; 2],
        tolerance: Span,
        names: [&str; 2],
    ) -> (bool, String) {
        let found = diff::difference(&left.traces, &right.traces, tolerance);
        (found.is_none(), found.show(names))
    }

    fn rows(&self, trace: &Trace, part: &TablePart) -> String {
        table::table(trace, part.rows.clone(), part.at_most)
    }

    fn pictures(&self, view: &TraceView<'_>) -> Vec<(String, Html)> {
        let TraceView {
            trace, id, title, ..
        } = *view;
        drawn(
            |html| sequence::sequence(html, id, title, trace),
            |html| curves::curves(html, id, trace),
        )
    }

    fn write(&self, run: &ShownRun<'_>, form: FileForm, out: &mut dyn Write) -> Result<(), Error> {
        let traces = run.traces;
        match form {
            FileForm::Json => json::write(BusName::Nordac, traces, out),
            FileForm::Csv => csv::write(traces, out),
            FileForm::Pcapng => pcapng::write(traces, out),
            FileForm::Vcd(signals) => vcd::write(traces, signals, out),
            FileForm::Candump | FileForm::Svg(..) => Err(no_form(self.carries(), &form)),
        }
    }
}
