//! How what a ring carried is shown.

use super::diagram::diagram;
use super::mismatch::mismatch;
use super::sequence::sequence;
use super::svg::{SvgOptions, svg};
use super::table::{LEGEND, table, wires};
use super::{csv, json, vcd};
use crate::capture::diff::{ComparedRun, diff};
use crate::locate::locate;
use harness_bench::capture::Capture;
use harness_bench::html::Html;
use harness_bench::report::html::FoldedPart;
use harness_bench::report::pcapng;
use harness_bench::scenario::run::Mismatch;
use harness_bench::shown::{FileForm, SegmentReport, ShownRun, TablePart, TraceView, no_form, see};
use harness_proto::time::Span;
use harness_sim::record::{LineByte, Trace};
use std::collections::BTreeMap;
use std::io::{Error, Write};

/// Lines about damaged bytes below a table.
const DAMAGED: usize = 20;

/// Tables and pictures with a column a drive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RingReport;

impl SegmentReport for RingReport {
    fn carries(&self) -> &'static str {
        "bytes of a ring"
    }

    fn difference(
        &self,
        [left, right]: [&Capture; 2],
        tolerance: Span,
        names: [&str; 2],
    ) -> (bool, String) {
        let side = |name, capture| ComparedRun { name, capture };
        let found = diff(side(names[0], left), side(names[1], right), tolerance);
        (found.same(), found.show(names[0], names[1]).to_string())
    }

    fn rows(&self, trace: &Trace, part: &TablePart) -> String {
        table(trace, part)
    }

    fn legend(&self) -> &'static str {
        LEGEND
    }

    fn damaged(&self, trace: &Trace) -> String {
        wires(trace, DAMAGED)
    }

    fn damaging_cables(&self, traces: &[Trace]) -> BTreeMap<String, usize> {
        damaging_cables(traces)
    }

    fn around(&self, finding: &Mismatch, traces: &[Trace], sources: &[String]) -> String {
        let bytes = mismatch(finding, traces, sources);
        match bytes.as_str() {
            "" => see(sources),
            bytes => format!("\n{bytes}"),
        }
    }

    fn pictures(&self, view: &TraceView<'_>) -> Vec<(String, Html)> {
        if view
            .trace
            .channels
            .iter()
            .all(|link| link.octets().is_empty())
        {
            return Vec::new();
        }
        let which = match view.one_of_two {
            true => format!(", ring {}", view.ring + 1),
            false => String::new(),
        };
        let mut html = Html::new();
        let title = format!("{}{which}", view.title);
        diagram(&mut html, view, &title);
        let mut parts = vec![(format!("Space-time diagram{which}"), html)];
        let mut html = Html::new();
        if sequence(&mut html, view.id, view.trace) {
            parts.push((format!("What was said{which}"), html));
        }
        parts
    }

    fn page_rows(&self, _: &Trace) -> Option<FoldedPart> {
        None
    }

    fn write(&self, run: &ShownRun<'_>, form: FileForm, out: &mut dyn Write) -> Result<(), Error> {
        match form {
            FileForm::Json => json::write(run.traces, run.records, out),
            FileForm::Csv => csv::write(run.traces, out),
            FileForm::Vcd(signals) => vcd::write(run.traces, run.rate, signals, out),
            FileForm::Pcapng => pcapng::write(run.traces, run.rate, out),
            FileForm::Svg(scale, rows) => {
                let options = SvgOptions {
                    title: run.title,
                    scale,
                    rate: run.rate,
                    rows,
                };
                out.write_all(svg(run.traces, &options).as_bytes())?;
                out.flush()
            }
            FileForm::Candump => Err(no_form(self.carries(), &form)),
        }
    }
}

/// Links on which bytes were damaged, or the drive that the ring spells out at the end.
fn damaging_cables(traces: &[Trace]) -> BTreeMap<String, usize> {
    let mut places = BTreeMap::new();
    for trace in traces {
        let bad = |byte: &&LineByte| byte.sent != byte.received || byte.error.is_some();
        let mut seen = false;
        for link in &trace.channels {
            let count = link.octets().iter().filter(bad).count();
            if count > 0 {
                *places.entry(cable(link.from, link.to)).or_default() += count;
                seen = true;
            }
        }
        let last = trace.channels.iter().find(|link| link.to.is_none());
        let heard = last.filter(|_| !seen).map(|link| {
            let arrived = link.octets().iter().filter_map(LineByte::arrival);
            arrived.collect::<Vec<_>>()
        });
        if let Some(found) = heard.and_then(|bytes| locate(&bytes, trace.stations)) {
            let before = found.drive.checked_add(1);
            let before = before.filter(|drive| *drive < trace.stations);
            *places.entry(cable(before, Some(found.drive))).or_default() += 1;
        }
    }
    places
}

/// A cable by its ends; `None` is the master.
fn cable(from: Option<u8>, to: Option<u8>) -> String {
    match (from, to) {
        (Some(from), Some(to)) => format!("the cable between drives {from} and {to}"),
        (Some(drive), None) | (None, Some(drive)) => {
            format!("the cable between the master and drive {drive}")
        }
        (None, None) => "the line".to_owned(),
    }
}
