//! Recorded cells against time: a curve each, one below the other over the same times.

use crate::html::Html;
use crate::report::chart::{Chart, Curve};
use crate::scenario::quantity::figures;
use crate::scenario::run::{CellRecord, Sample};
use harness_proto::nd21::bits;

/// Records shown at most.
const MOST: usize = 40;

/// Rows of a table of samples at most; of a longer one every n-th is shown.
const ROWS: usize = 100;

pub(crate) fn lines(html: &mut Html, id: &str, records: &[CellRecord]) {
    let times = records.iter().flat_map(|record| &record.samples);
    let ends = times.fold(None, |ends: Option<(f64, f64)>, sample| {
        let at = ms(sample);
        Some(ends.map_or((at, at), |(from, to)| (from.min(at), to.max(at))))
    });
    for (number, record) in records.iter().enumerate().take(MOST) {
        let ring = if record.ring == 0 { "" } else { "2:" };
        let unit = record.unit();
        let title = match unit {
            "" => format!("drive {ring}{} {}", record.drive, record.name),
            unit => format!("drive {ring}{} {} in {unit}", record.drive, record.name),
        };
        html.element("figure", &[], |html| {
            html.line("figcaption", &[], &title);
            let curves = [curve(record)];
            match curves[0].known().next().is_some() {
                true => Chart {
                    id: &format!("{id}-r{number}"),
                    title: &format!("{title} against time"),
                    ends,
                    curves: &curves,
                    ..Chart::default()
                }
                .draw(html),
                false => html.line("p", &[], "Nothing was seen."),
            }
            table(html, record);
        });
    }
    if records.len() > MOST {
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{} more are not shown.", records.len() - MOST),
        );
    }
}

/// A record as a curve.
pub(crate) fn curve(record: &CellRecord) -> Curve {
    let ring = if record.ring == 0 { "" } else { "2:" };
    let samples = record.samples.iter();
    Curve {
        name: format!("{ring}{} {}", record.drive, record.name),
        unit: record.unit().to_owned(),
        held: record.every.is_none(),
        points: samples
            .map(|sample| (ms(sample), record.value(sample)))
            .collect(),
        ..Curve::default()
    }
}

fn ms(sample: &Sample) -> f64 {
    sample.at.since_start().as_millis_f64()
}

fn table(html: &mut Html, record: &CellRecord) {
    let samples = &record.samples;
    if samples.is_empty() {
        return;
    }
    let every = samples.len().div_ceil(ROWS);
    html.element("details", &[], |html| {
        html.line("summary", &[], "Its values");
        html.element("table", &[], |html| {
            let caption = match (record.every, every) {
                (None, 1) => "Changes".to_owned(),
                (Some(interval), 1) => format!("Samples, every {interval}"),
                (_, every) => format!("{} samples, one of {every} shown", samples.len()),
            };
            html.line("caption", &[], caption);
            html.heads(&["Time", "Bytes", "Value", "Bits"]);
            for sample in samples.iter().step_by(every) {
                html.element("tr", &[], |html| {
                    html.line("td", &[("class", &"n")], sample.at);
                    html.line("td", &[("class", &"n")], CellRecord::raw(sample));
                    let value = record.value(sample).map_or_else(
                        || "-".to_owned(),
                        |value| format!("{} {}", figures(value, record.unit()), record.unit()),
                    );
                    html.line("td", &[("class", &"n")], value.trim_end());
                    let names: Vec<_> = match sample.bytes() {
                        [byte] => bits::set_in(record.address, *byte).collect(),
                        _ => Vec::new(),
                    };
                    html.line("td", &[], names.join(", "));
                });
            }
        });
    });
}
