//! A record of a cell for people: sampled values as a plot of plain characters, changes as a table.
//!
//! ```text
//! drive 0 nist, every 10.000 ms
//!  1500.1 rpm |      ******
//!             |    **
//!             |  **
//!           0 |**
//!             +------------
//!              0.000 ms    110.000 ms
//! ```

use crate::scenario::quantity::figures;
use crate::scenario::run::{CellRecord, Sample};
use harness_proto::nd21::bits;
use std::fmt::Write as _;

/// Columns of a whole plot at most, its labels included.
const WIDTH: usize = 100;

/// Rows of the curve at most: with the heading, the axis and the times a plot has 20.
const ROWS: usize = 17;

/// Maximum number of changes shown; the middle of a longer table is omitted.
const CHANGES: usize = 60;

/// A record as text; empty if nothing was seen.
#[must_use]
pub fn plot(record: &CellRecord) -> String {
    let prefix = if record.ring == 0 { "" } else { "2:" };
    let name = format!("drive {prefix}{} {}", record.drive, record.name);
    match record.every {
        Some(every) => format!("{name}, every {every}\n{}", curve(record)),
        None => format!("{name}, changes\n{}", table(record)),
    }
}

/// All records of a run, each after an empty line.
#[must_use]
pub fn plots(records: &[CellRecord]) -> String {
    records
        .iter()
        .map(|record| format!("\n{}", plot(record)))
        .collect()
}

fn curve(record: &CellRecord) -> String {
    let values: Vec<_> = record
        .samples
        .iter()
        .map(|sample| record.value(sample))
        .collect();
    let known = values.iter().flatten().copied();
    let (least, most) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| {
        (a.min(value), b.max(value))
    });
    let (Some(first), Some(last)) = (record.samples.first(), record.samples.last()) else {
        return "  nothing was seen\n".to_owned();
    };
    if least > most {
        return "  the manual gives no meaning to what was found\n".to_owned();
    }
    let flat = least >= most;
    let rows = if flat { 1 } else { ROWS };
    let label = |value: f64| format!("{} {}", figures(value, record.unit()), record.unit());
    let labels = [label(most), label(least)].map(|label| label.trim_end().to_owned());
    let wide = labels.iter().map(|label| label.chars().count()).max();
    let margin = wide.unwrap_or(0) + 2;
    let columns = values.len().min(WIDTH - margin - 2);
    let row = |value: f64| {
        let part = if flat {
            0.0
        } else {
            (most - value) / (most - least)
        };
        round(part * (rows - 1) as f64)
    };
    // Every column shows all that its samples went through.
    let spans: Vec<_> = (0..columns)
        .map(|column| {
            let from = column * values.len() / columns;
            let to = (column + 1) * values.len() / columns;
            let rows = values[from..to].iter().flatten().map(|value| row(*value));
            rows.fold(None, |span: Option<(usize, usize)>, row| {
                Some(span.map_or((row, row), |(a, b)| (a.min(row), b.max(row))))
            })
        })
        .collect();
    let mut out = String::new();
    // Writing to a String cannot fail.
    for row in 0..rows {
        let label = match row {
            0 => &labels[0],
            _ if row + 1 == rows => &labels[1],
            _ => "",
        };
        let line: String = spans
            .iter()
            .map(|span| match span {
                Some((from, to)) if (*from..=*to).contains(&row) => '*',
                _ => ' ',
            })
            .collect();
        let _infallible = writeln!(out, "{label:>margin$} |{}", line.trim_end());
    }
    let _infallible = writeln!(out, "{:margin$} +{}", "", "-".repeat(columns));
    let (from, to) = (first.at.to_string(), last.at.to_string());
    let gap = columns.saturating_sub(from.len() + to.len()).max(2);
    let _infallible = writeln!(out, "{:margin$}  {from}{}{to}", "", " ".repeat(gap));
    out
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a row of a plot, from 0 on"
)]
fn round(row: f64) -> usize {
    row.round() as usize
}

fn table(record: &CellRecord) -> String {
    let changes = &record.samples;
    if changes.is_empty() {
        return "  nothing was seen\n".to_owned();
    }
    let line = |sample: &Sample| {
        let mut line = format!(
            "{:>16}  {:>8}",
            sample.at.to_string(),
            CellRecord::raw(sample)
        );
        if record.scale.is_some() {
            let value = record.value(sample);
            let value = value.map_or("-".to_owned(), |value| figures(value, record.unit()));
            let _infallible = write!(line, "  {value} {}", record.unit());
        }
        if let [byte] = sample.bytes() {
            let names: Vec<_> = bits::set_in(record.address, *byte).collect();
            let _infallible = write!(line, "  {}", names.join(", "));
        }
        format!("{}\n", line.trim_end())
    };
    let mut out = String::new();
    if changes.len() <= CHANGES {
        out.extend(changes.iter().map(line));
    } else {
        let half = CHANGES / 2;
        out.extend(changes[..half].iter().map(line));
        let _infallible = writeln!(out, "  ... {} more ...", changes.len() - 2 * half);
        out.extend(changes[changes.len() - half..].iter().map(line));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::nd21::ram;
    use harness_proto::nd21::units::{DriveType, DriveUnits, Scale, SpeedRange};
    use harness_proto::time::{Instant, Span};

    fn record(address: u16, scale: Option<Scale>, every: Option<Span>) -> CellRecord {
        CellRecord {
            ring: 0,
            drive: 0,
            name: "cell".to_owned(),
            address,
            size: 2,
            scale,
            units: DriveUnits {
                device: DriveType::Nd5610,
                range: SpeedRange::To8000,
            },
            every,
            samples: Vec::new(),
        }
    }

    fn sample(ms: u64, bytes: &[u8]) -> Sample {
        Sample::new(Instant::START + Span::from_millis(ms), bytes)
    }

    /// A ramp of 10,000 samples: 100 columns and 20 rows are the most, from corner to corner.
    #[test]
    fn a_plot_has_bounds() {
        let every = Span::from_millis(1);
        let mut ramp = record(ram::NIST, Some(Scale::Speed), Some(every));
        for ms in 0..10_000_u16 {
            ramp.samples.push(sample(ms.into(), &ms.to_be_bytes()));
        }
        let text = plot(&ramp);
        assert!(text.is_ascii());
        assert_eq!(text.lines().count(), 20, "{text}");
        assert!(text.lines().all(|line| line.len() <= 100), "{text}");
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[1].trim_start().starts_with("2648."), "{text}");
        assert!(lines[1].ends_with('*'), "{text}");
        assert!(lines[17].trim_start().starts_with("0 rpm |**"), "{text}");
        assert!(lines[19].ends_with("9999.000 ms"), "{text}");
    }

    #[test]
    fn a_value_that_stays_is_one_line() {
        let mut flat = record(ram::NIST, Some(Scale::Speed), Some(Span::from_millis(10)));
        flat.samples = vec![sample(0, &[0, 0]), sample(10, &[0, 0])];
        assert_eq!(
            plot(&flat),
            "drive 0 cell, every 10.000 ms\n  0 rpm |**\n        +--\n         0.000 ms  10.000 ms\n"
        );
        flat.samples.clear();
        assert!(plot(&flat).contains("nothing was seen"));
        let mut off = record(
            ram::N_RAMPE_PLUS,
            Some(Scale::Ramp),
            Some(Span::from_millis(10)),
        );
        off.samples = vec![sample(0, &[0x7F, 0xFF])];
        assert!(plot(&off).contains("no meaning"));
    }

    #[test]
    fn changes_are_a_table_with_the_bits() {
        let mut changes = record(ram::PS_STATUS, None, None);
        changes.samples = vec![sample(0, &[0x00]), sample(5, &[0x28])];
        let text = plot(&changes);
        assert!(text.contains("5.000 ms        28  calculated, acceleration and constant drive\n"));
        for ms in 0..100 {
            changes.samples.push(sample(ms, &[0x01]));
        }
        assert!(plot(&changes).contains("... 42 more ..."));
    }
}
