//! A trace as a space-time diagram: the drives across, time down, a colour for what each was doing (SVG 1.1).
//!
//! A column is a link, headed by its sender, as in the manual's tables (ND21 9.7, 9.8). With [`RowPlacing::Index`] row n is the n-th byte of
//! each link. With [`RowPlacing::Time`] a byte is placed at its time, which shows how it goes round. A tooltip gives the meaning of a byte, its
//! rule and section. Equal neighbouring bytes are one rectangle. There are no scripts; colours follow the reader's light or dark scheme. A
//! long run is cut, and the picture says so.

pub(crate) mod cells;

use super::walk::SenderState;
use crate::report::pcapng::name;
use cells::{Area, Columns, areas};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::fmt::Write as _;
use std::ops::Range;

/// Maximum number of rows of a diagram; only the beginning of a longer run is drawn.
pub const MAX_ROWS: usize = 4_000;
/// Maximum number of rectangles of a picture: with the text of each, it stays well below 2 MB.
pub const MAX_AREAS: usize = 6_500;

/// How rows are placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowPlacing {
    /// Row n is the n-th byte of each link.
    #[default]
    Index,
    /// A byte is placed at its time.
    Time,
}

/// What is drawn, and how.
#[derive(Clone, Debug)]
pub struct Options<'o> {
    /// The heading; any text.
    pub title: &'o str,
    /// In front of the names of the picture's parts, where several stand in one page: letters and digits.
    pub id: &'o str,
    /// How rows are placed.
    pub scale: RowPlacing,
    /// The rate of the line.
    pub rate: Rate,
    /// The rows, counted from 0; all where `None`.
    pub rows: Option<Range<usize>>,
}

const LEFT: f64 = 64.0;
const TOP: f64 = 84.0;
const BOTTOM: f64 = 64.0;
const ROW: f64 = 14.0;
/// The tallest picture by time; a longer run has lower bytes.
const TALLEST: f64 = 30_000.0;
/// How wide a picture is at most, if its columns are not narrower than 6.
const WIDE: f64 = 1_400.0;
/// Bytes are written into columns as wide as this.
const LETTERS: f64 = 22.0;

/// One or two rings of a run, each a diagram of its own, one below the other.
#[must_use]
pub fn svg(traces: &[Trace], options: &Options<'_>) -> String {
    let drawn: Vec<_> = traces
        .iter()
        .enumerate()
        .map(|(ring, trace)| diagram(ring, trace, MAX_AREAS / traces.len(), options))
        .collect();
    let width = drawn.iter().map(|d| d.width).fold(800.0, f64::max);
    let height: f64 = drawn.iter().map(|d| d.height).sum::<f64>() + BOTTOM;
    let id = plain(options.id);
    let title = escape(options.title);
    let mut out = String::new();
    put(
        &mut out,
        format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" class=\"nb\" viewBox=\"0 0 {width:.0} {height:.0}\" \
             width=\"{width:.0}\" height=\"{height:.0}\" aria-labelledby=\"{id}-title {id}-desc\">\n\
             <title id=\"{id}-title\">{title}</title>\n<desc id=\"{id}-desc\">{}</desc>\n<style>{STYLE}</style>\n\
             <rect class=\"nb-page\" width=\"100%\" height=\"100%\"/>\n\
             <text class=\"nb-h\" x=\"12\" y=\"24\">{title}</text>\n",
            escape(&description(traces, &drawn, options)),
        ),
    );
    let mut y = 0.0;
    for diagram in &drawn {
        put(
            &mut out,
            format_args!(
                "<g transform=\"translate(0 {y:.0})\">\n{}</g>\n",
                diagram.text
            ),
        );
        y += diagram.height;
    }
    legend(&mut out, y + 16.0);
    out.push_str("</svg>\n");
    out
}

/// Plain rules without variables, which some viewers do not know.
const STYLE: &str = "\
.nb{font:11px ui-monospace,monospace}.nb-page{fill:#fff}.nb text{fill:#1b1f24}.nb .nb-h{font-size:15px;font-weight:600}\
.nb .nb-d{fill:#5d6670}.nb .nb-t{text-anchor:middle;pointer-events:none}.nb .nb-e{text-anchor:end}\
.nb .a{fill:#e6e9ed}.nb .b{fill:#b9d7f5}.nb .c{fill:#7fd09a}.nb .d{fill:#f28b82}.nb .e{fill:#f7c873}\
.nb .f{fill:#c9a7f0}.nb .g{fill:#d0d4d9}.nb .x{stroke:#b00020;stroke-width:2}\
@media(prefers-color-scheme:dark){.nb-page{fill:#14171a}.nb text{fill:#e6e9ec}.nb .nb-d{fill:#98a2ad}\
.nb .a{fill:#262b31}.nb .b{fill:#27527c}.nb .c{fill:#1f6f43}.nb .d{fill:#9c2f2a}.nb .e{fill:#8a621a}\
.nb .f{fill:#5d3f8f}.nb .g{fill:#474e57}.nb .x{stroke:#ff8a80}}";

/// The class of a state's colour.
pub(crate) fn class(state: SenderState) -> char {
    match state {
        SenderState::Idle => 'a',
        SenderState::Forwarding => 'b',
        SenderState::Addressed => 'c',
        SenderState::Zero => 'd',
        SenderState::Counting => 'e',
        SenderState::Sequence => 'f',
        SenderState::Other => 'g',
    }
}

struct Diagram {
    text: String,
    width: f64,
    height: f64,
    /// Rows or bytes that are not drawn.
    cut: bool,
    faults: Vec<String>,
}

fn diagram(ring: usize, trace: &Trace, most: usize, options: &Options<'_>) -> Diagram {
    let count = trace.channels.len().max(1);
    #[expect(clippy::cast_precision_loss, reason = "at most 251 columns")]
    let column = ((WIDE - LEFT) / count as f64).clamp(6.0, 48.0);
    let columns = Columns::read(trace, options.rows.clone());
    let all = areas(&columns, options.scale);
    let cut = columns.cut || all.len() > most;
    let areas = &all[..all.len().min(most)];
    let place = Placing::new(areas, options, column);
    let mut text = String::new();
    heads(&mut text, trace, column);
    axis(&mut text, &place);
    let mut faults = Vec::new();
    for area in areas {
        rectangle(&mut text, ring, trace, area, &place);
        if area.fault && faults.len() < 12 {
            let at = name(ring, &trace.channels[area.links.start]);
            let words = if area.remark.is_empty() {
                &area.status
            } else {
                &area.remark
            };
            faults.push(format!("{at} byte {}: {words}", area.rows.start + 1));
        }
    }
    if cut {
        put(
            &mut text,
            format_args!(
                "<text class=\"nb-d\" x=\"{LEFT}\" y=\"{:.0}\">the run goes on: only its beginning is drawn</text>\n",
                place.bottom + 16.0
            ),
        );
    }
    #[expect(clippy::cast_precision_loss, reason = "at most 251 columns")]
    let width = LEFT + column * count as f64 + 16.0;
    Diagram {
        text,
        width,
        height: place.bottom + 28.0,
        cut,
        faults,
    }
}

/// Where things stand.
struct Placing {
    scale: RowPlacing,
    column: f64,
    /// The first row, or the time of the upper edge.
    first: usize,
    from: u64,
    /// Thirds of a nanosecond to a unit of the picture.
    units: f64,
    byte: u64,
    bottom: f64,
}

impl Placing {
    #[expect(
        clippy::cast_precision_loss,
        reason = "places in a picture: good to far less than a unit"
    )]
    fn new(areas: &[Area], options: &Options<'_>, column: f64) -> Self {
        let byte = options.rate.byte_time().units();
        let first = areas.iter().map(|area| area.rows.start).min().unwrap_or(0);
        let last = areas.iter().map(|area| area.rows.end).max().unwrap_or(0);
        let starts = areas.iter().map(|area| area.from.saturating_sub(byte));
        let from = starts.min().unwrap_or(0);
        let until = areas.iter().map(|area| area.to).max().unwrap_or(0);
        let span = (until.saturating_sub(from)) as f64;
        let units = (byte as f64 / 8.0).max(span / TALLEST);
        let height = match options.scale {
            RowPlacing::Index => (last - first) as f64 * ROW,
            RowPlacing::Time => span / units,
        };
        Self {
            scale: options.scale,
            column,
            first,
            from,
            units,
            byte,
            bottom: TOP + height,
        }
    }

    #[expect(
        clippy::cast_precision_loss,
        reason = "places in a picture: good to far less than a unit"
    )]
    fn rectangle(&self, area: &Area) -> (f64, f64, f64, f64) {
        let x = LEFT + self.column * area.links.start as f64;
        let width = self.column * area.links.len() as f64;
        match self.scale {
            RowPlacing::Index => {
                let y = TOP + (area.rows.start - self.first) as f64 * ROW;
                (x, y, width, area.rows.len() as f64 * ROW)
            }
            RowPlacing::Time => {
                let from = area.from.saturating_sub(self.byte).max(self.from) - self.from;
                let y = TOP + from as f64 / self.units;
                let until = TOP + area.to.saturating_sub(self.from) as f64 / self.units;
                (x, y, width, (until - y).max(0.4))
            }
        }
    }
}

/// The senders above their columns; not each where there are many.
fn heads(out: &mut String, trace: &Trace, column: f64) {
    let mut free = 0.0;
    let mut x = LEFT + column / 2.0;
    for (place, link) in trace.channels.iter().enumerate() {
        let text = link.from.map_or("master".to_owned(), |k| k.to_string());
        let last = place + 1 == trace.channels.len();
        if x >= free || last && x + 20.0 >= free {
            put(
                out,
                format_args!(
                    "<text class=\"nb-t\" x=\"{x:.1}\" y=\"{}\">{text}</text>\n",
                    TOP - 8.0
                ),
            );
            free = x + if place == 0 { 44.0 } else { 26.0 };
        }
        x += column;
    }
}

/// Rows or times at the left edge.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most some hundred labels of a picture"
)]
fn axis(out: &mut String, place: &Placing) {
    let height = place.bottom - TOP;
    let head = match place.scale {
        RowPlacing::Index => "byte",
        RowPlacing::Time => "ms",
    };
    let mut label = |y: f64, text: &str| {
        put(
            out,
            format_args!(
                "<text class=\"nb-d nb-e\" x=\"{}\" y=\"{y:.1}\">{text}</text>\n",
                LEFT - 6.0
            ),
        );
    };
    label(TOP - 24.0, head);
    let step = (height / 200.0).ceil().max(1.0);
    match place.scale {
        RowPlacing::Index => {
            let rows = (height / ROW) as usize;
            for row in (0..rows).step_by((step * 5.0) as usize) {
                label(
                    TOP + row as f64 * ROW + 11.0,
                    &(place.first + row + 1).to_string(),
                );
            }
        }
        RowPlacing::Time => {
            let mut y = 0.0;
            while y <= height {
                let at = Span::from_units(place.from + (y * place.units) as u64);
                label(TOP + y + 4.0, &format!("{:.2}", at.as_millis_f64()));
                y += 40.0 * step;
            }
        }
    }
}

fn rectangle(out: &mut String, ring: usize, trace: &Trace, area: &Area, place: &Placing) {
    let (x, y, width, height) = place.rectangle(area);
    let mark = if area.fault { " x" } else { "" };
    let links = &trace.channels;
    let first = name(ring, &links[area.links.start]);
    let whence = if area.links.len() > 1 {
        format!("{first} to {}", name(ring, &links[area.links.end - 1]))
    } else {
        first
    };
    let which = if area.rows.len() > 1 {
        format!("bytes {} to {}", area.rows.start + 1, area.rows.end)
    } else {
        format!("byte {}", area.rows.start + 1)
    };
    let at = Span::from_units(area.from);
    let remark = if area.remark.is_empty() {
        String::new()
    } else {
        format!("; the drive: {}", area.remark)
    };
    put(
        out,
        format_args!(
            "<rect class=\"{}{mark}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\"><title>{}, {}, {at}: {}; {} \
             (ND21 {}){}</title></rect>\n",
            class(area.state),
            (width - 0.5).max(0.4),
            (height - 0.5).max(0.4),
            escape(&whence),
            which,
            area.status,
            escape(&area.words),
            area.section,
            escape(&remark),
        ),
    );
    if place.column >= LETTERS && place.scale == RowPlacing::Index {
        put(
            out,
            format_args!(
                "<text class=\"nb-t\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                x + width / 2.0,
                y + 11.0,
                area.letters
            ),
        );
    }
}

fn legend(out: &mut String, y: f64) {
    let (mut x, mut y) = (12.0, y);
    for state in SenderState::ALL {
        put(
            out,
            format_args!(
                "<rect class=\"{}\" x=\"{x}\" y=\"{y:.0}\" width=\"12\" height=\"12\"/>\
                 <text x=\"{}\" y=\"{:.0}\">{}</text>\n",
                class(state),
                x + 17.0,
                y + 10.0,
                state.name()
            ),
        );
        x += 34.0 + 6.7 * f64::from(u8::try_from(state.name().len()).unwrap_or(u8::MAX));
        if state == SenderState::Addressed {
            (x, y) = (12.0, y + 20.0);
        }
    }
    put(
        out,
        format_args!(
            "<rect class=\"g x\" x=\"{x}\" y=\"{y:.0}\" width=\"12\" height=\"12\"/>\
             <text x=\"{}\" y=\"{:.0}\">where a fault is</text>\n",
            x + 17.0,
            y + 10.0
        ),
    );
}

/// The description of the picture for screen readers.
fn description(traces: &[Trace], drawn: &[Diagram], options: &Options<'_>) -> String {
    let mut text =
        String::from("Space-time diagram: the links of the ring across, headed by their senders; ");
    text.push_str(match options.scale {
        RowPlacing::Index => "downwards the bytes, row n the n-th byte of each link.",
        RowPlacing::Time => "downwards the time.",
    });
    for (trace, diagram) in traces.iter().zip(drawn) {
        let bytes = trace
            .channels
            .iter()
            .map(|l| l.octets().len())
            .max()
            .unwrap_or(0);
        put(
            &mut text,
            format_args!(" A ring of {} drives, {bytes} bytes.", trace.stations),
        );
        for fault in &diagram.faults {
            put(&mut text, format_args!(" Fault: {fault}."));
        }
        if diagram.cut {
            text.push_str(" Only the beginning is drawn.");
        }
    }
    text
}

/// Writing to a String cannot fail.
fn put(out: &mut String, text: std::fmt::Arguments<'_>) {
    let _infallible = out.write_fmt(text);
}

/// Letters, digits, `-` and `_`: what a name of a part may hold.
fn plain(id: &str) -> String {
    let kept = id
        .chars()
        .filter(|c| c.is_ascii_alphanumeric() || "-_".contains(*c));
    let kept: String = kept.take(60).collect();
    if kept.starts_with(|c: char| c.is_ascii_alphabetic()) {
        kept
    } else {
        format!("nb{kept}")
    }
}

/// Text as text, whatever it holds: no markup, and no character that XML forbids.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' => out.push(' '),
            c if c.is_control() || matches!(c, '\u{FFFE}' | '\u{FFFF}') => out.push('\u{FFFD}'),
            c => out.push(c),
        }
    }
    out
}
